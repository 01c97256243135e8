"""How often an update settles a change: the detector sees nothing there, and no version follows.

    python benchmarks/settled_benchmark.py                        # 20 seeds, 3 kinds, 2 rooms
    python benchmarks/settled_benchmark.py --seeds 0:4 --rooms kitchen

A robot goes a round after a change and keeps the map up to date. Then (a) the detector compares the
map with new frames that look at the place, and (b) the robot goes a second round. The seed of a case
decides the noise of all frames after the mapping, and which of the room's changes is made; each room
is mapped several times with other noise, and its cases take these maps in turn.
"""

from __future__ import annotations

import argparse
import json
import shutil
import time
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from tqdm import tqdm

from gslts.camera_files import cameras_of_map
from gslts.change.config import DetectionConfig
from gslts.change.detect import ChangeDetector
from gslts.datasets import open_dataset
from gslts.loop.keeper import LoopConfig, MapKeeper
from gslts.loop.rounds import stops_of
from gslts.map_folder import write_map_folder
from gslts.mapping.config import PRESETS
from gslts.mapping.engine import make_map
from gslts.sim.actions import SceneState
from gslts.sim.capture import capture
from gslts.sim.controller import Controller
from gslts.sim.explore import explore
from gslts.sim.home import Home
from gslts.sim.home_source import HomeSource
from gslts.sim.task import Task
from gslts.sim.tasks import KINDS, TaskMaker
from gslts.sim.trial import Setting
from gslts.update.config import UpdateConfig

ROOM_SEED = 20
"""Of the homes; seeds below 5,000 develop."""
TASKS = 12
"""Changes of a room, a third of each kind."""
FRAMES = 90
"""Of a recording, at most."""
NEAR_M = 0.15
"""A report so near to where the object was or is counts as one at that place."""


def robot_in(state: SceneState, width: int, seed: int) -> Controller:
    """A robot with a noisy camera."""
    return Controller(state, width=width, height=width * 3 // 4, noise="kinect", seed=seed)


def write_map(state: SceneState, width: int, seed: int, folder: Path) -> None:
    """Maps a home with the noise of a seed, unless that was done before."""
    if folder.exists():
        return
    robot = robot_in(state, width, seed)
    looks, _ = explore(robot.home, FRAMES)
    with TemporaryDirectory() as visit:
        capture(robot, tqdm(looks, desc="recording", leave=False), Path(visit) / "visit")
        with tqdm(total=100, desc="mapping", leave=False) as bar:
            result = make_map(
                open_dataset(Path(visit) / "visit"),
                PRESETS["fast"].model_copy(update={"seed": seed, "threads": 1}),
                report=lambda progress: bar.update(round(100 * progress.share) - bar.n) and None,
            )
    cameras = {name: one.camera() for name, one in result.training.items()}
    write_map_folder(folder, result.gaussian_map, {"dataset": "visit"}, cameras)


def reports(
    detector: ChangeDetector, robot: Controller, task: Task
) -> tuple[list[float | None], int]:
    """Confidences of what the detector reports at the place of a change, one of each near view.

    Returns:
        The greatest confidence in each view that tells something, None where nothing is reported
        there; and how many views are unreliable.
    """
    told: list[float | None] = []
    unreliable = 0
    for viewpoint in task.test_viewpoints.near:
        robot.go(viewpoint.look)
        detection = detector.detect(robot.observe())
        unreliable += detection.unreliable is not None
        own = [one.confidence for one in detection.changes if is_at(one.point, task)]
        told.append(max(own, default=None))
    return told, unreliable


def is_at(point: np.ndarray, task: Task) -> bool:
    """Whether a point (3,) is where the object of a task was or is, or near."""
    boxes = [np.array(box) for box in (task.change.box_before, task.change.box_after) if box]
    return any(((point >= low - NEAR_M) & (point <= high + NEAR_M)).all() for low, high in boxes)


def run_case(
    task: Task, home: Home, made: Path, seed: int, given: argparse.Namespace
) -> dict[str, Any]:
    """What two rounds do after a change."""
    state = task.states(home)[1]
    config = LoopConfig(
        stops=given.stops,
        detection=DetectionConfig(halvings=0),
        update=UpdateConfig(threads=1),
    )
    said: list[str] = []
    start_s = time.process_time()
    with TemporaryDirectory() as folder:
        shutil.copytree(made, Path(folder) / "map")
        with MapKeeper(Path(folder) / "map", config, say=said.append) as keeper:
            robot = robot_in(state, given.width, 1_000_000 + seed)
            robot.go(task.viewpoint.look)
            known = cameras_of_map(Path(folder) / "map")
            stops = stops_of(keeper.gaussian_map, known, given.stops, threads=1)
            looked_from = {name: known[name] for name in stops}
            keeper.go_round(robot, {"change": robot.observe().camera, **looked_from})
            first = keeper.version.number
            detector = ChangeDetector(
                keeper.gaussian_map,
                config.detection,
                cameras=cameras_of_map(Path(folder) / "map").values(),
            )
            told, unreliable = reports(
                detector, robot_in(state, given.width, 2_000_000 + seed), task
            )
            before = len(said)
            keeper.go_round(robot_in(state, given.width, 3_000_000 + seed))
            return {
                "kind": task.change.kind,
                "object": task.change.object_id,
                "seed": seed,
                "versions": [first, keeper.version.number],
                "reports": told,
                "unreliable": unreliable,
                "said": [said[:before], said[before:]],
                "cpu_s": round(time.process_time() - start_s, 1),
            }


def tasks_of(room: str, width: int) -> tuple[list[Task], Home]:
    """Changes of a room, and the room as it is made."""
    source, coarse = HomeSource.of_seed(room, ROOM_SEED)
    maker = TaskMaker(Setting(width=width, height=width * 3 // 4), ROOM_SEED)
    tasks = maker.make(source, coarse, TASKS)
    return tasks, source.load(Path())


def summary(cases: Sequence[dict[str, Any]]) -> list[str]:
    """A markdown table with a row for each room and kind, and one for all."""
    groups = {(one["room"], one["kind"]): [] for one in cases} | {("all", ""): list(cases)}
    for one in cases:
        groups[one["room"], one["kind"]].append(one)
    lines = [
        "| room | change | updated | views without a report there | cases without one "
        "| second rounds without a version |",
        "| --- | --- | --: | --: | --: | --: |",
    ]
    for (room, kind), own in groups.items():
        # Where nothing was updated, nothing can be settled.
        made = [one for one in own if one["versions"][0] > 1]
        views = [report is None for one in made for report in one["reports"]]
        silent = [all(report is None for report in one["reports"]) for one in made]
        still = [one["versions"][0] == one["versions"][1] for one in made]
        shares = " | ".join(share(one) for one in (views, silent, still))
        lines.append(f"| {room} | {kind} | {len(made)} of {len(own)} | {shares} |")
    return lines


def share(answers: Sequence[bool]) -> str:
    """How many of some answers are yes, and their share."""
    if not answers:
        return "-"
    return f"{sum(answers)} of {len(answers)} ({100 * np.mean(answers):.0f} %)"


def main() -> None:
    """Measures all cases and prints the shares."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rooms", nargs="+", default=["living_room", "kitchen"])
    parser.add_argument("--kinds", nargs="+", default=list(KINDS), choices=KINDS)
    parser.add_argument("--seeds", default="0:20", help="first and last but one, of the noise")
    parser.add_argument("--maps", type=int, default=2, help="of a room, with other noise")
    parser.add_argument("--stops", type=int, default=6, help="of a round")
    parser.add_argument("--width", type=int, default=320, help="of the images, px")
    parser.add_argument("--work", type=Path, default=Path("out/settled"), help="keeps the maps")
    parser.add_argument("--out", type=Path, default=Path("out/settled.json"))
    given = parser.parse_args()
    seeds = range(*map(int, given.seeds.split(":")))
    cases: list[dict[str, Any]] = []
    with tqdm(total=len(given.rooms) * len(given.kinds) * len(seeds), desc="cases") as bar:
        for room in given.rooms:
            tasks, home = tasks_of(room, given.width)
            for seed in seeds:
                number = seed % given.maps
                made = given.work / f"{room}_{given.width}_{number}"
                write_map(tasks[0].states(home)[0], given.width, number, made)
                for kind in given.kinds:
                    own = [task for task in tasks if task.change.kind == kind]
                    case = run_case(own[seed // given.maps % len(own)], home, made, seed, given)
                    cases.append({"room": room, **case})
                    given.out.parent.mkdir(parents=True, exist_ok=True)
                    given.out.write_text(json.dumps(cases, indent=1) + "\n")
                    bar.update()
    print("\n".join(summary(cases)))


if __name__ == "__main__":
    main()
