"""Data sets of posed images, read frame by frame."""

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
"""Maximum error of the singular values of a rotation; those of 7-Scenes err by up to 0.005."""
POLAR_STEPS = 5
"""Newton steps from such a matrix to the nearest rotation; each doubles the correct digits."""
MAX_PIXELS = 1 << 26
"""Maximum pixels of an image, checked before memory is taken; no camera of a robot has more."""
MAX_SIDE_PX = 1 << 16
"""Maximum width and height of an image; bounds both before they are multiplied."""
MAX_LIST_BYTES = 1 << 28
"""Maximum size of a file that lists frames: 100,000 frames of nerfstudio take 60 MiB, an hour of
TUM at 30 Hz 10 MiB."""
FOCAL_RANGE = (0.05, 50.0)
"""Focal length over the longer side of the image: a field of view of 168 to 1.1 degrees."""
MAX_MATRIX_BYTES = 10_000
"""Maximum size of a text file with a small matrix; 16 numbers take 400 bytes."""


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


@dataclass(frozen=True, eq=False)
class ImageFrame:
    """A frame stored as image files.

    Args:
        rgb: Colour image, of any format that Pillow reads.
        camera: Intrinsics and pose of the colour image.
        depth: 16-bit image of z in the camera frame; None without depth.
        depth_unit_m: Metres of one step of the depth image.
        depth_invalid: Value besides 0 that means no measurement; None if there is none.
        time_s: Time stamp, s.
        depth_camera: Intrinsics and pose of the depth image; None if it is registered.
        lens: Distortion of the colour image and of registered depth, undone when the frame is
            read; None for a pinhole.
        instances: 16-bit image: 1 + index of the object in `types`, 0 for no object; None without
            labels. An undistorted image keeps no labels.
        types: Types of the objects, such as "Mug".
        longer_name: Unique name where the name of the file is not unique; else "".
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
        """Name of the colour image without its ending, or `longer_name`."""
        return self.longer_name or self.rgb.stem

    def read(self) -> RgbdFrame:
        """Read the images; see `Frame.read`."""
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
    """Return the message of an error in one line; its type if it has no message.

    Args:
        error: An error of any type.
    """
    return " ".join(str(error).split()) or type(error).__name__


def name_of(path: Path) -> str:
    """Return the name of a folder, also for `.` and `..`.

    Args:
        path: Path of the folder.
    """
    return path.resolve().name if path.name in ("", "..") else path.name


def with_unique_names(frames: Iterable[ImageFrame], folder: Path) -> tuple[ImageFrame, ...]:
    """Return frames whose names are unique: their path in the folder where file names repeat.

    Args:
        frames: Frames of one data set.
        folder: Folder of the data set.

    Returns:
        The frames in the same order; only frames of the same image file still share a name.
    """
    named = tuple(frames)
    for with_ending in (False, True):
        counts = Counter(frame.name for frame in named)
        named = tuple(
            replace(frame, longer_name=_path_in(folder, frame.rgb, with_ending))
            if counts[frame.name] > 1
            else frame
            for frame in named
        )
    return named


def _path_in(folder: Path, file: Path, with_ending: bool) -> str:
    path = os.path.relpath(file if with_ending else file.with_suffix(""), folder)
    return Path(path).as_posix()


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


def image_size(path: Path) -> tuple[int, int]:
    """Read width and height of an image file, px.

    Args:
        path: Image file.

    Raises:
        OSError: The file cannot be read.
        ValueError: The file is not an image.
    """
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(path) as image:
            return image.size
    except UnidentifiedImageError:
        raise ValueError(f"{path}: not an image") from None
    except OSError:
        raise
    except Exception as error:  # Pillow raises errors of any kind for damage.
        raise ValueError(f"{path}: {reason_of(error)}") from None


def read_image(path: Path, mode: str, size: tuple[int, int]) -> NDArray[Any]:
    """Read the pixels of an image file.

    Args:
        path: Image file.
        mode: Mode of Pillow to convert to, such as "RGB" or "I".
        size: Expected height and width, px.

    Returns:
        [H,W] or [H,W,C] pixels.

    Raises:
        OSError: The file cannot be read.
        ValueError: The file is damaged, too large or of another size.
    """
    width, height = image_size(path)
    if (height, width) != size:
        raise ValueError(f"{path}: {width} x {height} px, expected {size[1]} x {size[0]} px")
    if width * height > MAX_PIXELS:
        raise ValueError(f"{path}: {width} x {height} px, at most {MAX_PIXELS} pixels are read")
    from PIL import Image

    try:
        with Image.open(path) as image:
            return np.asarray(image.convert(mode))
    except Exception as error:  # As above.
        raise ValueError(f"{path}: {reason_of(error)}") from None


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
    with path.open("rb") as file:
        content = file.read(MAX_MATRIX_BYTES + 1)
    if len(content) > MAX_MATRIX_BYTES:
        raise ValueError(f"{path}: over {MAX_MATRIX_BYTES} bytes, too long for a matrix of {shape}")
    try:
        numbers = np.array(content.decode(errors="replace").split(), np.float64)
    except ValueError as error:
        raise ValueError(f"{path}: {str(error)[:80]}") from None
    if numbers.size != shape[0] * shape[1]:
        raise ValueError(f"{path}: expected {shape[0]} x {shape[1]} numbers, got {numbers.size}")
    return numbers.reshape(shape)
