"""Time to open a map with a long history, and disk space of its versions.

Makes a map of random Gaussians and commits updates, each of which removes, adds and changes as many
Gaussians as a small object has.
"""

import argparse
import json
import os
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from tqdm import tqdm

from gslts.core.camera import Camera, camera_from_fov
from gslts.core.gaussian_map import GaussianMap
from gslts.store.camera_files import cameras_of_map
from gslts.store.causes import UpdateCause, UpdateFrame
from gslts.store.map_folder import camera_to_json, open_map, read_map, write_map_folder

ARRAYS = ("means", "quats", "log_scales", "logit_opacities", "sh", "features")
"""Arrays of a map, besides ids."""


def random_map(
    rng: np.random.Generator, count: int, first_id: int, sh_degree: int = 1
) -> GaussianMap:
    """Return a map of random Gaussians."""
    return GaussianMap(
        means=rng.normal(size=(count, 3)).astype(np.float32),
        quats=rng.normal(size=(count, 4)).astype(np.float32),
        log_scales=rng.normal(size=(count, 3)).astype(np.float32),
        logit_opacities=rng.normal(size=count).astype(np.float32),
        sh=rng.normal(size=(count, (sh_degree + 1) ** 2, 3)).astype(np.float32),
        features=np.zeros((count, 0), np.float32),
        ids=np.arange(first_id, first_id + count, dtype=np.uint64),
        origin=np.zeros(3),
    )


def update(rng: np.random.Generator, before: GaussianMap, touched: int, first: int) -> GaussianMap:
    """Remove, add and change a third of the touched Gaussians each."""
    third = touched // 3
    start = int(rng.integers(before.size - 2 * third))
    kept = np.ones(before.size, bool)
    kept[start : start + third] = False
    arrays = {name: getattr(before, name).copy() for name in ARRAYS}
    for array in arrays.values():
        array[start + third : start + 2 * third] += np.float32(0.01)
    new = random_map(rng, third, first)
    return GaussianMap(
        **{name: np.concatenate([arrays[name][kept], getattr(new, name)]) for name in ARRAYS},
        ids=np.concatenate([before.ids[kept], new.ids]),
        origin=before.origin,
    )


def camera(rng: np.random.Generator) -> Camera:
    pose = np.eye(4)
    pose[:3, 3] = rng.uniform(0, 5, 3)
    return camera_from_fov(640, 480, np.pi / 2, pose)


def seconds(work: object, times: int = 5) -> float:
    """Return the median run time, s."""
    durations_s = []
    for _ in range(times):
        start_s = time.perf_counter()
        work()  # type: ignore[operator]
        durations_s.append(time.perf_counter() - start_s)
    return float(np.median(durations_s))


def size_of(folder: Path) -> int:
    """Return the size of all files in a folder, bytes."""
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())


def main() -> None:
    """Measure, and print JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--gaussians", type=int, default=500_000)
    parser.add_argument("--versions", type=int, default=1000)
    parser.add_argument("--touched", type=int, default=3000, help="Gaussians per update")
    parser.add_argument("--views", type=int, default=12, help="frames per update")
    given = parser.parse_args()
    rng = np.random.default_rng(0)
    with TemporaryDirectory(dir=os.environ.get("TMPDIR")) as temporary:
        folder = Path(temporary) / "map"
        gaussian_map = random_map(rng, given.gaussians, 0)
        cameras = {f"{k:05}": camera(rng) for k in range(200)}
        write_map_folder(folder, gaussian_map, {"dataset": "random"}, cameras)
        first_bytes = size_of(folder)
        bytes_each = gaussian_map.nbytes / gaussian_map.size
        commit_s = []
        with open_map(folder, writable=True) as store:
            for _ in tqdm(range(given.versions - 1), desc="committing"):
                newest = store.version()
                gaussian_map = update(rng, gaussian_map, given.touched, newest.next_id)
                frames = [
                    UpdateFrame(**camera_to_json(camera(rng)), new_viewpoint=k == 0)
                    for k in range(given.views)
                ]
                start_s = time.perf_counter()
                store.commit(gaussian_map, UpdateCause(frames=tuple(frames)))
                commit_s.append(time.perf_counter() - start_s)
        bytes_per_update = (size_of(folder) - first_bytes) / (given.versions - 1)
        with open_map(folder) as store:
            newest = store.version().number
            results = {
                "gaussians": gaussian_map.size,
                "versions": newest,
                "open and read the newest, s": seconds(lambda: read_map(folder)),
                "cameras, s": seconds(lambda: cameras_of_map(folder)),
                "read others, s": {
                    k: seconds(lambda k=k: store.read(k), 3)
                    for k in range(1, newest + 1, max(1, newest // 8))
                },
                "commit, s": [float(np.median(commit_s)), max(commit_s)],
                "bytes an update": bytes_per_update,
                "of the Gaussians touched": bytes_per_update / (given.touched * bytes_each),
            }
    print(json.dumps(results, indent=1))


if __name__ == "__main__":
    main()
