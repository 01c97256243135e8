"""Data sets of posed images, read frame by frame."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from gslts.core.camera import Camera
from gslts.core.frame import RgbdFrame
from gslts.core.se3 import product
from gslts.datasets.files import MissingImageError
from gslts.io.bounded_files import read_bounded
from gslts.io.messages import to_line

RIGID_TOLERANCE = 0.02
"""Maximum error of the singular values of a rotation; those of 7-Scenes err by up to 0.005."""
POLAR_STEPS = 5
"""Newton steps from such a matrix to the nearest rotation; each doubles the correct digits."""
MAX_SIDE_PX = 1 << 16
"""Maximum width and height of an image; bounds both before they are multiplied."""
FOCAL_RANGE = (0.05, 50.0)
"""Focal length over the longer side of the image: a field of view of 168 to 1.1 degrees."""
MAX_MATRIX_BYTES = 10_000
"""Maximum size of a text file with a small matrix; 16 numbers take 400 bytes."""
NAMED_FRAMES = 3
"""Number of frames that a line about several frames names."""


class Frame(Protocol):
    """A frame on the disk, not read yet."""

    @property
    def name(self) -> str:
        """Unique name, such as the name of the colour image."""
        ...

    @property
    def camera(self) -> Camera:
        """Intrinsics and pose as the data set gives them."""
        ...

    def read(self) -> RgbdFrame:
        """Read the images; without depth, the depth is 0 everywhere.

        Raises:
            OSError: A file cannot be read.
            ValueError: A file is damaged or does not fit the camera; the message names it.
        """
        ...


Entry = TypeVar("Entry")
FrameKind = TypeVar("FrameKind", bound=Frame)


@dataclass(frozen=True, eq=False)
class PointCloud:
    """Coloured points of the scene, as a data set provides them.

    Args:
        points: [P,3] float64, world frame, m.
        colors: [P,3] uint8, sRGB.

    Raises:
        ValueError: An array has a wrong shape or dtype, or a point is not finite.
    """

    points: NDArray[np.float64]
    colors: NDArray[np.uint8]

    def __post_init__(self) -> None:
        shape = (len(self.points), 3)
        for name, dtype in (("points", np.float64), ("colors", np.uint8)):
            array = getattr(self, name)
            if array.dtype != dtype or array.shape != shape:
                raise ValueError(
                    f"PointCloud: {name}: expected {np.dtype(dtype)} {shape}, got {array.dtype} "
                    f"{array.shape}"
                )
        if not np.isfinite(self.points).all():
            raise ValueError("PointCloud: points: must be finite")


@dataclass(frozen=True)
class Dataset:
    """A recording: frames with poses, in the order in which they were taken.

    Args:
        name: Name of its folder or file.
        frames: Frames with poses.
        skipped: Frames that cannot be used: name and reason, one line each.
        missing: Frames whose images do not exist, as lines of the same form. They are no sign of a
            damaged data set: users delete images, or copy only some.
        points: Points of the scene; None if the data set has none.
        unposed: Frames without a pose; the pose of their cameras is the identity.
        why_unposed: Reason why they have none.
    """

    name: str
    frames: tuple[Frame, ...]
    skipped: tuple[str, ...] = ()
    points: PointCloud | None = None
    unposed: tuple[Frame, ...] = ()
    why_unposed: str = "it has no pose"
    missing: tuple[str, ...] = ()

    @property
    def left_out(self) -> tuple[str, ...]:
        """Lines of all frames that are left out: `skipped` and `missing`."""
        return self.skipped + self.missing


def gather(
    entries: Iterable[tuple[str, Entry]], make: Callable[[Entry], FrameKind]
) -> tuple[tuple[FrameKind, ...], tuple[str, ...], tuple[str, ...]]:
    """Make the frames of a data set; those that cannot be used do not stop the others.

    Args:
        entries: Name of each frame, for messages, and what its frame is made of.
        make: Makes a frame; raises OSError or ValueError if it cannot be used.

    Returns:
        `frames`, `skipped` and `missing` of a `Dataset`.
    """
    frames: list[FrameKind] = []
    skipped: list[str] = []
    missing: list[str] = []
    for name, entry in entries:
        try:
            frames.append(make(entry))
        except MissingImageError as error:
            missing.append(to_line(str(error)))
        except (OSError, ValueError) as error:
            skipped.append(to_line(f"{name}: {error}"))
    return tuple(frames), tuple(skipped), tuple(missing)


def join_reasons(left_out: Iterable[str]) -> list[str]:
    """Join the lines of frames that are left out for the same reason.

    Args:
        left_out: Lines of the form "name: reason".

    Returns:
        A line for each reason, the most frequent first; of many frames, it names the first.
    """
    names: dict[str, list[str]] = {}
    for line in left_out:
        name, _, reason = line.partition(": ")
        names.setdefault(reason, []).append(name)
    return [
        f"{first[0]}: {reason}" if len(first) == 1 else _line_of_many(first, reason)
        for reason, first in sorted(names.items(), key=lambda item: -len(item[1]))
    ]


def _line_of_many(names: list[str], reason: str) -> str:
    more = ", ..." if len(names) > NAMED_FRAMES else ""
    return f"{len(names)} frames ({', '.join(names[:NAMED_FRAMES])}{more}): {reason}"


def reason_of(error: Exception) -> str:
    """Return the message of an error in one line; its type if it has no message.

    Args:
        error: An error of any type.
    """
    return to_line(str(error)) or type(error).__name__


def name_of(path: Path) -> str:
    """Return the name of a folder, also for `.` and `..`.

    Args:
        path: Path of the folder.
    """
    return path.resolve().name if path.name in ("", "..") else path.name


def pinhole(
    intrinsics: tuple[float, ...], size: tuple[int, int], world_from_camera: NDArray[np.float64]
) -> Camera:
    """Make a pinhole camera from the untrusted numbers of a file.

    Args:
        intrinsics: fx, fy, cx, cy, px.
        size: Width and height of the image, px.
        world_from_camera: [4,4] rigid pose, m.

    Raises:
        ValueError: The intrinsics do not fit an image of that size, or are not finite.
    """
    (fx, fy, cx, cy), (width, height) = intrinsics, size
    if not (0 < width <= MAX_SIDE_PX and 0 < height <= MAX_SIDE_PX):
        raise ValueError(f"an image cannot have {width} x {height} px")
    if not (0 <= cx <= width and 0 <= cy <= height):
        raise ValueError(
            f"the principal point ({cx:g}, {cy:g}) is outside the image of {width} x {height} px"
        )
    least, most = (share * max(width, height) for share in FOCAL_RANGE)
    for focal in (fx, fy):
        if not least <= focal <= most:
            raise ValueError(
                f"a focal length of {focal:g} px does not fit an image of {width} x {height} px"
            )
    return Camera(
        fx=fx,
        fy=fy,
        cx=cx,
        cy=cy,
        width=width,
        height=height,
        world_from_camera=world_from_camera,
    )


def resize_camera(camera: Camera, size: tuple[int, int]) -> Camera:
    """Return a camera that shows the same with another number of pixels.

    Args:
        camera: A camera.
        size: Width and height of the other image, px.

    Raises:
        ValueError: A side is not within 1 to `MAX_SIDE_PX`.
    """
    x, y = size[0] / camera.width, size[1] / camera.height
    intrinsics = (x * camera.fx, y * camera.fy, x * camera.cx, y * camera.cy)
    return pinhole(intrinsics, size, camera.world_from_camera)


def rigid(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the nearest rigid transform to a pose that was written with few digits.

    Args:
        matrix: [4,4] pose, m.

    Returns:
        [4,4] rigid transform (Newton's iteration of the polar decomposition, Higham 1986).

    Raises:
        ValueError: The matrix is not rigid within `RIGID_TOLERANCE`.
    """
    if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
        raise ValueError("the pose must be 4 x 4 finite numbers")
    rotation = matrix[:3, :3]
    sizes = np.linalg.svd(rotation, compute_uv=False)
    bottom = np.abs(matrix[3] - (0, 0, 0, 1)).max()
    if max(np.abs(sizes - 1).max(), bottom) > RIGID_TOLERANCE or np.linalg.det(rotation) < 0:
        raise ValueError(f"the pose is not rigid: {np.round(matrix, 4).tolist()}")
    for _ in range(POLAR_STEPS):
        rotation = 0.5 * (3 * rotation - product(rotation, product(rotation.T, rotation)))
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, matrix[:3, 3]
    return pose


def read_numbers(path: Path, shape: tuple[int, int]) -> NDArray[np.float64]:
    """Read a matrix of numbers from a text file.

    Args:
        path: Text file.
        shape: Rows and columns of the matrix.

    Returns:
        [R,C] numbers.

    Raises:
        OSError: The file cannot be read.
        ValueError: The file is too long, or does not hold that many numbers and nothing else.
    """
    content = read_bounded(path, MAX_MATRIX_BYTES)
    try:
        numbers = np.array(content.decode(errors="replace").split(), np.float64)
    except ValueError as error:
        raise ValueError(f"{path}: {str(error)[:80]}") from None
    if numbers.size != shape[0] * shape[1]:
        raise ValueError(f"{path}: expected {shape[0]} x {shape[1]} numbers, got {numbers.size}")
    return numbers.reshape(shape)
