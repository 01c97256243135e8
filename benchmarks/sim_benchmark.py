"""Time to generate, render, record and change homes; prints a markdown table.

python benchmarks/sim_benchmark.py    # about seven minutes, on an otherwise idle machine
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median

from gslts_bench.provenance import describe_machine
from gslts_sim import ROOM_TYPES, Home, make_home
from gslts_sim.capture import capture
from gslts_sim.contact_sheet import corner_cameras
from gslts_sim.controller import Controller
from gslts_sim.explore import explore
from gslts_sim.home_source import HomeSource
from gslts_sim.raycast import RayCaster
from gslts_sim.task import write_task
from gslts_sim.tasks import TaskMaker, TaskSettings

SEEDS = range(5)
"""Seeds of the homes of each room type."""
FRAMES, TASKS, TASKS_PER_HOME = 200, 600, 12
"""Frames of a recording, number of tasks, and maximum number of tasks per home."""


def seconds(work: Callable[[], object]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def row(label: str, unit: str, values: list[float]) -> None:
    low, middle, high = min(values), median(values), max(values)
    print(f"| {label} | {middle:.3g} {unit} | {low:.3g} to {high:.3g} |", flush=True)


def frame_ms(home: Home) -> list[float]:
    """Return the times of views from the corners, 640 x 480, on one core, after a warm-up."""
    caster = RayCaster(home, threads=1)
    cameras = corner_cameras(home, 640, 480)
    caster.render(cameras[0])
    return [1e3 * seconds(lambda camera=camera: caster.render(camera)) for camera in cameras]


def capture_s(home: Home, noise: str) -> float:
    viewpoints, _ = explore(home, FRAMES)
    robot = Controller(home, noise=noise)
    # If exploring needs fewer frames, some are taken twice.
    viewpoints = (viewpoints * FRAMES)[:FRAMES]
    with tempfile.TemporaryDirectory() as folder:
        return seconds(lambda: capture(robot, viewpoints, Path(folder)))


def tasks_s() -> float:
    maker, written = TaskMaker(TaskSettings(), 0), 0
    start = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        for number in range(10 * TASKS):
            room_type = list(ROOM_TYPES)[number % len(ROOM_TYPES)]
            source = HomeSource.of_seed(room_type, number // len(ROOM_TYPES))
            for task in maker.make(*source, min(TASKS_PER_HOME, TASKS - written)):
                write_task(task, Path(folder) / f"{written}.json")
                written += 1
            if written == TASKS:
                return time.perf_counter() - start
    raise RuntimeError(f"only {written} of {TASKS} tasks are possible")


def main() -> None:
    machine = describe_machine()
    print(f"{machine['cpu']}, {machine['cores']} cores\n")
    print("| | median | range |\n| --- | ---: | ---: |")
    homes = {
        (room_type, seed): make_home(room_type, seed) for room_type in ROOM_TYPES for seed in SEEDS
    }
    for room_type in ROOM_TYPES:
        times = [seconds(lambda key=(room_type, seed): make_home(*key)) for seed in SEEDS]
        row(f"make_home, {room_type}", "s", times)
    for lights in sorted({len(home.all_lights) for home in homes.values()}):
        group = [home for home in homes.values() if len(home.all_lights) == lights]
        times = [ms for home in group for ms in frame_ms(home)]
        row(f"RGB-D frame with shadows of {lights} lights, {len(group)} homes", "ms", times)
    for noise in ("none", "kinect"):
        times = [capture_s(homes[room_type, 0], noise) for room_type in ROOM_TYPES]
        row(f"recording of {FRAMES} frames, noise {noise}", "s", times)
    row(f"{TASKS} task scripts", "s", [tasks_s()])


if __name__ == "__main__":
    main()
