"""Load of the node `gslts ros` on 640x480 RGB-D frames at 30 Hz: CPU, memory, latency and drops.

    build/ros/bin/python benchmarks/ros_benchmark.py --minutes 10            # a robot that moves
    build/ros/bin/python benchmarks/ros_benchmark.py --minutes 10 --still    # one that stands

It records and maps a simulated home, and renders a path through it, once (some minutes, kept in
`--work`). Then it publishes the frames of the path, forth and back, with the stamps of the present
time, and observes the node from outside, as a process and by its topics. Nothing changes in the
home: a version that is published is an error of the node.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import qos_profile_sensor_data
from rclpy.serialization import serialize_message
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import CameraInfo, Image
from tqdm import tqdm

from gslts.core.camera import camera_from_fov
from gslts.core.se3 import product
from gslts.ros.image_message import image_message
from gslts.ros.pose_message import pose_message
from gslts.store.history import open_history
from gslts.types import Floats
from gslts_bench.provenance import describe_run
from gslts_bench.tables import Table
from gslts_sim import make_home
from gslts_sim.home import Home
from gslts_sim.raycast import RayCaster
from gslts_sim.robot_body import FOV_RAD
from gslts_sim.ros import messages
from gslts_sim.ros.drive import Drive
from gslts_sim.ros.node import FAST_DDS_PROFILE
from gslts_sim.ros.planar_pose import PlanarPose
from gslts_sim.ros.robot import base_from_camera
from gslts_sim.ros.route import plan_route
from gslts_sim.sensor import Sensor
from gslts_sim.walkable import floor_of, start_position

SIZE = (640, 480)
RATE_HZ = 30
PATH_FRAMES, STILL_FRAMES = 450, 30
"""Numbers of frames that are published again and again: 15 s of motion, and 1 s of noise."""
TILT_RAD = 0.35
"""Angle of the camera below the horizon, rad."""
WARM_UP_S = 120.0
"""Time after the first localized frame that does not count, s: the memory of keyframes fills."""
SAMPLE_S = 1.0
"""Time between two measurements of the process, s."""
START_S = 300.0
"""Maximum time until the first frame is localized, s."""
STAMP = slice(4, 12)
"""Bytes of a serialized message with a header that hold its stamp, after 4 bytes of CDR."""


@dataclass
class Observation:
    """Measurements of the node from outside.

    Attributes:
        times_s: Of the samples, from the end of the warm-up.
        cpu_s: CPU time of the process since its start, s, at each.
        rss_mib: Resident memory at each, MiB.
        latencies_s: From the stamp of a localized frame to its pose.
        sent: Number of frames sent, at each.
        frames: Numbers of frames from the last /diagnostics, at each.
        newest: The last one of these.
    """

    times_s: list[float] = field(default_factory=list)
    cpu_s: list[float] = field(default_factory=list)
    rss_mib: list[float] = field(default_factory=list)
    latencies_s: list[float] = field(default_factory=list)
    sent: list[int] = field(default_factory=list)
    frames: list[dict[str, str]] = field(default_factory=list)
    newest: dict[str, str] = field(default_factory=dict)


def path_poses(home: Home, seed: int) -> list[PlanarPose]:
    """Return the poses of a robot at 30 Hz on its way through a home."""
    floor, rng = floor_of(home), np.random.default_rng(seed)
    position = start_position(home, floor)
    drive = Drive(PlanarPose(*position.tolist(), 0.0))
    positions = floor.grid_positions(0.25, position)
    poses: list[PlanarPose] = []
    while len(poses) < PATH_FRAMES:
        if not drive.corners:
            goal = positions[rng.integers(len(positions))]
            drive.corners = list(plan_route(floor, drive.pose.position, goal).points[1:])
        drive.advance(1 / RATE_HZ)
        poses.append(drive.pose)
    return poses


def render_frames(home: Home, poses: list[PlanarPose], path: Path) -> None:
    """Write colour, depth and camera poses of a path as one file."""
    sensor = Sensor("kinect", seed=1)
    caster = RayCaster(home, sensor.lights(home))
    frames, cameras = [], []
    for number, pose in enumerate(tqdm(poses, desc="rendering", disable=None)):
        in_world = product(pose.matrix(float(home.space.box[0, 2])), base_from_camera(TILT_RAD))
        frames.append(sensor.take(caster, camera_from_fov(*SIZE, FOV_RAD, in_world), number)[0])
        cameras.append(in_world)
    millimetres = [np.rint(1000 * frame.depth).astype("<u2") for frame in frames]
    with path.open("wb") as file:
        np.savez(file, rgb=[frame.rgb for frame in frames], depth=millimetres, poses=cameras)


def prepare(work: Path, room: str, seed: int, still: bool) -> tuple[Path, Path]:
    """Make map and frames unless they exist; return their paths."""
    work.mkdir(parents=True, exist_ok=True)
    home_map, recording = work / f"{room}_{seed}_map", work / f"{room}_{seed}_recording"
    if not home_map.exists():
        shutil.rmtree(recording, ignore_errors=True)
        run = [sys.executable, "-m", "gslts"]
        capture = [*run, "sim", "capture", room, str(seed), "--out", str(recording)]
        subprocess.run(capture, check=True)
        make = [*run, "map", str(recording), "--preset", "fast", "--out", str(home_map)]
        subprocess.run(make, check=True)
    frames = work / f"{room}_{seed}_{'still' if still else 'moving'}.npz"
    if not frames.exists():
        home = make_home(room, seed)
        poses = path_poses(home, seed)
        render_frames(home, poses[:1] * STILL_FRAMES if still else poses, frames)
    return home_map, frames


class Publisher:
    """Publishes prepared frames at 30 Hz in a thread of its own."""

    def __init__(self, node: Any, path: Path) -> None:
        topics = {
            CameraInfo: "/camera/color/camera_info",
            Image: "/camera/color/image_raw",
            PoseStamped: "/camera/pose",
        }
        self._info, self._colour, self._pose = (
            node.create_publisher(kind, topic, qos_profile_sensor_data)
            for kind, topic in topics.items()
        )
        self._depth = node.create_publisher(
            Image, "/camera/aligned_depth_to_color/image_raw", qos_profile_sensor_data
        )
        with np.load(path) as arrays:
            rgb, depth, poses = arrays["rgb"], arrays["depth"], arrays["poses"]
        self._frames = [_serialized(*arrays) for arrays in zip(rgb, depth, poses, strict=True)]
        self.stop, self.sent = threading.Event(), 0
        self.thread = threading.Thread(target=self._work)

    def _work(self) -> None:
        order = [*range(len(self._frames)), *reversed(range(1, len(self._frames) - 1))]
        start_s = time.monotonic()
        while not self.stop.wait(max(0.0, start_s + self.sent / RATE_HZ - time.monotonic())):
            info, colour, depth, pose = self._frames[order[self.sent % len(order)]]
            stamp = np.array(divmod(time.time_ns(), 10**9), "<u4").tobytes()
            for publisher, message in (
                (self._pose, pose),
                (self._info, info),
                (self._depth, depth),
                (self._colour, colour),
            ):
                message[STAMP] = stamp
                publisher.publish(bytes(message))
            self.sent += 1


def _serialized(rgb: Any, depth: Any, world_from_camera: Floats) -> list[bytearray]:
    """Return the messages of a frame, without stamps."""
    header = messages.header(0, messages.OPTICAL)
    pose = PoseStamped(header=messages.header(0, messages.ODOM))
    pose.pose = pose_message(world_from_camera)
    made = (
        messages.camera_info(camera_from_fov(*SIZE, FOV_RAD, world_from_camera), 0),
        image_message(header, rgb),
        image_message(header, depth, "16UC1"),
        pose,
    )
    return [bytearray(serialize_message(message)) for message in made]


def subscribe(node: Any, seen: Observation) -> None:
    """Collect what the node publishes."""

    def on_pose(message: PoseWithCovarianceStamped) -> None:
        stamp = message.header.stamp
        seen.latencies_s.append(time.time() - stamp.sec - stamp.nanosec * 1e-9)

    def on_diagnostics(message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name == "gslts: frames":
                seen.newest = {pair.key: pair.value for pair in status.values}

    node.create_subscription(PoseWithCovarianceStamped, "/gslts/pose", on_pose, 10)
    node.create_subscription(DiagnosticArray, "/diagnostics", on_diagnostics, 10)


def observe(
    process: subprocess.Popen[bytes], publisher: Publisher, seen: Observation, minutes: float
) -> None:
    """Measure the process of the node, after a warm-up."""
    watched, give_up_s = psutil.Process(process.pid), time.monotonic() + START_S
    while not seen.latencies_s:
        if process.poll() is not None or time.monotonic() > give_up_s:
            raise RuntimeError("the node localizes no frame; see its log")
        time.sleep(SAMPLE_S)
    time.sleep(WARM_UP_S)
    seen.latencies_s.clear()
    start_s = time.monotonic()
    with tqdm(total=round(60 * minutes), desc="measuring", unit="s", disable=None) as bar:
        while (now_s := time.monotonic() - start_s) < 60 * minutes:
            if process.poll() is not None:
                raise RuntimeError(f"the node ended with exit status {process.returncode}")
            with watched.oneshot():
                used = watched.cpu_times()
                seen.rss_mib.append(watched.memory_info().rss / 2**20)
            seen.times_s.append(now_s)
            seen.cpu_s.append(used.user + used.system)
            seen.sent.append(publisher.sent)
            seen.frames.append(seen.newest)
            bar.update(round(now_s) - bar.n)
            time.sleep(SAMPLE_S)


def numbers_of(seen: Observation, versions: int) -> dict[str, float]:
    """Return the results."""
    seconds = seen.times_s[-1] - seen.times_s[0]
    part = max(1, len(seen.rss_mib) // 10)
    first, last = (float(np.median(mib)) for mib in (seen.rss_mib[:part], seen.rss_mib[-part:]))
    latencies_ms = 1000 * np.array(seen.latencies_s)

    def counted(name: str) -> float:
        first, last = (float(seen.frames[k].get(name, "nan")) for k in (0, -1))
        return last - first

    return {
        "CPU, cores": (seen.cpu_s[-1] - seen.cpu_s[0]) / seconds,
        "memory in the first tenth, MiB": first,
        "memory in the last tenth, MiB": last,
        "growth, %": 100 * (last / first - 1),
        "maximum memory, MiB": max(seen.rss_mib),
        "frames localized per s": len(latencies_ms) / seconds,
        "latency, median, ms": float(np.median(latencies_ms)),
        "latency, 95 %, ms": float(np.quantile(latencies_ms, 0.95)),
        "frames sent": seen.sent[-1] - seen.sent[0],
        **{f"frames {name}": counted(name) for name in ("received", "dropped", "judged")},
        "versions published": versions,
    }


def measure(home_map: Path, frames: Path, work: Path, minutes: float) -> dict[str, float]:
    """Run the node on the frames; return the results."""
    live = work / "live_map"
    shutil.rmtree(live, ignore_errors=True)
    shutil.copytree(home_map, live)
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    node, executor, seen = rclpy.create_node("benchmark"), SingleThreadedExecutor(), Observation()
    executor.add_node(node)
    publisher = Publisher(node, frames)
    subscribe(node, seen)
    spinning = threading.Thread(target=executor.spin)
    command = [sys.executable, "-m", "gslts", "ros", "--map", str(live), "--pose", "/camera/pose"]
    with (work / "node.log").open("wb") as log:
        process = subprocess.Popen(command, stdout=log, stderr=log)
    try:
        spinning.start()
        publisher.thread.start()
        observe(process, publisher, seen, minutes)
    finally:
        process.send_signal(signal.SIGINT)
        process.wait()
        publisher.stop.set()
        publisher.thread.join()
        executor.shutdown()
        spinning.join()
        node.destroy_node()
        rclpy.shutdown()
    return numbers_of(seen, _versions(live) - _versions(home_map))


def _versions(folder: Path) -> int:
    with open_history(folder) as history:
        return len(history.versions())


def main() -> None:
    """Measure, and print a table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--room", default="living_room")
    parser.add_argument("--seed", type=int, default=3, help="of the home")
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--still", action="store_true", help="the robot does not move")
    parser.add_argument("--work", type=Path, default=Path("out/ros_benchmark"))
    parser.add_argument("--json", type=Path, help="file for the result")
    given = parser.parse_args()
    os.environ.setdefault("FASTRTPS_DEFAULT_PROFILES_FILE", str(FAST_DDS_PROFILE))
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    origin = describe_run()
    home_map, frames = prepare(given.work, given.room, given.seed, given.still)
    numbers = measure(home_map, frames, given.work, given.minutes)
    rows = [
        [name, f"{value:,.0f}" if value >= 1000 else f"{value:.3g}"]
        for name, value in numbers.items()
    ]
    state = "stands still" if given.still else "moves"
    title = f"The robot {state}, {given.minutes:g} minutes in {given.room} {given.seed}"
    table = Table(title, ["", ""], rows)
    print(table.markdown())
    if given.json is not None:
        tables = [{"title": title, "header": ["", ""], "rows": rows, "note": ""}]
        result = {"title": title, **origin, "tables": tables, "numbers": numbers}
        given.json.write_text(json.dumps(result, indent=1) + "\n")


if __name__ == "__main__":
    main()
