"""A ROS 2 peer of the tests: a process of the interpreter that has rclpy, driven over a pipe.

The tests run without ROS; the peer subscribes, publishes and calls for them, over DDS on loopback
and in a domain of its own. Messages are dicts of their fields, sequences of numbers numpy arrays.
"""

import contextlib
import fcntl
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from importlib import import_module
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path
from tempfile import gettempdir
from typing import Any

import numpy as np

ROOT = Path(__file__).parents[2]
LONG_S = 60.0
"""More than anything here takes: what lasts so long has failed."""
DOMAINS = range(1, 100)
"""Domain ids whose ports are no ephemeral ports."""
KEPT = 200
"""Number of messages of a topic that wait for the test; older ones are dropped."""

Message = dict[str, Any]


def ros_python() -> Path | None:
    """Return the interpreter that has rclpy; None if there is none."""
    python = Path(os.environ.get("GSLTS_ROS_PYTHON", ROOT / "build/ros/bin/python"))
    return python if python.exists() else None


MISSING = "" if ros_python() else "needs an interpreter with rclpy: scripts/setup ros"
"""Reason to skip tests; empty if there is none."""


class Ros:
    """A ROS domain with a peer and processes of gslts."""

    def __init__(self, domain: int, connection: Connection) -> None:
        self._domain, self._connection = domain, connection

    def start(self, *arguments: str | Path, cwd: Path) -> subprocess.Popen[str]:
        """Start the command gslts in this domain; end it with `ended`.

        Args:
            arguments: Of the command.
            cwd: Folder in which it runs.
        """
        return subprocess.Popen(
            [str(ros_python()), "-m", "gslts", *map(str, arguments)],
            cwd=cwd,
            text=True,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            env=_environment(self._domain),
        )

    def subscribe(
        self, topic: str, kind: str, *, best_effort: bool = False, latched: bool = False
    ) -> None:
        """Collect the messages of a topic.

        Args:
            topic: Its name.
            kind: Such as "sensor_msgs/msg/Image".
            best_effort: Do not ask for lost messages.
            latched: Ask for messages from before.
        """
        self._ask("subscribe", topic, kind, best_effort, latched)

    def take(self, topic: str) -> list[Message]:
        """Return the messages of a topic since the last call, the oldest one first.

        Args:
            topic: A subscribed one.
        """
        return self._ask("take", topic)

    def wait(self, topic: str, is_it: Callable[[Message], bool] = lambda _: True) -> Message:
        """Return the first message since the last call that is as expected.

        Args:
            topic: A subscribed one; messages that came together with that message are dropped.
            is_it: Takes a message.
        """
        give_up_s = time.monotonic() + LONG_S
        while time.monotonic() < give_up_s:
            for message in self.take(topic):
                if is_it(message):
                    return message
            time.sleep(0.05)
        raise AssertionError(f"no such message on {topic} within {LONG_S:g} s")

    def next(self, topic: str) -> Message:
        """Return the next message of a topic that comes.

        Args:
            topic: A subscribed one.
        """
        self.take(topic)
        return self.wait(topic)

    def publish(self, topic: str, kind: str, **fields: Any) -> None:
        """Publish a message as soon as somebody subscribes to the topic.

        Args:
            topic: Its name.
            kind: Such as "geometry_msgs/msg/PoseStamped".
            fields: Of the message; those of inner messages are dicts.
        """
        self._ask("publish", topic, kind, fields)

    def call(self, service: str, kind: str, **fields: Any) -> Message:
        """Call a service, and return its response.

        Args:
            service: Its name.
            kind: Such as "std_srvs/srv/Trigger".
            fields: Of the request.
        """
        return self._ask("call", service, kind, fields)

    def _ask(self, name: str, *arguments: Any) -> Any:
        self._connection.send((name, *arguments))
        answer = self._connection.recv()
        if isinstance(answer, Exception):
            raise answer
        return answer


@contextlib.contextmanager
def ros_domain() -> Iterator[Ros]:
    """Provide a domain that no other test uses, with a peer."""
    with own_domain() as domain:
        ours, theirs = Pipe()
        with (
            ours,
            subprocess.Popen(
                [str(ros_python()), __file__, str(theirs.fileno())],
                env=_environment(domain),
                pass_fds=[theirs.fileno()],
            ) as process,
        ):
            theirs.close()  # So that ours ends when the process does.
            yield Ros(domain, ours)
            ours.close()
            process.wait(LONG_S)


def first_line(process: subprocess.Popen[str]) -> str:
    """Wait until a process says something; fail if it ends instead.

    Args:
        process: Started by `Ros.start`.
    """
    assert process.stdout is not None
    line = process.stdout.readline()
    if not line:
        raise AssertionError(process.communicate()[1])
    return line


def ended(process: subprocess.Popen[str], number: signal.Signals) -> tuple[int, str, str]:
    """End a process by a signal.

    Args:
        process: Started by `Ros.start`.
        number: Of the signal.

    Returns:
        Exit status, output and errors.
    """
    process.send_signal(number)
    output, errors = process.communicate(timeout=LONG_S)
    return process.returncode, output, errors


def _environment(domain: int) -> dict[str, str]:
    local = {"ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    local["FASTRTPS_DEFAULT_PROFILES_FILE"] = str(ROOT / "python/gslts_sim/ros/fastdds.xml")
    return {**os.environ, **local, "NO_COLOR": "1", "COLUMNS": "200"}


@contextlib.contextmanager
def own_domain() -> Iterator[int]:
    """Lock a domain id against other test processes of this machine."""
    for domain in DOMAINS:
        path = Path(gettempdir()) / f"gslts-ros-domain-{os.getuid()}-{domain}"
        with path.open("w") as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                continue
            yield domain
            return
    raise AssertionError("all domain ids are in use")


class _Peer:
    """The other end of `Ros`, in the interpreter that has rclpy."""

    def __init__(self) -> None:
        import rclpy

        self.node = rclpy.create_node("peer")
        self._received: dict[str, list[Any]] = {}
        self._publishers: dict[str, Any] = {}
        self._clients: dict[str, Any] = {}

    def subscribe(self, topic: str, kind: str, best_effort: bool, latched: bool) -> None:
        from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

        profile = QoSProfile(depth=KEPT)
        if best_effort:
            profile.reliability = ReliabilityPolicy.BEST_EFFORT
        if latched:
            profile.durability = DurabilityPolicy.TRANSIENT_LOCAL
        kept = self._received[topic] = []
        self.node.create_subscription(
            _type(kind), topic, lambda message: _keep(kept, message), profile
        )

    def take(self, topic: str) -> list[Message]:
        kept = self._received[topic]
        messages = kept[:]
        del kept[: len(messages)]
        return [_fields(message) for message in messages]

    def publish(self, topic: str, kind: str, fields: Message) -> None:
        if topic not in self._publishers:
            self._publishers[topic] = self.node.create_publisher(_type(kind), topic, 10)
        publisher = self._publishers[topic]
        _wait(lambda: publisher.get_subscription_count() > 0, f"nobody subscribes to {topic}")
        publisher.publish(_message(_type(kind), fields))

    def call(self, service: str, kind: str, fields: Message) -> Message:
        if service not in self._clients:
            self._clients[service] = self.node.create_client(_type(kind), service)
        client = self._clients[service]
        if not client.wait_for_service(LONG_S):
            raise AssertionError(f"there is no service {service}")
        future = client.call_async(_message(_type(kind).Request, fields))
        _wait(future.done, f"{service} does not answer")
        return _fields(future.result())


def _keep(kept: list[Any], message: Any) -> None:
    kept.append(message)
    del kept[:-KEPT]


def _wait(is_done: Callable[[], bool], reason: str) -> None:
    give_up_s = time.monotonic() + LONG_S
    while not is_done():
        if time.monotonic() > give_up_s:
            raise AssertionError(reason)
        time.sleep(0.01)


def _type(kind: str) -> Any:
    package, group, name = kind.split("/")
    return getattr(import_module(f"{package}.{group}"), name)


def _message(kind: Any, fields: Message) -> Any:
    """Return a message with some fields set."""
    message = kind()
    for name, value in fields.items():
        if isinstance(value, dict):
            value = _message(type(getattr(message, name)), value)
        setattr(message, name, value)
    return message


def _fields(value: Any) -> Any:
    """Return the fields of a message."""
    if hasattr(value, "get_fields_and_field_types"):
        return {name: _fields(getattr(value, name)) for name in value.get_fields_and_field_types()}
    if isinstance(value, list):
        return [_fields(item) for item in value]
    return value if isinstance(value, (str, bool, int, float, bytes)) else np.asarray(value)


def _serve(pipe: int) -> None:
    import rclpy
    from rclpy.executors import SingleThreadedExecutor

    rclpy.init()
    peer, executor = _Peer(), SingleThreadedExecutor()
    executor.add_node(peer.node)
    thread = threading.Thread(target=executor.spin)
    thread.start()
    with Connection(pipe) as connection:
        while True:
            try:
                name, *arguments = connection.recv()
            except EOFError:
                break
            try:
                connection.send(getattr(peer, name)(*arguments))
            except Exception as error:  # Raised again in the test.
                connection.send(AssertionError(f"{type(error).__name__}: {error}"))
    executor.shutdown()
    thread.join()
    peer.node.destroy_node()
    rclpy.shutdown()


if __name__ == "__main__":
    _serve(int(sys.argv[1]))
