"""7-Scenes (Shotton et al. 2013): frame-N.color, .depth.png and .pose.txt in one folder."""

from __future__ import annotations

from pathlib import Path

from gslts.datasets.dataset import Dataset, ImageFrame, image_size, pinhole, read_numbers, rigid

NO_DEPTH = 65535
FOCAL_PX = 585.0
"""Of the Kinect's depth camera, as the data set's page recommends for both of its images."""


def is_seven_scenes(path: Path) -> bool:
    """Whether a folder looks like a sequence of 7-Scenes."""
    return any(path.glob("frame-*.pose.txt"))


def open_seven_scenes(path: Path) -> Dataset:
    """Opens a sequence; `camera-intrinsics.txt` (3 x 3) replaces the recommended intrinsics."""
    intrinsics = path / "camera-intrinsics.txt"
    matrix = read_numbers(intrinsics, (3, 3)) if intrinsics.exists() else None
    frames: list[ImageFrame] = []
    skipped: list[str] = []
    for pose_path in sorted(path.glob("frame-*.pose.txt")):
        stem = pose_path.name.removesuffix(".pose.txt")
        try:
            rgb = next(path.glob(f"{stem}.color.*"), None)
            if rgb is None:
                raise ValueError(f"{stem}: there is no colour picture")
            width, height = image_size(rgb)
            numbers = (
                (FOCAL_PX, FOCAL_PX, width / 2, height / 2)
                if matrix is None
                else (matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2])
            )
            pose = rigid(read_numbers(pose_path, (4, 4)))
            camera = pinhole(numbers, (width, height), pose)
            depth = path / f"{stem}.depth.png"
            frames.append(
                ImageFrame(
                    rgb,
                    camera,
                    depth if depth.exists() else None,
                    depth_invalid=NO_DEPTH,
                    time_s=float(len(frames)),
                )
            )
        except (OSError, ValueError) as error:
            skipped.append(f"{stem}: {error}")
    return Dataset(path.name, tuple(frames), tuple(skipped))
