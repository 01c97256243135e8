"""Errors of the poses that `gslts map --poses estimate` finds: of RGB-D frames, and photographs.

    python benchmarks/poses_benchmark.py --homes kitchen_3 living_room_3 --json out/poses.json

Each home is recorded with the errors of a Kinect. The poses are estimated from the images of the
recording, and from 50 of its colour images alone, and compared with the true poses after the best
rigid motion, for photographs the best similarity. The given poses of the recording are compared as
well: they have the errors of a robot's localization.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path

import numpy as np
from PIL import Image

from gslts.core.se3 import fit_rigid_motion, pose_distance, product
from gslts.datasets import Dataset, open_dataset
from gslts.datasets.poses import OPENGL_FROM_OPENCV
from gslts.io.atomic_files import write_atomic
from gslts.trajectory.estimate import estimate_poses
from gslts.trajectory.photographs import place_photographs
from gslts.types import Floats
from gslts_bench.extension.run import TYPICAL_DISTANCE_M
from gslts_bench.provenance import describe_run
from gslts_bench.tables import Table
from gslts_sim.capture import capture
from gslts_sim.controller import Controller
from gslts_sim.explore import explore
from gslts_sim.home_source import open_home

FRAMES, PHOTOGRAPHS = 200, 50
"""Maximum number of frames of a recording, and number of photographs."""
HEADER = ("", "frames", "placed", "median", "", "maximum", "", "time")
"""Names of the columns."""


def true_poses(recording: Path) -> dict[str, Floats]:
    """Read the true poses of a simulated recording.

    Args:
        recording: Folder of the data set.

    Returns:
        World_from_camera [4,4], m, by name of the frame.
    """
    frames = json.loads((recording / "transforms.json").read_text())["frames"]
    return {
        Path(frame["file_path"]).stem: np.array(frame["true_transform_matrix"]) @ OPENGL_FROM_OPENCV
        for frame in frames
    }


def row_of(
    name: str, total: int, found: Dataset, true: Mapping[str, Floats], s: float, *, scaled: bool
) -> list[str]:
    """Return a row of the table.

    Args:
        name: First cell.
        total: Number of frames.
        found: Those with poses.
        true: True poses by name.
        s: Time, s; 0 for none.
        scaled: True if the scale of the poses is unknown.
    """
    poses = np.array([frame.camera.world_from_camera for frame in found.frames])
    given = np.array([true[frame.name] for frame in found.frames])
    errors = errors_of(poses, given, scaled=scaled)
    cells = [
        f"{value:.{digits}f} {unit}"
        for metres, turn_rad in (np.median(errors, axis=0), errors.max(axis=0))
        for value, digits, unit in ((1000 * metres, 1, "mm"), (np.rad2deg(turn_rad), 3, "°"))
    ]
    return [name, str(total), str(len(poses)), *cells, f"{s:.0f} s" if s else ""]


def errors_of(poses: Floats, true: Floats, *, scaled: bool) -> Floats:
    """Return errors after the best rigid motion, and the median scale.

    Args:
        poses: [F,4,4] estimated.
        true: [F,4,4] true, m.
        scaled: True if the scale of the poses is unknown.

    Returns:
        [F,2] m and rad.
    """
    moved = poses.copy()
    if scaled:
        pairs = np.triu_indices(len(poses), 1)
        far, found = (
            np.linalg.norm(p[pairs[0], :3, 3] - p[pairs[1], :3, 3], axis=1) for p in (true, poses)
        )
        moved[:, :3, 3] *= np.median(far[found > 0] / found[found > 0])
    motion = fit_rigid_motion(moved, true, TYPICAL_DISTANCE_M)
    pairs_of_poses = zip(moved, true, strict=True)
    return np.array([pose_distance(product(motion, a), b) for a, b in pairs_of_poses])


def measure(home: str, folder: Path) -> list[list[str]]:
    """Record a home, and return the rows of its given poses, estimated poses and photographs.

    Args:
        home: Room type and seed, such as kitchen_3, or the path of a GLB file.
        folder: New folder.
    """
    room, _, seed = home.rpartition("_")
    opened = open_home(home, 0) if home.endswith(".glb") else open_home(room, int(seed))
    robot = Controller(opened, noise="kinect")
    capture(robot, explore(robot.home, FRAMES)[0], folder / "recording")
    recording, true = open_dataset(folder / "recording"), true_poses(folder / "recording")
    total = len(recording.frames)
    rows = [row_of(f"{home}: as given", total, recording, true, 0.0, scaled=False)]
    start_s = time.perf_counter()
    found = estimate_poses(recording).dataset
    seconds = time.perf_counter() - start_s
    rows.append(row_of(f"{home}: RGB-D", total, found, true, seconds, scaled=False))
    photographs = folder / "photographs"
    photographs.mkdir()
    chosen = recording.frames[:: max(1, total // PHOTOGRAPHS)][:PHOTOGRAPHS]
    for frame in chosen:
        Image.fromarray(frame.read().rgb).save(photographs / f"{frame.name}.png")
    start_s = time.perf_counter()
    try:
        placed = place_photographs(photographs, folder / "colmap").dataset
    except ValueError:  # Too few show the same place.
        return [*rows, [f"{home}: photographs", str(len(chosen)), "0", *5 * ["-"]]]
    seconds = time.perf_counter() - start_s
    rows.append(row_of(f"{home}: photographs", len(chosen), placed, true, seconds, scaled=True))
    return rows


def main() -> None:
    """Measure homes, print the table, and write the result."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--homes", nargs="+", default=["kitchen_3", "living_room_3"])
    parser.add_argument("--json", type=Path, help="file for the result")
    args = parser.parse_args()
    rows: list[list[str]] = []
    for home in args.homes:
        with tempfile.TemporaryDirectory() as folder:
            measured = measure(home, Path(folder))
        rows += measured
        print("\n".join(" | ".join(row) for row in measured), flush=True)
    table = Table("", HEADER, rows)
    if args.json is not None:
        result = {"title": "Estimated poses", **describe_run(), "tables": [asdict(table)]}
        write_atomic(args.json, (json.dumps(result, indent=1) + "\n").encode())
    print(table.markdown())


if __name__ == "__main__":
    main()
