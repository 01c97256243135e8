"""Compares two robots that share a map with one robot that sees all changes itself.

    python benchmarks/two_robots_benchmark.py                    # 20 changes of a small kitchen

After each change, the robots that see it integrate it into their clones, and then both exchange
versions. A third of the changes is seen by both at once. Prints JSON: which changes became
versions, and the PSNR of new views of the home at the end.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
from collections import Counter
from pathlib import Path

import numpy as np
from tqdm import tqdm
from year_benchmark import make_home_map, robot_in

from gslts.change.config import DetectionConfig
from gslts.core.camera import Camera
from gslts.core.robot import Robot
from gslts.fleet.exchange import clone_map, pull_map, push_map
from gslts.keeper.config import KeeperConfig
from gslts.keeper.keeper import MapKeeper
from gslts.store.causes import UpdateCause
from gslts.store.map_folder import open_map, read_map
from gslts.store.robot_name import VARIABLE
from gslts.update.config import RefineConfig, UpdateConfig
from gslts_bench.series.run import mean_psnr_db, new_frames
from gslts_sim.change_sampler import TaskSettings
from gslts_sim.home_source import HomeSource
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


def rounds_of(folder: Path) -> list[int]:
    """Return the rounds of the updates of a map; round k follows the change k."""
    with open_map(folder) as store:
        causes = [version.cause for version in store.versions()]
    return [c.round for c in causes if isinstance(c, UpdateCause) and c.round is not None]


def main() -> None:
    """Run the changes."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--room", default="kitchen")
    parser.add_argument("--seed", type=int, default=20)
    parser.add_argument("--changes", type=int, default=20)
    parser.add_argument("--out", type=Path, default=Path("out/two_robots"))
    given = parser.parse_args()
    shutil.rmtree(given.out, ignore_errors=True)
    given.out.mkdir(parents=True)
    source, coarse = HomeSource.of_seed(given.room, given.seed)
    tasks = TaskMaker(SETTING, given.seed).make_sequence(source, coarse, given.changes)
    task = next(tasks)
    state = task.states(source.load(given.out))[0]
    make_home_map(robot_in(state, task.sensor, task.sensor.seed_before), given.out)
    alone, anna, ben = (given.out / name for name in ("alone", "anna", "ben"))
    url = f"file://{given.out.resolve()}/bucket"
    shutil.copytree(given.out / "map", alone)
    shutil.copytree(given.out / "map", anna)
    push_map(anna, url)
    clone_map(url, ben)
    given_up: list[str] = []
    behind = 0
    for done in tqdm(range(given.changes), desc="changes"):
        task = task if done == 0 else next(tasks)
        state = task.apply_change(state)
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
        behind += rounds_of(anna) != rounds_of(ben)
    frames = new_frames(state, task.sensor, given.seed)
    by_one, by_two = Counter(rounds_of(alone)), Counter(rounds_of(anna))
    maps = {"one robot": alone, "two robots": anna, "first version": Path(f"{anna}@1")}
    results = {
        "changes": given.changes,
        "updates of one robot": by_one.total(),
        "updates of two robots": by_two.total(),
        "changes that only one robot updated": sorted(set(by_one) - set(by_two)),
        "changes that only two robots updated": sorted(set(by_two) - set(by_one)),
        "changes in two versions, one robot": sorted(k for k, n in by_one.items() if n > 1),
        "changes in two versions, two robots": sorted(k for k, n in by_two.items() if n > 1),
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
