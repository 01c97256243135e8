"""TUM RGB-D (Sturm et al. 2012): rgb.txt, depth.txt and groundtruth.txt with times of their own.

Without groundtruth.txt, no pose is known.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gslts.datasets.dataset import Dataset, ImageFrame, image_size, name_of, pinhole, told_apart
from gslts.datasets.poses import pose_of
from gslts.types import Floats

DEPTH_UNIT_M = 1 / 5000
MOST_APART_S = 0.02
"""Pictures and poses that are farther apart in time do not belong together."""
MAX_BYTES = 1 << 28
INTRINSICS = {
    "freiburg1": (517.3, 516.5, 318.6, 255.3),
    "freiburg2": (520.9, 521.0, 325.1, 249.7),
    "freiburg3": (535.4, 539.2, 320.1, 247.6),
}
"""fx, fy, cx, cy in px by a part of the folder's name, from the data set's page."""
INTRINSICS_WIDTH_PX = 640
"""Of the pictures that have them, in 4:3."""
DEFAULT_INTRINSICS = (525.0, 525.0, 319.5, 239.5)
"""The data set's page recommends these where nothing is known."""


def is_tum(path: Path) -> bool:
    """Whether a folder has the lists of pictures."""
    return all((path / name).exists() for name in ("rgb.txt", "depth.txt"))


def open_tum(path: Path) -> Dataset:
    """Opens a sequence; each colour picture gets the depth and the pose next in time.

    Intrinsics go by the folder's name; the lens distortion, which the data set's page leaves to
    those who need it, is not corrected. Lines that are damaged are left out, and told.

    Raises:
        OSError: A list cannot be read.
        ValueError: No line of a list can be used.
    """
    trajectory = path / "groundtruth.txt"
    is_posed = trajectory.exists()
    names, bad_names = _good_rows(path / "rgb.txt", 2)
    depth_rows, bad_depths = _good_rows(path / "depth.txt", 2)
    pose_rows, bad_poses = _good_rows(trajectory, 8) if is_posed else ([], [])
    depth_times, pose_times = (_times(rows) for rows in (depth_rows, pose_rows))
    poses = np.array([row[1:] for row in pose_rows], np.float64).reshape(-1, 7)
    folder = f"{path.name} {path.resolve().name}"  # A link may have a name of its own.
    frames: list[ImageFrame] = []
    skipped: list[str] = []
    for time, name in names:
        try:
            time_s = float(time)
            depth = _nearest(depth_times, time_s, "depth picture")
            pose = _pose(poses[_nearest(pose_times, time_s, "pose")]) if is_posed else np.eye(4)
            size = image_size(path / name)
            camera = pinhole(_intrinsics(folder, size), size, pose)
        except (OSError, ValueError) as error:
            skipped.append(f"{name}: {error}")
            continue
        depth_path = path / depth_rows[depth][1]
        frames.append(ImageFrame(path / name, camera, depth_path, DEPTH_UNIT_M, time_s=time_s))
    named = told_apart(frames, path)
    return Dataset(
        name_of(path),
        named if is_posed else (),
        (*skipped, *bad_names, *_summed(bad_depths), *_summed(bad_poses)),
        unposed=() if is_posed else named,
    )


def read_trajectory(path: Path) -> list[Floats]:
    """The poses [4,4] world_from_camera of a file like groundtruth.txt, in its order.

    Raises:
        OSError: It cannot be read.
        ValueError: A line is not eight numbers, or its quaternion is none.
    """
    poses = []
    rows, bad_lines = _rows(path, 8)
    if bad_lines:
        raise ValueError(f"{path}: {bad_lines[0]}")
    for number, row in enumerate(rows):
        try:
            poses.append(_pose(np.array(row[1:], np.float64)))
        except ValueError as error:
            raise ValueError(f"{path}: pose {number}: {error}") from None
    return poses


def _intrinsics(folder: str, size: tuple[int, int]) -> tuple[float, ...]:
    """fx, fy, cx, cy in px of pictures of a size, by the name of their folder.

    Raises:
        ValueError: Pictures of this shape are not the whole ones of the data set's cameras.
    """
    width, height = size
    if 3 * width != 4 * height:
        raise ValueError(f"it has {width} x {height} px, but intrinsics are known for 4:3 only")
    fx, fy, cx, cy = next(
        (values for key, values in INTRINSICS.items() if key in folder), DEFAULT_INTRINSICS
    )
    # Calibrations by OpenCV count from the middle of the first pixel, this project from its corner.
    scale = width / INTRINSICS_WIDTH_PX
    return scale * fx, scale * fy, scale * (cx + 0.5), scale * (cy + 0.5)


def _good_rows(path: Path, columns: int) -> tuple[list[list[str]], list[str]]:
    """As `_rows`, with the name of the file before what is wrong.

    Raises:
        ValueError: All lines are damaged.
    """
    rows, bad = _rows(path, columns)
    if bad and not rows:
        raise ValueError(f"{path}: no line can be used; {bad[0]}")
    return rows, [f"{path.name}: {reason}" for reason in bad]


def _summed(bad: list[str]) -> list[str]:
    """Of lines that are no frames, and maybe many more than there are frames: the first for all."""
    return [f"{bad[0]}, and {len(bad) - 1} lines more" if len(bad) > 1 else bad[0]] if bad else []


def _rows(path: Path, columns: int) -> tuple[list[list[str]], list[str]]:
    """The words of each line that is no comment, and what is wrong with those that are damaged."""
    if path.stat().st_size > MAX_BYTES:
        raise ValueError(f"{path}: larger than {MAX_BYTES >> 20} MiB")
    rows, bad = [], []
    text = path.read_text(encoding="utf-8", errors="replace")
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.split()
        if not words or words[0].startswith("#"):
            continue
        numbers = words[:1] if columns == 2 else words  # Pictures have a name behind their time.
        if len(words) != columns or not all(map(_is_finite, numbers)):
            bad.append(f"line {number}: {line[:80]!r} is not {columns} values")
        else:
            rows.append(words)
    return rows, bad


def _is_finite(word: str) -> bool:
    try:
        return bool(np.isfinite(float(word)))
    except ValueError:
        return False


def _times(rows: list[list[str]]) -> Floats:
    return np.array([row[0] for row in rows], np.float64)


def _nearest(times: Floats, time_s: float, what: str) -> int:
    """Index of the time next to another.

    Raises:
        ValueError: None is near enough.
    """
    apart_s = np.abs(times - time_s)
    if len(times) == 0 or apart_s.min() > MOST_APART_S:
        raise ValueError(f"there is no {what} within {MOST_APART_S:g} s")
    return int(apart_s.argmin())


def _pose(numbers: Floats) -> Floats:
    """[4,4] of tx ty tz qx qy qz qw."""
    x, y, z, w = numbers[3:]
    return pose_of((w, x, y, z), numbers[:3])
