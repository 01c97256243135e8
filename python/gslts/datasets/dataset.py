"""Posed images of a scene, read one by one."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from gslts.core.camera import Camera
from gslts.core.frame import Labels, RgbdFrame
from gslts.core.se3 import product
from gslts.datasets.undistort import Lens, undistort_depth, undistort_rgb

RIGID_TOLERANCE = 0.02
"""Of the singular values of a rotation; those of 7-Scenes are off by up to some thousandths."""
POLAR_STEPS = 5
"""Newton steps from such a matrix to the nearest rotation; each doubles the right digits."""
MAX_PIXELS = 1 << 26
"""Larger images are refused before memory is taken."""
MAX_SIDE_PX = 1 << 16
FOCAL_RANGE = (0.05, 50.0)
"""Of the focal length over the longer side of the image: from 168 degrees of view to 1.1."""
MOST_NUMBERS_BYTES = 10_000
"""Of a text file with a small matrix."""


class Frame(Protocol):
    """A frame that is still on the disk."""

    @property
    def name(self) -> str:
        """Such as the name of its file."""
        ...

    @property
    def camera(self) -> Camera:
        """Intrinsics and pose, as the data set gives them."""
        ...

    def read(self) -> RgbdFrame:
        """Reads it; without depth, the depth is 0 everywhere.

        Raises:
            OSError: A file cannot be read.
            ValueError: A file is damaged or does not fit the camera; the message names it.
        """
        ...


@dataclass(frozen=True, eq=False)
class PointCloud:
    """Points of the scene that came with the frames.

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
    """A recorded visit.

    Args:
        name: Such as that of its folder.
        frames: In the order in which they were taken.
        skipped: What was left out when the data set was opened: names, and why.
        points: What the data set knows of the scene besides its frames; None if nothing.
        unposed: Frames of which nobody knows where they were taken; their poses are the identity.
    """

    name: str
    frames: tuple[Frame, ...]
    skipped: tuple[str, ...] = ()
    points: PointCloud | None = None
    unposed: tuple[Frame, ...] = ()


@dataclass(frozen=True, eq=False)
class ImageFrame:
    """A frame in image files.

    Args:
        rgb: Of any kind that Pillow reads.
        camera: Intrinsics and pose.
        depth: 16-bit picture of z in the camera frame; None if there is none.
        depth_unit_m: What one step of it is worth.
        depth_invalid: Number besides 0 that means no measurement; None if there is none.
        time_s: When it was taken.
        depth_camera: Intrinsics and pose of the depth; None if it is registered.
        lens: That distorts the colours, and registered depth with them; None if none does. What it
            does is undone when the frame is read.
        instances: 16-bit picture, 1 + row of the object in `types`, 0 where there is none; None if
            there is none. A picture whose distortion is undone keeps no labels.
        types: Of the objects.
        longer_name: Where the file's own does not tell it from other frames; "" elsewhere.
    """

    rgb: Path
    camera: Camera
    depth: Path | None = None
    depth_unit_m: float = 0.001
    depth_invalid: int | None = None
    time_s: float = 0.0
    depth_camera: Camera | None = None
    lens: Lens | None = None
    instances: Path | None = None
    types: tuple[str, ...] = ()
    longer_name: str = ""

    @property
    def name(self) -> str:
        """The name of the colour picture without its ending, or a longer one."""
        return self.longer_name or self.rgb.stem

    def read(self) -> RgbdFrame:
        """Reads its pictures."""
        size = (self.camera.height, self.camera.width)
        labels = None if self.instances is None or self.lens is not None else self._labels(size)
        rgb = read_image(self.rgb, "RGB", size).astype(np.uint8)
        mask = None
        if self.lens is not None:
            rgb, mask = undistort_rgb(rgb, self.camera, self.lens)
        if self.depth is None:
            depth = np.zeros(size, np.float32)
            return RgbdFrame(rgb, depth, self.camera, self.time_s, None, mask, labels)
        beside = self.camera if self.depth_camera is None else self.depth_camera
        steps = read_image(self.depth, "I", (beside.height, beside.width))
        depth = (steps * self.depth_unit_m).astype(np.float32)
        depth[(steps <= 0) | (steps == self.depth_invalid)] = 0
        if self.lens is not None and self.depth_camera is None:
            depth = undistort_depth(depth, self.camera, self.lens)
        return RgbdFrame(rgb, depth, self.camera, self.time_s, self.depth_camera, mask, labels)

    def _labels(self, size: tuple[int, int]) -> Labels:
        assert self.instances is not None
        rows = read_image(self.instances, "I", size).astype(np.int32) - 1
        try:
            return Labels(rows, self.types)
        except ValueError as error:
            raise ValueError(f"{self.instances}: {error}") from None


def reason_of(error: Exception) -> str:
    """What an error says, in one line; its kind if it says nothing."""
    return " ".join(str(error).split()) or type(error).__name__


def name_of(path: Path) -> str:
    """The name of a folder, which `.` and `..` do not say themselves."""
    return path.resolve().name if path.name in ("", "..") else path.name


def told_apart(frames: Iterable[ImageFrame], folder: Path) -> tuple[ImageFrame, ...]:
    """The frames of a folder; those of one name get their path in it, with the ending if need be.

    Only frames of the very same picture still have one name.
    """
    named = tuple(frames)
    for with_ending in (False, True):
        counts = Counter(one.name for one in named)
        named = tuple(
            replace(one, longer_name=_path_in(folder, one.rgb, with_ending))
            if counts[one.name] > 1
            else one
            for one in named
        )
    return named


def _path_in(folder: Path, file: Path, with_ending: bool) -> str:
    path = os.path.relpath(file if with_ending else file.with_suffix(""), folder)
    return Path(path).as_posix()


def pinhole(
    intrinsics: tuple[float, ...], size: tuple[int, int], world_from_camera: NDArray[np.float64]
) -> Camera:
    """The camera of a file that may be wrong.

    Args:
        intrinsics: fx, fy, cx, cy, px.
        size: Width and height of the image, px.
        world_from_camera: [4,4], rigid, m.

    Raises:
        ValueError: The intrinsics cannot be those of an image of that size, or are none.
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


def rigid(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """The nearest rigid transform to a [4,4] pose that was written with few digits.

    Raises:
        ValueError: It is none, not even roughly.
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


def image_size(path: Path) -> tuple[int, int]:
    """Width and height of a picture, px.

    Raises:
        OSError: It cannot be read.
        ValueError: It is no picture.
    """
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(path) as image:
            return image.size
    except UnidentifiedImageError:
        raise ValueError(f"{path}: it is no picture") from None
    except OSError:
        raise
    except Exception as error:  # Pillow raises errors of any kind for damage.
        raise ValueError(f"{path}: {reason_of(error)}") from None


def read_image(path: Path, mode: str, size: tuple[int, int]) -> NDArray[Any]:
    """The pixels of a picture of that height and width, in a mode of Pillow.

    Raises:
        OSError: It cannot be read.
        ValueError: It is damaged or has another size.
    """
    width, height = image_size(path)
    if (height, width) != size:
        raise ValueError(f"{path}: it has {width} x {height} px, expected {size[1]} x {size[0]}")
    if width * height > MAX_PIXELS:
        raise ValueError(f"{path}: {width} x {height} px are more than {MAX_PIXELS}")
    from PIL import Image

    try:
        with Image.open(path) as image:
            return np.asarray(image.convert(mode))
    except Exception as error:  # As above.
        raise ValueError(f"{path}: {reason_of(error)}") from None


def read_numbers(path: Path, shape: tuple[int, int]) -> NDArray[np.float64]:
    """A matrix of numbers in a text file.

    Raises:
        OSError: It cannot be read.
        ValueError: It holds anything else, or another number of them, or is too long.
    """
    with path.open("rb") as file:
        content = file.read(MOST_NUMBERS_BYTES + 1)
    if len(content) > MOST_NUMBERS_BYTES:
        raise ValueError(f"{path}: more than {MOST_NUMBERS_BYTES} bytes are no matrix of {shape}")
    try:
        numbers = np.array(content.decode(errors="replace").split(), np.float64)
    except ValueError as error:
        raise ValueError(f"{path}: {str(error)[:80]}") from None
    if numbers.size != shape[0] * shape[1]:
        raise ValueError(f"{path}: expected {shape[0]} x {shape[1]} numbers, got {numbers.size}")
    return numbers.reshape(shape)
