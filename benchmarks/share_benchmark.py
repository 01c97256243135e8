"""Time, bytes and requests of the exchange of a map through an object store on this machine.

    python benchmarks/share_benchmark.py

makes a map of random Gaussians, pushes it to Azurite (`faults/object_store.py`) and clones it. Then
updates with frames, landmarks and an image, as large as those of images of 640x480, are pushed and
pulled into the clone; the last one passes a proxy that counts its requests and bytes.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from store_benchmark import camera, random_map, size_of

from gslts.core.gaussian_map import GaussianMap
from gslts.fleet.exchange import clone_map, pull_map, push_map
from gslts.localization.landmark_files import write_landmarks
from gslts.localization.landmarks import Landmarks
from gslts.store.causes import UpdateCause, UpdateFrame
from gslts.store.delta import Delta
from gslts.store.manifest import update_image_path
from gslts.store.map_folder import camera_to_json, open_map, write_map_folder
from gslts.store.records import ObjectEvent
from gslts.update.publish import MAX_LANDMARK_BYTES

sys.path.insert(0, str(Path(__file__).with_name("faults")))
from object_store import AZURITE, object_store
from shared_map_benchmark import proxy_before

IMAGE_BYTES = 106_000
"""Size of the image of an update, bytes: the mean of a series of a simulated kitchen."""
CHANGED_SHARE = 0.9
"""Share of the Gaussians of an update that stay with new values, in the same series; of the others,
half are removed and half are added."""
LANDMARK_BYTES = 64
"""Size of a landmark, bytes, about."""
SH_DEGREE = 0
"""Of the maps: one colour each, as `gslts map --preset fast` makes."""
URL = f"{AZURITE.bucket}/map"


def random_delta(
    rng: np.random.Generator, before: GaussianMap, touched: int, next_id: int
) -> Delta:
    """Return an update of some Gaussians; refinement leaves their rotations."""
    changed = int(CHANGED_SHARE * touched)
    removed = (touched - changed) // 2
    start = int(rng.integers(before.size - changed - removed))
    rows = np.arange(start, start + changed)
    ids = before.ids[rows]
    refined = replace(random_map(rng, changed, 0, SH_DEGREE), quats=before.quats[rows], ids=ids)
    gone = before.ids[start + changed : start + changed + removed]
    return Delta(gone, random_map(rng, touched - changed - removed, next_id, SH_DEGREE), refined)


def commit_update(
    folder: Path,
    rng: np.random.Generator,
    make_delta: Callable[[GaussianMap, int], Delta],
    landmarks: int = MAX_LANDMARK_BYTES // LANDMARK_BYTES,
    image_bytes: int = IMAGE_BYTES,
    events: Sequence[ObjectEvent] = (),
) -> None:
    """Commit an update with frames, landmarks and an image, as large as those of a robot.

    Args:
        folder: Of the map.
        rng: For the content.
        make_delta: Given the map, and the id of the next new Gaussian.
        landmarks: Number of landmarks.
        image_bytes: Size of the image, bytes.
        events: Object changes of the update.
    """
    frames = [UpdateFrame(**camera_to_json(camera(rng)), new_viewpoint=k == 0) for k in range(12)]
    with open_map(folder, writable=True) as store:
        next_id = store.version().next_id
        points = Landmarks(
            rng.normal(size=(landmarks, 3)).astype(np.float32),
            rng.integers(256, size=(landmarks, 32)).astype(np.uint8),
            np.zeros(landmarks, np.int32),
            np.eye(4)[None],
            np.full(landmarks, next_id, np.uint64),
        )
        digest = write_landmarks(points, folder)
        cause = UpdateCause(frames=tuple(frames), landmarks=digest)
        version = store.commit(make_delta(store.read(), next_id), cause, events)
    path = update_image_path(folder, version.number)
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(rng.bytes(image_bytes))


def seconds(work: Callable[[], object]) -> float:
    """Return the run time, s."""
    start_s = time.perf_counter()
    work()
    return time.perf_counter() - start_s


def main() -> None:
    """Measure, and print JSON."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--gaussians", type=int, default=500_000)
    parser.add_argument("--touched", type=int, default=3000, help="Gaussians per update")
    parser.add_argument("--updates", type=int, default=5)
    given = parser.parse_args()
    rng = np.random.default_rng(0)

    def make_delta(before: GaussianMap, next_id: int) -> Delta:
        return random_delta(rng, before, given.touched, next_id)

    with tempfile.TemporaryDirectory() as name, object_store() as port:
        os.environ.update(AZURITE.environment(port))
        first, second = Path(name) / "first", Path(name) / "second"
        cameras = {f"{k:05}": camera(rng) for k in range(200)}
        write_map_folder(first, random_map(rng, given.gaussians, 0, SH_DEGREE), {}, cameras)
        results = {
            "map, bytes": size_of(first),
            "push all, s": seconds(lambda: push_map(first, URL)),
        }
        clones_s = []
        for _ in range(3):
            shutil.rmtree(second, ignore_errors=True)
            clones_s.append(seconds(lambda: clone_map(URL, second)))
        pushes_s, pulls_s = [], []
        for _ in range(given.updates):
            commit_update(first, rng, make_delta)
            pushes_s.append(seconds(lambda: push_map(first)))
            pulls_s.append(seconds(lambda: pull_map(second)))
        commit_update(first, rng, make_delta)
        with proxy_before(port, rate=0.0) as (faulty, counts):
            os.environ.update(AZURITE.environment(faulty))
            push_map(first)
        results |= {
            "clone, s": clones_s,
            "push an update, s": pushes_s,
            "pull it, s": pulls_s,
            "push an update": counts,
        }
    print(json.dumps(results, indent=1))


if __name__ == "__main__":
    main()
