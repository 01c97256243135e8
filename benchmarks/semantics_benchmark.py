"""Times of semantic features, queries and semantic maps.

Adds semantic features to a map of a simulated home, as `gslts semantics` does, and puts copies of
the map side by side until there are enough Gaussians to query.
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

REPEATS = 3
"""Number of repetitions of each measurement, of which the median counts."""
SPACING_M = 0.5
"""Distance between copies of the map, more than the distance at which queries link Gaussians."""
ARRAYS = ("quats", "log_scales", "logit_opacities", "sh", "features")


def median_s(work: Callable[[], object]) -> float:
    """Return the median time of a function, s."""
    times_s = []
    for _ in range(REPEATS):
        start_s = time.perf_counter()
        work()
        times_s.append(time.perf_counter() - start_s)
    return float(np.median(times_s))


def tile(gaussian_map: GaussianMap, gaussians: int) -> GaussianMap:
    """Return copies of a map along x, with a number of Gaussians in all."""
    width_m = np.ptp(gaussian_map.means[:, 0]) + SPACING_M
    copies = -(-gaussians // gaussian_map.size)
    shifts = [np.array([k * width_m, 0, 0], np.float32) for k in range(copies)]
    arrays = {name: np.concatenate([getattr(gaussian_map, name)] * copies) for name in ARRAYS}
    return GaussianMap(
        means=np.concatenate([gaussian_map.means + shift for shift in shifts])[:gaussians],
        origin=gaussian_map.origin,
        **{name: array[:gaussians] for name, array in arrays.items()},
    )


def main() -> None:
    """Measure and print JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("map", type=Path, help="folder of a map, by gslts map")
    parser.add_argument("dataset", type=Path, help="dataset of the map, by gslts sim capture")
    parser.add_argument("--gaussians", type=int, default=500_000)
    parser.add_argument("--threads", type=int, default=0)
    arguments = parser.parse_args()
    oracle, gaussian_map = Oracle(), read_map(arguments.map)
    cameras = cameras_of_map(arguments.map)
    used = [frame for frame in open_dataset(arguments.dataset).frames if frame.name in cameras]
    frames = (replace(frame.read(), camera=cameras[frame.name]) for frame in used)
    start_s = time.perf_counter()
    semantics = embed_semantics(gaussian_map, frames, oracle, threads=arguments.threads)
    embedding_s = time.perf_counter() - start_s
    gaussian_map = replace(gaussian_map, features=semantics.features)
    large = tile(gaussian_map, arguments.gaussians)
    queries = SemanticQueries(large, semantics.codec, oracle)
    queries_s = {name: median_s(lambda name=name: queries.find(name)) for name in semantics.names}
    layers = Categories(semantics.names, semantics.codec, oracle)
    results = {
        "frames": len(used),
        "semantic features, s": embedding_s,
        "gaussians": [gaussian_map.size, large.size],
        "index for queries, s": median_s(lambda: SemanticQueries(large, semantics.codec, oracle)),
        "query, s": float(np.median(list(queries_s.values()))),
        "queries, s": queries_s,
        "semantic map, s": [
            median_s(lambda map_=map_: make_semantic_map(map_, RobotBody(), layers))
            for map_ in (gaussian_map, large)
        ],
    }
    print(json.dumps(results, indent=1))


if __name__ == "__main__":
    main()
