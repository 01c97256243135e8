"""How long it takes to teach a map words, to ask it, and to flatten it.

Teaches a map of a simulated home by the labels of its recording, as `gslts semantics` does, and
lays copies of it side by side until there are enough Gaussians to ask.
"""

import argparse
import json
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from gslts.core.gaussian_map import GaussianMap
from gslts.core.robot_body import RobotBody
from gslts.datasets import open_dataset
from gslts.navigation.semantic_map import make_semantic_map
from gslts.semantics.categories import Categories
from gslts.semantics.embed import embed_semantics
from gslts.semantics.queries import SemanticQueries
from gslts.semantics.source import Oracle
from gslts.store.camera_files import cameras_of_map
from gslts.store.map_folder import read_map

TIMES = 3
APART_M = 0.5
ARRAYS = ("quats", "log_scales", "logit_opacities", "sh", "features")


def seconds(work: Callable[[], object]) -> float:
    """Median of the time that something takes."""
    took = []
    for _ in range(TIMES):
        start_s = time.perf_counter()
        work()
        took.append(time.perf_counter() - start_s)
    return float(np.median(took))


def side_by_side(gaussian_map: GaussianMap, gaussians: int) -> GaussianMap:
    """Copies of a map along x, so many Gaussians in all."""
    width_m = np.ptp(gaussian_map.means[:, 0]) + APART_M
    copies = -(-gaussians // gaussian_map.size)
    shifts = [np.array([k * width_m, 0, 0], np.float32) for k in range(copies)]
    every = {name: np.concatenate([getattr(gaussian_map, name)] * copies) for name in ARRAYS}
    return GaussianMap(
        means=np.concatenate([gaussian_map.means + shift for shift in shifts])[:gaussians],
        origin=gaussian_map.origin,
        **{name: array[:gaussians] for name, array in every.items()},
    )


def main() -> None:
    """Measures, and prints JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("map", type=Path, help="of gslts map")
    parser.add_argument("dataset", type=Path, help="that it was made of, by gslts sim capture")
    parser.add_argument("--gaussians", type=int, default=500_000)
    parser.add_argument("--threads", type=int, default=0)
    given = parser.parse_args()
    oracle, own = Oracle(), read_map(given.map)
    cameras = cameras_of_map(given.map)
    known = [one for one in open_dataset(given.dataset).frames if one.name in cameras]
    frames = (replace(one.read(), camera=cameras[one.name]) for one in known)
    start_s = time.perf_counter()
    taught = embed_semantics(own, frames, oracle, threads=given.threads)
    teaching_s = time.perf_counter() - start_s
    own = replace(own, features=taught.features)
    large = side_by_side(own, given.gaussians)
    queries = SemanticQueries(large, taught.autoencoder, oracle)
    asked = {name: seconds(lambda name=name: queries.find(name)) for name in taught.names}
    layers = Categories(taught.names, taught.autoencoder, oracle)
    told = {
        "frames": len(known),
        "teaching, s": teaching_s,
        "gaussians": [own.size, large.size],
        "ready to be asked, s": seconds(lambda: SemanticQueries(large, taught.autoencoder, oracle)),
        "a query, s": float(np.median(list(asked.values()))),
        "queries, s": asked,
        "semantic map, s": [
            seconds(lambda one=one: make_semantic_map(one, RobotBody(), layers))
            for one in (own, large)
        ],
    }
    print(json.dumps(told, indent=1))


if __name__ == "__main__":
    main()
