"""COLMAP (Schönberger and Frahm 2016): sparse models with their images."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from gslts.datasets.colmap_files import (
    ColmapCamera,
    ColmapImage,
    read_cameras,
    read_images,
    read_points,
)
from gslts.datasets.dataset import Dataset, gather, name_of, pinhole
from gslts.datasets.files import image_file
from gslts.datasets.image_frame import ImageFrame, with_unique_names
from gslts.datasets.poses import inverse, pose_from_quat
from gslts.datasets.undistort import Lens, lens_or_none

Numbers = tuple[float, ...]


INTRINSICS: dict[str, Callable[[Numbers], tuple[Numbers, Lens | None]]] = {
    "SIMPLE_PINHOLE": lambda p: ((p[0], p[0], *p[1:3]), None),
    "PINHOLE": lambda p: (p, None),
    "SIMPLE_RADIAL": lambda p: ((p[0], p[0], *p[1:3]), lens_or_none((p[3], 0, 0, 0))),
    "RADIAL": lambda p: ((p[0], p[0], *p[1:3]), lens_or_none((*p[3:5], 0, 0))),
    "OPENCV": lambda p: (p[:4], lens_or_none(p[4:])),
    "OPENCV_FISHEYE": lambda p: (p[:4], lens_or_none(p[4:], fisheye=True)),
    "FULL_OPENCV": lambda p: (p[:4], lens_or_none(p[4:])),
}
"""(fx, fy, cx, cy) and the lens from the parameters of each supported camera model. As in this
project, the centre of COLMAP's first pixel is (0.5, 0.5)."""


def is_colmap(path: Path) -> bool:
    """Return True if a folder has a sparse model.

    Args:
        path: Any path.
    """
    return _model_folder(path) is not None


def open_colmap(path: Path) -> Dataset:
    """Open a sparse model and its images.

    The world frame is that of the model: unless the model was scaled and rotated, its unit is not
    the metre and z is not up.

    Args:
        path: Folder with the model, and with the images in `images` or directly in it.

    Raises:
        OSError: A file cannot be read.
        ValueError: A file is damaged.
    """
    folder = _model_folder(path)
    if folder is None:
        raise ValueError(f"{path}: there is no sparse model")
    cameras = read_cameras(_file(folder, "cameras"))
    images = sorted(read_images(_file(folder, "images")), key=lambda image: image.name)
    frames, skipped, missing = gather(
        ((image.name, (image, float(number))) for number, image in enumerate(images)),
        lambda entry: _frame(path, entry[0], cameras, entry[1]),
    )
    points = _file(folder, "points3D")
    return Dataset(
        name_of(path),
        with_unique_names(frames, path),
        skipped,
        read_points(points) if points.exists() else None,
        missing=missing,
    )


def _model_folder(path: Path) -> Path | None:
    for name in ("sparse/0", "sparse", "."):
        folder = path / name
        if all(_file(folder, part).exists() for part in ("cameras", "images")):
            return folder
    return None


def _file(folder: Path, part: str) -> Path:
    """Return the file of a part of the model: the binary one if it exists, as COLMAP does."""
    binary = folder / f"{part}.bin"
    return binary if binary.exists() else folder / f"{part}.txt"


def _frame(
    path: Path, image: ColmapImage, cameras: dict[int, ColmapCamera], time_s: float
) -> ImageFrame:
    if image.camera not in cameras:
        raise ValueError(f"there is no camera {image.camera}")
    in_images = (path / "images" / image.name).is_file()
    rgb = image_file(path / "images" if in_images else path, image.name)
    intrinsics, lens = _intrinsics(cameras[image.camera])
    size = (cameras[image.camera].width, cameras[image.camera].height)
    pose = inverse(pose_from_quat(image.quaternion, image.translation))
    return ImageFrame(rgb, pinhole(intrinsics, size, pose), time_s=time_s, lens=lens)


def _intrinsics(camera: ColmapCamera) -> tuple[Numbers, Lens | None]:
    if camera.model not in INTRINSICS:
        raise ValueError(f"the camera model {camera.model[:40]} is not supported")
    return INTRINSICS[camera.model](camera.parameters)
