"""TUM RGB-D (Sturm et al. 2012): rgb.txt, depth.txt and groundtruth.txt, each with time stamps.

Without groundtruth.txt, frames have no pose.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gslts.datasets.dataset import Dataset, gather, name_of, pinhole
from gslts.datasets.files import image_file, read_rows
from gslts.datasets.image_frame import ImageFrame, with_unique_names
from gslts.datasets.poses import pose_from_numbers
from gslts.io.image_files import image_size
from gslts.types import Floats

DEPTH_UNIT_M = 1 / 5000
"""Metres of one step of a depth image, as the page of the data set says."""
MAX_GAP_S = 0.02
"""Maximum time between a colour image and its depth image or pose, as in the data set's tools."""
INTRINSICS = {
    "freiburg1": (517.3, 516.5, 318.6, 255.3),
    "freiburg2": (520.9, 521.0, 325.1, 249.7),
    "freiburg3": (535.4, 539.2, 320.1, 247.6),
}
"""fx, fy, cx, cy in px by a part of the folder's name, from the page of the data set."""
INTRINSICS_WIDTH_PX = 640
"""Width of the 4:3 images for which these intrinsics hold."""
DEFAULT_INTRINSICS = (525.0, 525.0, 319.5, 239.5)
"""fx, fy, cx, cy in px that the page of the data set recommends for other cameras."""


def is_tum(path: Path) -> bool:
    """Return True if a folder has the lists of images.

    Args:
        path: Any path.
    """
    return all((path / name).exists() for name in ("rgb.txt", "depth.txt"))


def open_tum(path: Path) -> Dataset:
    """Open a sequence; each colour image gets the depth image and the pose nearest in time.

    The intrinsics depend on the name of the folder. Lens distortion is not corrected. Damaged
    lines are skipped and listed.

    Args:
        path: Folder of the sequence.

    Raises:
        OSError: A list cannot be read.
        ValueError: No line of a list can be used.
    """
    trajectory = path / "groundtruth.txt"
    is_posed = trajectory.exists()
    names, bad_names = _good_rows(path / "rgb.txt", 2, 1)
    depth_rows, bad_depths = _good_rows(path / "depth.txt", 2, 1)
    pose_rows, bad_poses = _good_rows(trajectory, 8, 8) if is_posed else ([], [])
    depth_times, pose_times = (_times(rows) for rows in (depth_rows, pose_rows))
    poses = np.array([row[1:] for row in pose_rows], np.float64).reshape(-1, 7)
    folder = f"{path.name} {path.resolve().name}"  # A link may have a name of its own.

    def make(row: list[str]) -> ImageFrame:
        time_s, rgb = float(row[0]), image_file(path, row[1])
        depth = _nearest(depth_times, time_s, "depth image")
        pose = (
            pose_from_numbers(poses[_nearest(pose_times, time_s, "pose")])
            if is_posed
            else np.eye(4)
        )
        size = image_size(rgb)
        camera = pinhole(_intrinsics(folder, size), size, pose)
        depth_path = image_file(path, depth_rows[depth][1], "depth image")
        return ImageFrame(rgb, camera, depth_path, DEPTH_UNIT_M, time_s=time_s)

    frames, skipped, missing = gather(((row[1], row) for row in names), make)
    named = with_unique_names(frames, path)
    return Dataset(
        name_of(path),
        named if is_posed else (),
        (*skipped, *bad_names, *_summary(bad_depths), *_summary(bad_poses)),
        unposed=() if is_posed else named,
        missing=missing,
    )


def read_trajectory(path: Path) -> list[Floats]:
    """Read the poses of a file like groundtruth.txt.

    Args:
        path: Text file with lines of time tx ty tz qx qy qz qw.

    Returns:
        World_from_camera [4,4] of each line, m.

    Raises:
        OSError: The file cannot be read.
        ValueError: A line is not eight numbers, or its quaternion does not have length 1.
    """
    poses = []
    rows, bad_lines = read_rows(path, 8, 8)
    if bad_lines:
        raise ValueError(f"{path}: {bad_lines[0]}")
    for number, row in enumerate(rows):
        try:
            poses.append(pose_from_numbers(np.array(row[1:], np.float64)))
        except ValueError as error:
            raise ValueError(f"{path}: pose {number}: {error}") from None
    return poses


def _intrinsics(folder: str, size: tuple[int, int]) -> tuple[float, ...]:
    """Return fx, fy, cx, cy in px for images of a size, by the name of their folder."""
    width, height = size
    if 3 * width != 4 * height:
        raise ValueError(f"{width} x {height} px: intrinsics are known for 4:3 images only")
    fx, fy, cx, cy = next(
        (values for key, values in INTRINSICS.items() if key in folder), DEFAULT_INTRINSICS
    )
    # OpenCV's pixel centres are whole numbers, those of this project lie at +0.5.
    scale = width / INTRINSICS_WIDTH_PX
    return scale * fx, scale * fy, scale * (cx + 0.5), scale * (cy + 0.5)


def _good_rows(path: Path, columns: int, numbers: int) -> tuple[list[list[str]], list[str]]:
    """Read rows; errors name the file, and a file without a good line is an error."""
    rows, bad = read_rows(path, columns, numbers)
    if bad and not rows:
        raise ValueError(f"{path}: no line can be used; {bad[0]}")
    return rows, [f"{path.name}: {reason}" for reason in bad]


def _summary(bad: list[str]) -> list[str]:
    """Return the first of many damaged lines, with the number of the others."""
    return [f"{bad[0]}, and {len(bad) - 1} lines more" if len(bad) > 1 else bad[0]] if bad else []


def _times(rows: list[list[str]]) -> Floats:
    return np.array([row[0] for row in rows], np.float64)


def _nearest(times: Floats, time_s: float, what: str) -> int:
    """Return the index of the nearest time, at most `MAX_GAP_S` away."""
    gaps_s = np.abs(times - time_s)
    if len(times) == 0 or gaps_s.min() > MAX_GAP_S:
        raise ValueError(f"there is no {what} within {MAX_GAP_S:g} s")
    return int(gaps_s.argmin())
