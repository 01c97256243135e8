"""Costs of a shared map by the length of its history.

    python benchmarks/history_benchmark.py --versions 10 100 400 1100

makes a map of the size of a room, and commits updates of 3,000 Gaussians with frames, landmarks and
an image. As soon as it has one of these numbers of versions, it prints CPU time of exchanges and of
`gslts building show` for the next updates, and of a clone. The bucket is a folder.
"""

from __future__ import annotations

import argparse
import shutil
import tempfile
from pathlib import Path

import numpy as np
from request_meter import Cost, Meter
from share_benchmark import SH_DEGREE, commit_update, random_delta
from store_benchmark import camera, random_map, size_of

from gslts.core.gaussian_map import GaussianMap
from gslts.fleet.building_history import read_room_history
from gslts.fleet.exchange import clone_map, pull_map, push_map
from gslts.store.delta import Delta
from gslts.store.map_folder import open_map, write_map_folder

GAUSSIANS, TOUCHED = 130_000, 3000
"""Gaussians of the map, and of an update."""
REPEATED = 5
"""Number of updates that are measured for a row."""


def measure(own: Path, other: Path, rng: np.random.Generator) -> dict[str, Cost]:
    """Measure exchanges of the next updates.

    Args:
        own: Clone that makes them.
        other: Clone that gets them.
        rng: For their content.

    Returns:
        Costs of `REPEATED` calls by operation.
    """
    meter = Meter()
    with meter.counting():
        for _ in range(REPEATED):
            commit_random(own, rng)
            with meter.measuring("push", 1):
                push_map(own)
            with meter.measuring("pull", 1):
                pull_map(other)
            with meter.measuring("no news", 1):
                pull_map(other)
            with meter.measuring("show", 1):
                read_room_history(other, 0)
    return meter.costs


def commit_random(folder: Path, rng: np.random.Generator) -> None:
    """Commit an update of random Gaussians, as large as one of a robot.

    Args:
        folder: Of the map.
        rng: For the content.
    """

    def make_delta(before: GaussianMap, next_id: int) -> Delta:
        return random_delta(rng, before, TOUCHED, next_id)

    commit_update(folder, rng, make_delta)


def main() -> None:
    """Measure, and print tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--versions", type=int, nargs="+", default=[10, 100, 400, 1100])
    given = parser.parse_args()
    rng = np.random.default_rng(0)
    with tempfile.TemporaryDirectory() as name:
        own, other, clone = (Path(name) / part for part in ("own", "other", "clone"))
        url, bucket = f"file://{name}/bucket", Path(name) / "bucket"
        cameras = {f"{k:05}": camera(rng) for k in range(200)}
        write_map_folder(
            own, random_map(rng, GAUSSIANS, 0, SH_DEGREE), {"dataset": "room"}, cameras
        )
        push_map(own, url)
        clone_map(url, other)
        sizes = size_of(bucket), size_of(other)
        print(f"A new map takes {sizes[0]:,} bytes in the bucket and {sizes[1]:,} in a clone.\n")
        print(
            "| versions | push, CPU ms | pull | no news | show | clone, s | CPU s | requests |",
            end="",
        )
        print(" bucket, bytes an update | clone, bytes an update |")
        print("| --: |" + 9 * " --: |", flush=True)
        number = 1
        for versions in given.versions:
            for _ in range(versions - number):
                commit_random(own, rng)
            number = versions + REPEATED
            push_map(own)
            pull_map(other)
            costs, meter = measure(own, other, rng), Meter()
            with meter.counting(), meter.measuring("clone", 1):
                clone_map(url, clone)
            cells = [f"{1000 * cost.cpu_s / REPEATED:.0f}" for cost in costs.values()]
            cost = meter.costs["clone"]
            cells += [f"{cost.seconds:.1f}", f"{cost.cpu_s:.1f}", f"{cost.requests:,}"]
            for folder, size in zip((bucket, clone), sizes, strict=True):
                cells.append(f"{(size_of(folder) - size) / (number - 1):,.0f}")
            print(f"| {number:,} |", " | ".join(cells), "|", flush=True)
            shutil.rmtree(clone)
        with open_map(own) as store:
            delta = store.version(2).delta
        assert delta is not None
        print(f"\nThe delta of an update takes {delta.size:,} bytes.")


if __name__ == "__main__":
    main()
