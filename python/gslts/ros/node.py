"""ROS 2 node `gslts`."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager

try:
    import rclpy
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.signals import SignalHandlerOptions
    from std_msgs.msg import String

    from gslts.ros.goals import QUEUE, Goals
    from gslts.ros.managed_node import make_node
    from gslts.ros.publishing import Publishing
    from gslts.ros.subscriptions import Subscriptions
except ImportError as error:
    raise ImportError(f"{error}: source ROS 2 first, such as /opt/ros/jazzy/setup.bash") from error

from gslts.ros.answers import failure_answer, words_of
from gslts.ros.config import NodeConfig
from gslts.ros.constants import DIAGNOSTICS_PERIOD_S
from gslts.ros.operation import Operation
from gslts.ros.problems import Problems
from gslts.ros.requests import Kind, Request
from gslts.ros.statuses import statuses


class GsltsNode:
    """Connects topics with the operation.

    Args:
        config: Settings.
        stop: Set if the node should end.

    Attributes:
        node: Of ROS.
        operation: Builds the map and keeps it up to date.

    Raises:
        ImportError: This ROS lacks messages that the settings need.
    """

    def __init__(self, config: NodeConfig, stop: threading.Event) -> None:
        self.node = node = make_node("gslts", stop)
        logger = node.get_logger()
        self._problems = Problems(logger.warning)
        received = Subscriptions(node, config, self._problems)
        self._received, self._intake, poses = received, received.intake, received.poses
        self._publishing = Publishing(node, config, lambda: poses.world)
        goals = Goals(node, config.topics.tilt, lambda: poses.world, self._on_foreign_goal)
        self.operation = Operation(
            config,
            self._intake,
            goals,
            self._publishing,
            self._problems,
            stop,
            self._now_s,
            logger.info,
        )
        for kind in ("query", "go", "command"):
            node.create_subscription(
                String, f"gslts/{kind}", lambda m, k=kind: self._on_words(k, m.data), QUEUE
            )
        node.create_timer(DIAGNOSTICS_PERIOD_S, self._diagnose)

    @contextmanager
    def typed_requests(self) -> Iterator[None]:
        """Answer the service and the action of gslts_msgs too, where it can be imported."""
        try:
            from gslts.ros.typed_requests import TypedRequests
        except ImportError:
            yield
            return
        with TypedRequests(self.operation) as typed:
            self._publishing.on_answer = typed.on_answer
            yield

    def _now_s(self) -> float:
        """Return the time of the clock of ROS, s; with use_sim_time, that of the simulation."""
        return float(self.node.get_clock().now().nanoseconds * 1e-9)

    def _on_words(self, kind: Kind, text: str) -> None:
        try:
            words = words_of(text)
            if kind == "query":
                self.operation.ask(words)
            else:
                self.operation.requests.add(Request(kind, words))
        except ValueError as error:
            self._publishing.answer(failure_answer(kind, text, str(error)))

    def _on_foreign_goal(self) -> None:
        if self.operation.robot is not None:
            self.operation.robot.leave_alone()

    def _diagnose(self) -> None:
        self._received.check()
        problems, state = self._problems.present(), self.operation.status()
        latencies_s = self._publishing.latencies_s
        self._publishing.diagnostics(statuses(self._intake.counts, latencies_s, problems, state))


def run_node(config: NodeConfig, stop: threading.Event) -> None:
    """Run the node until a stop is requested.

    Args:
        config: Settings.
        stop: Set if the node should end at the next safe point.

    Raises:
        OSError: A file cannot be read or written.
        ValueError: There is no map and none should be built, or it is damaged.
        RuntimeError: A lane failed.
    """
    # The signal handlers of rclpy would end publishers while they are in use.
    try:
        arguments = list(config.ros_arguments)
        rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:
        given, reason = " ".join(config.ros_arguments), str(error).partition(", at ")[0]
        raise ValueError(f"arguments of ROS: {given}: {reason}") from None
    executor = SingleThreadedExecutor()
    try:
        gslts_node = GsltsNode(config, stop)
        executor.add_node(gslts_node.node)
        failures: list[Exception] = []

        def spin() -> None:
            try:
                executor.spin()
            except Exception as error:  # Raised in the main thread.
                failures.append(error)
                stop.set()

        spinning = threading.Thread(target=spin, name="gslts-ros", daemon=True)
        spinning.start()
        try:
            with gslts_node.typed_requests():
                gslts_node.operation.run()
        finally:
            executor.shutdown()
            spinning.join()
            gslts_node.node.destroy_node()
        for failure in failures:
            raise RuntimeError(f"messages are not received: {failure}") from failure
    finally:
        rclpy.shutdown()
