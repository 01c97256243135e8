"""Synthetic versions of a map, known in advance, and a program that commits them.

    python benchmarks/faults/synthetic_versions.py MAP --more 12

adds versions as the map keeper does, and prints the number of each after its commit returned. A
failed commit is tried once more; then the error is reported.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gslts.core.gaussian_map import GaussianMap
from gslts.io.atomic_files import write_atomic
from gslts.mapping.density.control import join
from gslts.store.causes import UpdateCause
from gslts.store.map_folder import open_map, write_map_folder
from gslts.store.map_store import MapStore
from gslts.store.records import ObjectEvent

GAUSSIANS, NEW = 300, 20
"""Gaussians of the first version, and new ones of each later version."""
STATE = "keeper.json"
"""File that is written after each commit, as the map keeper does."""
BOX = ((0.0, 0.0, 0.0), (0.1, 0.1, 0.1))
"""Box of every added object, m."""


def random_map(size: int, seed: int) -> GaussianMap:
    rng = np.random.default_rng(seed)

    def normal(*shape: int) -> NDArray[np.float32]:
        return rng.normal(size=shape).astype(np.float32)

    return GaussianMap(
        means=normal(size, 3),
        quats=normal(size, 4) + np.float32(3),
        log_scales=normal(size, 3),
        logit_opacities=normal(size),
        sh=normal(size, 4, 3),
        features=normal(size, 2),
    )


def restored_version(number: int) -> int | None:
    """Return the number of the version that a version restores; None if it is an update."""
    return number - 3 if number % 5 == 0 else None


@cache
def expected_map(number: int) -> GaussianMap:
    """Return a version: some Gaussians of the one before are removed, some moved, some are new."""
    if number == 1:
        return random_map(GAUSSIANS, 0)
    restored = restored_version(number)
    if restored is not None:
        return expected_map(restored)
    before = expected_map(number - 1)
    rng = np.random.default_rng(number)
    kept = before.select(np.flatnonzero(rng.random(before.size) > NEW / GAUSSIANS))
    means = kept.means.copy()
    means[rng.random(kept.size) < 0.2] += np.float32(0.5)
    first_id = max(int(expected_map(older).ids[-1]) for older in range(1, number)) + 1
    return join(replace(kept, means=means), random_map(NEW, number), first_id)


def write_first(folder: Path) -> None:
    """Write a map with the first version."""
    write_map_folder(folder, expected_map(1), {"dataset": "synthetic"}, {})


def commit_next(store: MapStore, number: int) -> None:
    restored = restored_version(number)
    if restored is not None:
        store.restore(restored)
        return
    event = ObjectEvent(kind="addition", type=f"Object {number}", boxes=(None, BOX))
    store.commit(expected_map(number), UpdateCause(round=number), [event])


def commit_more(folder: Path, more: int) -> None:
    """Commit versions; a first error is raised at the end, a second one immediately."""
    failed: OSError | None = None
    with open_map(folder, writable=True) as store:
        store.collect_garbage()
        last = store.version().number + more
        while (number := store.version().number + 1) <= last:
            try:
                commit_next(store, number)
                print(number, flush=True)
                write_atomic(folder / STATE, json.dumps({"version": number}).encode())
            except OSError as error:
                if failed is not None:
                    raise
                failed = error
    if failed is not None:
        raise failed


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, metavar="MAP")
    parser.add_argument("--more", type=int, required=True)
    arguments = parser.parse_args()
    try:
        commit_more(arguments.folder, arguments.more)
    except (OSError, ValueError) as error:
        print(f"gslts: {' '.join(str(error).split())}", file=sys.stderr)
        sys.exit(1)


if __name__ == "__main__":
    main()
