"""A day of a robot over ROS 2: it maps a room, finds six changes, and goes to an object that moved.

Needs `rclpy`: source ROS 2 first, or use the interpreter that `scripts/setup ros` makes.
Usage: python examples/ros_day.py --out out/ros_day
"""

import argparse
import json
import os
import queue
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import rclpy
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from matplotlib.patches import Rectangle
from nav_msgs.msg import OccupancyGrid
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from rclpy.signals import SignalHandlerOptions
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore
from sensor_msgs.msg import Image
from std_msgs.msg import String
from std_srvs.srv import Trigger
from visualization_msgs.msg import MarkerArray

from gslts.store.describe import describe_event
from gslts.store.history import open_history
from gslts_bench.series.events import is_untrue, true_events, was_found
from gslts_sim.day import read_day
from gslts_sim.task import Change

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
RECORDED = {
    "/camera/pose": PoseStamped,
    "/gslts/pose": PoseWithCovarianceStamped,
    "/gslts/changes": MarkerArray,
    "/gslts/grid": OccupancyGrid,
    "/gslts/view": Image,
    "/gslts/events": String,
    "/gslts/answer": String,
}
"""Topics that go into the bag."""
TIMEOUT_S = 1200.0
"""Maximum time of one step: a stranger's laptop may be slow."""


class Director:
    """Asks the nodes of the robot and of gslts for the steps of the day, and records a bag."""

    def __init__(self, bag: Path) -> None:
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        self._node = node = rclpy.create_node("director")
        self._said: queue.Queue[dict[str, Any]] = queue.Queue()
        self.poses: dict[str, np.ndarray] = {}
        self.path: list[np.ndarray] = []
        self.grid: OccupancyGrid | None = None
        types = get_typestore(Stores.ROS2_HUMBLE)
        self._writer = Writer(bag, version=9, storage_plugin=StoragePlugin.MCAP)
        self._writer.open()
        for topic, kind in RECORDED.items():
            package, _, _ = kind.__module__.partition(".msg.")
            connection = self._writer.add_connection(
                topic, f"{package}/msg/{kind.__name__}", typestore=types
            )
            qos = LATCHED if topic in ("/gslts/changes", "/gslts/grid") else qos_profile_sensor_data
            node.create_subscription(
                kind, topic, lambda raw, c=connection: self._record(c, raw), qos, raw=True
            )
        node.create_subscription(String, "/gslts/events", self._on_text, 100)
        node.create_subscription(String, "/gslts/answer", self._on_text, 100)
        node.create_subscription(PoseWithCovarianceStamped, "/gslts/pose", self._on_pose, 10)
        node.create_subscription(OccupancyGrid, "/gslts/grid", self._on_grid, LATCHED)
        for topic in ("/camera/pose", "/robot/true_pose"):
            node.create_subscription(
                PoseStamped, topic, lambda m, t=topic: self._on_stamped(t, m), 10
            )
        self._words = {
            kind: node.create_publisher(String, f"/gslts/{kind}", 10)
            for kind in ("query", "go", "command")
        }
        self._change = node.create_client(Trigger, "/robot/change")
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(node)
        self._thread = threading.Thread(target=self._executor.spin)
        self._thread.start()

    def close(self) -> None:
        self._executor.shutdown()
        self._thread.join()
        self._writer.close()
        self._node.destroy_node()
        rclpy.shutdown()

    def wait(self, key: str, value: str) -> dict[str, Any]:
        """Wait for an event or an answer in which a key has a value."""
        end_s = time.monotonic() + TIMEOUT_S
        while time.monotonic() < end_s:
            try:
                said = self._said.get(timeout=1)
            except queue.Empty:
                continue
            if said.get("event") == "log":
                print("  " + said["line"], flush=True)
            if said.get(key) == value:
                return said
            if said.get("status") == "failed":
                raise RuntimeError(said)
        raise TimeoutError(f"{key} {value}: nothing came within {TIMEOUT_S:g} s")

    def say(self, kind: str, words: str) -> None:
        self._words[kind].publish(String(data=words))

    def change(self) -> str:
        """Let the next change of the home happen."""
        for _ in range(20):
            done = threading.Event()
            future = self._change.call_async(Trigger.Request())
            future.add_done_callback(lambda _, d=done: d.set())
            done.wait(TIMEOUT_S)
            if future.result().success:
                return str(future.result().message)
            time.sleep(2)  # The robot may be in its way.
        raise RuntimeError(future.result().message)

    def odometry_from_world(self) -> np.ndarray:
        """[4,4] of the simulated home, as long as the robot has not moved."""
        while len(self.poses) < 2:
            time.sleep(0.1)
        return self.poses["/camera/pose"] @ np.linalg.inv(self.poses["/robot/true_pose"])

    def _record(self, connection: Any, raw: bytes) -> None:
        self._writer.write(connection, time.time_ns(), raw)

    def _on_text(self, message: String) -> None:
        self._said.put(json.loads(message.data))

    def _on_stamped(self, topic: str, message: PoseStamped) -> None:
        from gslts.datasets.poses import pose_from_quat

        p, q = message.pose.position, message.pose.orientation
        self.poses[topic] = pose_from_quat((q.w, q.x, q.y, q.z), (p.x, p.y, p.z))

    def _on_pose(self, message: PoseWithCovarianceStamped) -> None:
        position = message.pose.pose.position
        self.path.append(np.array([position.x, position.y]))

    def _on_grid(self, message: OccupancyGrid) -> None:
        self.grid = message


def start(out: Path, name: str, *arguments: str) -> subprocess.Popen[bytes]:
    log = (out / f"{name}.log").open("wb")
    return subprocess.Popen(
        [sys.executable, "-m", "gslts", *arguments], stdout=log, stderr=subprocess.STDOUT
    )


def stop(process: subprocess.Popen[bytes], name: str) -> None:
    process.send_signal(signal.SIGINT)
    if process.wait(TIMEOUT_S) != 0:
        raise RuntimeError(f"{name} ended with exit status {process.returncode}")


def run_day(out: Path, given: argparse.Namespace) -> dict[str, Any]:
    """Let the robot map the room, and live the day; return what happened."""
    size = ("--width", str(given.width), "--height", str(given.width * 3 // 4))
    home = (given.room, str(given.seed))
    day_path = out / "day" / "day.json"
    subprocess.run(
        [
            *(sys.executable, "-m", "gslts", "sim", "day", *home, *size),
            *("--changes", str(given.changes), "--frames", "1", "--out", str(out / "day")),
        ],
        check=True,
        stdout=subprocess.DEVNULL,
    )
    events = [event for round_ in read_day(day_path).rounds for event in round_]
    director, clock = Director(out / "bag"), time.monotonic()
    robot = start(out, "robot", "sim", "ros", *home, *size, "--day", str(day_path))
    origin = director.odometry_from_world()
    node = start(
        out,
        "gslts",
        *("ros", "--map", str(out / "map"), "--build", "--active", "--pose", "/camera/pose"),
        *("--tilt", "/tilt_controller/commands", "--viewpoints", str(given.viewpoints)),
        *("--labels", "/camera/labels", "--label-names", "/camera/label_names"),
    )
    seconds: dict[str, float] = {}

    def note(step: str) -> None:
        seconds[step] = time.monotonic() - clock - sum(seconds.values())
        print(f"{step}: {seconds[step]:.0f} s", flush=True)

    try:
        director.wait("event", "explored")
        note("exploration")
        director.wait("event", "built")
        note("building the map")
        for first in range(0, len(events), given.per_round):
            for _ in events[first : first + given.per_round]:
                print(director.change(), flush=True)
            director.say("command", "round")
            director.wait("event", "done")
            note(f"round {1 + first // given.per_round}")
        moved = [event.change for event in events if event.change.kind != "removal"][-1]
        director.say("query", moved.object_type)
        answer = director.wait("query", moved.object_type)
        director.say("go", moved.object_type)
        errand = director.wait("go", moved.object_type)
        note("query and errand")
    finally:
        stop(node, "gslts ros")
        stop(robot, "gslts sim ros")
        director.close()
    return {
        "seconds": seconds,
        "changes": [in_frame(event.change, origin) for event in events],
        "answer": answer,
        "errand": errand,
        "path": director.path,
        "grid": director.grid,
    }


def in_frame(change: Change, frame_from_world: np.ndarray) -> Change:
    """Return a true change in the frame of the map, with the boxes around its turned boxes."""
    boxes = {}
    for name in ("box_before", "box_after"):
        box = getattr(change, name)
        if box is not None:
            corners = np.array(np.meshgrid(*np.array(box).T)).reshape(3, 8).T
            turned = corners @ frame_from_world[:3, :3].T + frame_from_world[:3, 3]
            boxes[name] = (tuple(turned.min(axis=0)), tuple(turned.max(axis=0)))
    return change.model_copy(update=boxes)


def draw(path: Path, grid: OccupancyGrid, walked: list[np.ndarray], events: list[Any]) -> None:
    """Draw the floor, the path of the robot, and what came (green) and went (red)."""
    mpl.use("Agg")
    from matplotlib import pyplot as plt

    cells = np.array(grid.data, np.int8).reshape(grid.info.height, grid.info.width)
    shades = np.where(cells < 0, 0.75, np.where(cells > 0, 0.2, 1.0))
    x, y = grid.info.origin.position.x, grid.info.origin.position.y
    side = grid.info.resolution * grid.info.width
    figure, axes = plt.subplots(figsize=(7, 7))
    axes.imshow(shades, "gray", vmin=0, vmax=1, origin="lower", extent=(x, x + side, y, y + side))
    if walked:
        axes.plot(*np.array(walked).T, color="tab:blue", linewidth=0.7, label="path of the robot")
    for event in events:
        for box, color in zip(event.boxes, ("tab:red", "tab:green"), strict=True):
            if box is None:
                continue
            (x0, y0, _), (x1, y1, _) = box
            axes.add_patch(
                Rectangle((x0, y0), x1 - x0, y1 - y0, fill=False, color=color, linewidth=2)
            )
        box = event.boxes[1] or event.boxes[0]
        if box is not None:
            axes.annotate(f"{event.kind}: {event.type}", box[1][:2], fontsize=8)
    axes.set(xlabel="x, m", ylabel="y, m", title="What the robot found over the day")
    figure.savefig(path, dpi=120, bbox_inches="tight")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True, help="new folder")
    parser.add_argument("--room", default="living_room")
    parser.add_argument("--seed", type=int, default=3)
    parser.add_argument("--changes", type=int, default=6)
    parser.add_argument("--per-round", type=int, default=2, help="changes before each round")
    parser.add_argument("--viewpoints", type=int, default=12, help="of a round")
    parser.add_argument("--width", type=int, default=640, help="of the images, px")
    given = parser.parse_args()
    given.out.mkdir(parents=True)
    # Only this machine hears the nodes, in a domain of their own.
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    os.environ.setdefault("ROS_DOMAIN_ID", str(1 + os.getpid() % 100))
    result = run_day(given.out, given)
    with open_history(given.out / "map") as history:
        newest = history.versions()[-1].number
        reported, _ = history.events_between(1, newest)
    for event in reported:
        print(describe_event(event))
    true = true_events(result["changes"])
    found = sum(was_found(change, reported) for change in true)
    untrue = sum(is_untrue(event, true) for event in reported)
    draw(given.out / "day.png", result["grid"], result["path"], reported)
    boxes = len(result["answer"]["objects"])
    print(
        f"{found} of {len(true)} changes found, {untrue} untrue events; query: {boxes} object(s); "
        f"errand: {result['errand']['status']}; {sum(result['seconds'].values()):.0f} s; see "
        f"{given.out / 'day.png'} and {given.out / 'bag'}"
    )
    if found < len(true) - 1 or result["errand"]["status"] != "reached":
        sys.exit(1)


if __name__ == "__main__":
    main()
