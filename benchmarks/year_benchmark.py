"""Simulates a year of operation: three changes a day, each detected in one frame and published.

python benchmarks/year_benchmark.py                          # 1,095 changes of a small kitchen
python benchmarks/year_benchmark.py --changes 100 --seed 21  # fewer, and another home

Prints a markdown table of memory, size of the store and seconds per cycle over the year. The last
lines compare the PSNR of new views of the map with that of a new map.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import time
from pathlib import Path

import numpy as np
from tqdm import tqdm

from gslts.change.config import DetectionConfig
from gslts.core.gaussian_map import GaussianMap
from gslts.datasets import open_dataset
from gslts.io.atomic_files import empty_folder
from gslts.keeper.config import KeeperConfig
from gslts.keeper.keeper import MapKeeper
from gslts.mapping.config import PRESETS
from gslts.mapping.engine import make_map
from gslts.store.map_folder import read_map, write_map_folder
from gslts.update.config import RefineConfig, UpdateConfig
from gslts_bench.series.run import mean_psnr_db, new_frames
from gslts_sim.actions import SceneState
from gslts_sim.capture import capture
from gslts_sim.change_sampler import TaskSettings
from gslts_sim.controller import Controller
from gslts_sim.explore import explore
from gslts_sim.home_source import HomeSource
from gslts_sim.task import SensorSetup
from gslts_sim.tasks import TaskMaker

FRAMES = 120
"""Number of frames of the first map."""


def robot_in(state: SceneState, sensor: SensorSetup, seed: int) -> Controller:
    """Return a robot in a home, with a seed of the sensor noise."""
    return Controller(
        state, width=sensor.width, height=sensor.height, noise=sensor.noise, seed=seed
    )


def make_home_map(robot: Controller, folder: Path, frames: int = FRAMES) -> GaussianMap:
    """Record and map a home, into a new folder."""
    viewpoints, _ = explore(robot.home, frames)
    capture(robot, tqdm(viewpoints, desc="recording", leave=False), folder / "recording")
    with tqdm(total=100, desc="mapping", leave=False) as bar:
        result = make_map(
            open_dataset(folder / "recording"),
            PRESETS["fast"],
            report=lambda progress: bar.update(round(100 * progress.share) - bar.n) and None,
        )
    cameras = {name: frame.camera() for name, frame in result.training.items()}
    write_map_folder(folder / "map", result.gaussian_map, {"dataset": "recording"}, cameras)
    return result.gaussian_map


def memory_bytes() -> int:
    """Return the resident memory of this process."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE")


def store_bytes(folder: Path) -> int:
    """Return the size of the index and of the files of Gaussians, without images."""
    files = [*folder.glob("versions.sqlite*"), *(folder / "blobs").rglob("*.safetensors")]
    return sum(path.stat().st_size for path in files)


def main() -> None:
    """Run the year."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--room", default="kitchen")
    parser.add_argument("--seed", type=int, default=20)
    parser.add_argument("--changes", type=int, default=1095)
    parser.add_argument("--every", type=int, default=50, help="changes per row of the table")
    parser.add_argument("--iterations", type=int, default=60, help="refinement steps")
    parser.add_argument(
        "--consolidate", type=int, default=30, help="changes per consolidation; 0 for none"
    )
    parser.add_argument("--width", type=int, default=320, help="width of the images, px")
    parser.add_argument("--out", type=Path, default=Path("out/year"))
    given = parser.parse_args()
    shutil.rmtree(given.out, ignore_errors=True)
    empty_folder(given.out)
    setting = TaskSettings(width=given.width, height=given.width * 3 // 4)
    source, coarse = HomeSource.of_seed(given.room, given.seed)
    tasks = TaskMaker(setting, given.seed).make_sequence(source, coarse, given.changes)
    task = next(tasks)
    state = task.states(source.load(given.out))[0]
    make_home_map(robot_in(state, task.sensor, task.sensor.seed_before), given.out / "start")
    folder = given.out / "start" / "map"
    config = KeeperConfig(
        detection=DetectionConfig(halvings=0),
        update=UpdateConfig(refine=RefineConfig(iterations=given.iterations)),
    )
    print("| changes | versions | deferred | Gaussians | memory | store | s per cycle | CPU s |")
    print("| --: | --: | --: | --: | --: | --: | --: | --: |", flush=True)
    with MapKeeper(folder, config) as keeper, (given.out / "cycles.jsonl").open("w") as log:
        cycles: list[tuple[float, float]] = []
        consolidations: list[float] = []
        for done in tqdm(range(1, given.changes + 1), desc="a year"):
            state = task.apply_change(state)
            robot = robot_in(state, task.sensor, task.sensor.seed_after)
            robot.go(task.viewpoint)
            frame = robot.observe()
            start_s, start_cpu_s = time.perf_counter(), time.process_time()
            keeper.go_round(robot, {"first": frame.camera})
            cycles.append((time.perf_counter() - start_s, time.process_time() - start_cpu_s))
            if given.consolidate and done % given.consolidate == 0:
                start_s = time.perf_counter()
                keeper.consolidate(robot)
                consolidations.append(time.perf_counter() - start_s)
            version = keeper.version
            row = {
                "changes": done,
                "versions": version.number,
                "deferred": len(keeper.state.deferred),
                "gaussians": version.gaussians,
                "memory": memory_bytes(),
                "store": store_bytes(folder),
                "seconds": cycles[-1][0],
                "cpu_seconds": cycles[-1][1],
            }
            log.write(json.dumps(row) + "\n")
            log.flush()
            if done % given.every == 0 or done == given.changes:
                seconds, cpu_seconds = np.median(cycles[-given.every :], axis=0)
                print(
                    f"| {done} | {version.number} | {row['deferred']} | {version.gaussians} | "
                    f"{row['memory'] / 2**20:.0f} MiB | {row['store'] / 2**20:.1f} MiB | "
                    f"{seconds:.2f} | {cpu_seconds:.2f} |",
                    flush=True,
                )
            if done < given.changes:
                task = next(tasks)
    if consolidations:
        print(f"{len(consolidations)} consolidations, {np.median(consolidations):.0f} s each")
    sensor = task.sensor
    again = make_home_map(robot_in(state, sensor, sensor.seed_after), given.out / "again")
    frames = new_frames(state, sensor, given.seed)
    for name, gaussian_map in (
        ("kept up to date", read_map(folder)),
        ("first version", read_map(Path(f"{folder}@1"))),
        ("made again", again),
    ):
        psnr_db = mean_psnr_db(gaussian_map, frames)
        print(f"{name}: {psnr_db:.2f} dB, {gaussian_map.size} Gaussians", flush=True)


if __name__ == "__main__":
    main()
