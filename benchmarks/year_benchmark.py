"""A year of a map: three changes a day, each found in one frame and published as a version.

python benchmarks/year_benchmark.py                          # 1,095 changes of a small kitchen
python benchmarks/year_benchmark.py --changes 100 --seed 21  # fewer, and another home

Prints a markdown table of memory, bytes of the store and seconds a cycle in the course of the year,
and at its end the PSNR of fresh views of the map, and of one built anew.
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
from gslts.keeper.keeper import LoopConfig, MapKeeper
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


def robot_in(state: SceneState, sensor: SensorSetup, seed: int) -> Controller:
    """A robot in a home, whose sensor's noise is of a seed."""
    return Controller(
        state, width=sensor.width, height=sensor.height, noise=sensor.noise, seed=seed
    )


def mapped(robot: Controller, folder: Path) -> GaussianMap:
    """A map of a home as it is, in a new folder."""
    looks, _ = explore(robot.home, 120)
    capture(robot, tqdm(looks, desc="recording", leave=False), folder / "recording")
    with tqdm(total=100, desc="mapping", leave=False) as bar:
        result = make_map(
            open_dataset(folder / "recording"),
            PRESETS["fast"],
            report=lambda progress: bar.update(round(100 * progress.share) - bar.n) and None,
        )
    cameras = {name: one.camera() for name, one in result.training.items()}
    write_map_folder(folder / "map", result.gaussian_map, {"dataset": "recording"}, cameras)
    return result.gaussian_map


def memory_bytes() -> int:
    """What this process has in memory now."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE")


def bytes_of_store(folder: Path) -> int:
    """Of the index and the files of Gaussians, without the pictures."""
    files = [*folder.glob("versions.sqlite*"), *(folder / "blobs").rglob("*.safetensors")]
    return sum(path.stat().st_size for path in files)


def main() -> None:
    """Lives through the year."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--room", default="kitchen")
    parser.add_argument("--seed", type=int, default=20)
    parser.add_argument("--changes", type=int, default=1095)
    parser.add_argument("--every", type=int, default=50, help="changes from row to row")
    parser.add_argument("--iterations", type=int, default=60, help="of a refinement")
    parser.add_argument("--width", type=int, default=320, help="of the images, px")
    parser.add_argument("--out", type=Path, default=Path("out/year"))
    given = parser.parse_args()
    shutil.rmtree(given.out, ignore_errors=True)
    empty_folder(given.out)
    setting = TaskSettings(width=given.width, height=given.width * 3 // 4)
    source, coarse = HomeSource.of_seed(given.room, given.seed)
    tasks = TaskMaker(setting, given.seed).make_sequence(source, coarse, given.changes)
    task = next(tasks)
    state = task.states(source.load(given.out))[0]
    mapped(robot_in(state, task.sensor, task.sensor.seed_before), given.out / "start")
    folder = given.out / "start" / "map"
    config = LoopConfig(
        detection=DetectionConfig(halvings=0),
        update=UpdateConfig(refine=RefineConfig(iterations=given.iterations)),
    )
    print("| changes | versions | deferred | Gaussians | memory | store | s a cycle | of CPU |")
    print("| --: | --: | --: | --: | --: | --: | --: | --: |", flush=True)
    with MapKeeper(folder, config) as keeper, (given.out / "cycles.jsonl").open("w") as log:
        cycles: list[tuple[float, float]] = []
        for done in tqdm(range(1, given.changes + 1), desc="a year"):
            state = task.apply_change(state)
            robot = robot_in(state, task.sensor, task.sensor.seed_after)
            robot.go(task.viewpoint)
            frame = robot.observe()
            start_s, start_cpu_s = time.perf_counter(), time.process_time()
            keeper.go_round(robot, {"first": frame.camera})
            cycles.append((time.perf_counter() - start_s, time.process_time() - start_cpu_s))
            version = keeper.version
            told = {
                "changes": done,
                "versions": version.number,
                "deferred": len(keeper.state.deferred),
                "gaussians": version.gaussians,
                "memory": memory_bytes(),
                "store": bytes_of_store(folder),
                "seconds": cycles[-1][0],
                "cpu_seconds": cycles[-1][1],
            }
            log.write(json.dumps(told) + "\n")
            log.flush()
            if done % given.every == 0 or done == given.changes:
                seconds, cpu_seconds = np.median(cycles[-given.every :], axis=0)
                print(
                    f"| {done} | {version.number} | {told['deferred']} | {version.gaussians} | "
                    f"{told['memory'] / 2**20:.0f} MiB | {told['store'] / 2**20:.1f} MiB | "
                    f"{seconds:.2f} | {cpu_seconds:.2f} |",
                    flush=True,
                )
            if done < given.changes:
                task = next(tasks)
    sensor = task.sensor
    anew = mapped(robot_in(state, sensor, sensor.seed_after), given.out / "anew")
    frames = new_frames(state, sensor, given.seed)
    for words, one in (
        ("kept up to date", read_map(folder)),
        ("as at first", read_map(Path(f"{folder}@1"))),
        ("built anew", anew),
    ):
        print(f"{words}: {mean_psnr_db(one, frames):.2f} dB, {one.size} Gaussians", flush=True)


if __name__ == "__main__":
    main()
