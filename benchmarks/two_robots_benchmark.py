"""Compares two robots that share a map with one robot that sees all changes itself.

    python benchmarks/two_robots_benchmark.py                            # a small kitchen
    python benchmarks/two_robots_benchmark.py --room flat --frames 300   # three rooms

After each change, the robots that see it integrate it into their clones, and then both exchange
versions. A third of the changes is seen by both at once. Prints JSON: which changes the events of
the maps show, and the PSNR of new views of the home at the end.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from tqdm import tqdm
from year_benchmark import FRAMES, make_home_map, robot_in

from gslts.change.config import DetectionConfig
from gslts.core.camera import Camera
from gslts.core.robot import Robot
from gslts.fleet.exchange import clone_map, pull_map, push_map
from gslts.keeper.config import KeeperConfig
from gslts.keeper.keeper import MapKeeper
from gslts.store.causes import UpdateCause
from gslts.store.history import open_history
from gslts.store.map_folder import read_map
from gslts.store.robot_name import VARIABLE
from gslts.types import Floats
from gslts.update.config import RefineConfig, UpdateConfig
from gslts_bench.days.events import is_in, is_untrue
from gslts_bench.series.run import mean_psnr_db, new_frames
from gslts_sim.change_sampler import TaskSettings
from gslts_sim.home_source import HomeSource
from gslts_sim.task import Change
from gslts_sim.tasks import TaskMaker

SETTING = TaskSettings(width=320, height=240)
CONFIG = KeeperConfig(
    detection=DetectionConfig(halvings=0), update=UpdateConfig(refine=RefineConfig(iterations=60))
)
"""Small images, and short refinements, as in `year_benchmark.py`."""


def go(folder: Path, robot: Robot, viewpoints: dict[str, Camera]) -> None:
    """Let a robot do a round; without viewpoints, it sees nothing."""
    os.environ[VARIABLE] = folder.name
    with MapKeeper(folder, CONFIG) as keeper:
        keeper.go_round(robot, viewpoints)


def versions_of(folder: Path) -> list[float]:
    """Return the times of the versions of a map, which tell them apart."""
    with open_history(folder) as history:
        return [version.time_s for version in history.versions()]


def show(folder: Path, changes: Sequence[Change]) -> tuple[list[int], list[int], int]:
    """Compare the events of a map with the true changes by their positions.

    Args:
        folder: Of the map; its round k follows the change k.
        changes: True changes, oldest first.

    Returns:
        Numbers of the changes that the events show, numbers of those that more than one event
        shows, and the number of events of something that did not happen.
    """
    with open_history(folder) as history:
        events = history.events()
        causes = [(version.number, version.cause) for version in history.versions()]
    rounds = {number: c.round for number, c in causes if isinstance(c, UpdateCause)}
    ends: Counter[tuple[int, int]] = Counter()
    untrue = 0
    for event in events:
        past = changes[: (rounds[event.version] or 0) + 1]
        untrue += is_untrue(event, past)
        for side, box in enumerate(event.boxes):
            if box is not None:
                middle = np.mean(box, axis=0)
                fitting = [k for k, c in enumerate(past) if _has_end(c, side, middle)]
                ends.update((k, side) for k in fitting[-1:])
    shown = [k for k, change in enumerate(changes) if all(ends[k, side] for side in _sides(change))]
    return shown, sorted({k for (k, _), number in ends.items() if number > 1}), untrue


def _has_end(change: Change, side: int, position: Floats) -> bool:
    """Return whether an object was at a position before (0) or is there after (1) a change."""
    box = (change.box_before, change.box_after)[side]
    return box is not None and is_in(position, box)


def _sides(change: Change) -> list[int]:
    """Return which ends a change has: 0 before it, 1 after it."""
    boxes = (change.box_before, change.box_after)
    return [side for side, box in enumerate(boxes) if box is not None]


def main() -> None:
    """Run the changes."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--room", default="kitchen")
    parser.add_argument("--seed", type=int, default=20)
    parser.add_argument("--changes", type=int, default=20)
    parser.add_argument("--frames", type=int, default=FRAMES, help="frames of the first map")
    parser.add_argument("--out", type=Path, default=Path("out/two_robots"))
    given = parser.parse_args()
    shutil.rmtree(given.out, ignore_errors=True)
    given.out.mkdir(parents=True)
    source, coarse = HomeSource.of_seed(given.room, given.seed)
    tasks = TaskMaker(SETTING, given.seed).make_sequence(source, coarse, given.changes)
    task = next(tasks)
    state = task.states(source.load(given.out))[0]
    make_home_map(robot_in(state, task.sensor, task.sensor.seed_before), given.out, given.frames)
    alone, anna, ben = (given.out / name for name in ("alone", "anna", "ben"))
    url = f"file://{given.out.resolve()}/bucket"
    shutil.copytree(given.out / "map", alone)
    shutil.copytree(given.out / "map", anna)
    push_map(anna, url)
    clone_map(url, ben)
    given_up: list[str] = []
    changes: list[Change] = []
    behind = 0
    for done in tqdm(range(given.changes), desc="changes"):
        task = task if done == 0 else next(tasks)
        state = task.apply_change(state)
        changes.append(task.change)
        robot = robot_in(state, task.sensor, task.sensor.seed_after)
        robot.go(task.viewpoint)
        here = {"first": robot.observe().camera}
        go(alone, robot, here)
        for folder, sees in ((anna, done % 3 != 0), (ben, done % 3 != 1)):
            robot.go(task.viewpoint)
            go(folder, robot, here if sees else {})
        for folder in (anna, ben):
            given_up += [f"change {done}: {reason}" for reason in push_map(folder).given_up]
        pull_map(anna)
        behind += versions_of(anna) != versions_of(ben)
    frames = new_frames(state, task.sensor, given.seed)
    maps = {"one robot": alone, "two robots": anna, "first version": Path(f"{anna}@1")}
    shown = {name: show(maps[name], changes) for name in ("one robot", "two robots")}
    results = {
        "changes": given.changes,
        "shown": {name: len(found) for name, (found, _, _) in shown.items()},
        "only shown by one robot": sorted(set(shown["one robot"][0]) - set(shown["two robots"][0])),
        "shown twice": {name: twice for name, (_, twice, _) in shown.items()},
        "untrue events": {name: untrue for name, (_, _, untrue) in shown.items()},
        "given up": given_up,
        "exchanges after which the clones differ": behind,
        "PSNR, dB": {
            name: float(np.round(mean_psnr_db(read_map(path), frames), 2))
            for name, path in maps.items()
        },
    }
    print(json.dumps(results, indent=1))


if __name__ == "__main__":
    main()
