"""Poses of photographs without depth: structure from motion by COLMAP."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from gslts.datasets import FORMATS, Dataset
from gslts.datasets.colmap import open_colmap
from gslts.datasets.poses import inverse
from gslts.io.atomic_files import remove_tree, temporary_path
from gslts.io.image_files import MAX_PIXELS, image_size
from gslts.trajectory.upright import upright_world
from gslts.types import Floats

SUFFIXES = (".jpg", ".jpeg", ".png")
"""Endings of the names of photographs."""
MIN_PHOTOGRAPHS = 4
"""Minimum number of photographs that are placed together, as a map needs."""
MIN_POINTS = 50
"""Minimum number of points that a photograph shares with others: those with right poses share 100
and more in a real room and in simulated ones, wrong ones are held by some 20 to 40."""
EXHAUSTIVE = 200
"""Maximum number of photographs of which all pairs are matched; of more, each is matched with those
taken shortly before and after it."""
TYPICAL_DEPTH_M = 2.0
"""Median distance of points from the camera, m, to which a model is scaled: photographs do not tell
the scale, and settings of the mapping are for rooms."""


@dataclass(frozen=True, eq=False)
class PlacedPhotographs:
    """Photographs with estimated poses and lenses.

    Attributes:
        dataset: Those that were placed. The world has z up; its scale is a guess.
        unplaced: The other photographs, and why.
    """

    dataset: Dataset
    unplaced: tuple[str, ...]


def is_photographs(path: Path) -> bool:
    """Return True if a path is a folder with photographs, and no data set of a known format.

    Args:
        path: Any path.
    """
    if not path.is_dir() or any(matches(path) for matches, _ in FORMATS.values()):
        return False
    return len(_images(path)) >= MIN_PHOTOGRAPHS


def place_photographs(
    path: Path, out: Path, every: int = 1, report: Callable[[str], None] = lambda _: None
) -> PlacedPhotographs:
    """Estimate poses, focal length and distortion of photographs, and write them as a data set.

    Args:
        path: Folder with the photographs, in the order of their names.
        out: New folder of the data set: a sparse model of COLMAP, and a link to the photographs.
        every: Use every n-th photograph.
        report: Called with the name of each stage.

    Raises:
        ImportError: pycolmap is missing.
        OSError: A file cannot be read or written.
        ValueError: Too few photographs show the same place.

    Source: Schönberger and Frahm 2016.
    """
    try:
        import pycolmap
    except ImportError as error:
        raise ImportError("photographs need pycolmap: pip install 'gslts[photos]'") from error
    pycolmap.logging.minloglevel = pycolmap.logging.FATAL.value
    names, unplaced = _usable(_images(path)[::every])
    with TemporaryDirectory() as folder:
        models = _reconstruct(pycolmap, path, names, Path(folder), report)
        model = max(models, key=lambda found: found.num_reg_images(), default=None)
        placed = set() if model is None else _keep_sure(model)
        if model is None or len(placed) < MIN_PHOTOGRAPHS:
            raise ValueError(
                f"{path}: {len(placed)} of {len(names)} photographs show the same place, "
                f"{MIN_PHOTOGRAPHS} are needed: take more of them, each with most of what the one "
                "before showed, from different places"
            )
        model.transform(_to_world(pycolmap, model))
        _write_dataset(model, path, out)
    unplaced += [
        f"{name}: fewer than {MIN_POINTS} of its points are in other photographs"
        for name in names
        if name not in placed
    ]
    return PlacedPhotographs(open_colmap(out), tuple(unplaced))


def _images(path: Path) -> list[Path]:
    return sorted(file for file in path.iterdir() if file.suffix.lower() in SUFFIXES)


def _usable(files: Sequence[Path]) -> tuple[list[str], list[str]]:
    """Return the names of the photographs that can be read, and the others with the reason."""
    names, unusable = [], []
    for file in files:
        try:
            width, height = image_size(file)
            if width * height > MAX_PIXELS:
                raise ValueError(f"{width} x {height} px are more than {MAX_PIXELS}")
            names.append(file.name)
        except (OSError, ValueError) as error:
            unusable.append(f"{file.name}: {error}")
    return names, unusable


def _reconstruct(
    pycolmap: Any, path: Path, names: list[str], folder: Path, report: Callable[[str], None]
) -> list[Any]:
    """Return the models that COLMAP finds."""
    sizes = {image_size(path / name) for name in names}
    mode = pycolmap.CameraMode.SINGLE if len(sizes) == 1 else pycolmap.CameraMode.AUTO
    database, cpu = folder / "database.db", pycolmap.Device.cpu
    report("finding keypoints")
    pycolmap.extract_features(database, path, image_names=names, camera_mode=mode, device=cpu)
    report("matching")
    match = pycolmap.match_exhaustive if len(names) <= EXHAUSTIVE else pycolmap.match_sequential
    match(database, device=cpu)
    (folder / "models").mkdir()
    report("placing")
    return list(pycolmap.incremental_mapping(database, path, folder / "models").values())


def _write_dataset(model: Any, photographs: Path, out: Path) -> None:
    """Write a model and a link to its photographs; the folder appears whole or not at all."""
    part = temporary_path(out)
    try:
        (part / "sparse").mkdir(parents=True)
        model.write_text(part / "sparse")
        (part / "images").symlink_to(photographs.resolve())
        part.rename(out)
    except BaseException:
        remove_tree(part)
        raise


def _keep_sure(model: Any) -> set[str]:
    """Remove the photographs from a model that hold to it by few points; return the others."""
    unsure = [image for image in model.images.values() if image.num_points3D < MIN_POINTS]
    for frame in {image.frame_id for image in unsure}:
        model.deregister_frame(frame)
    return {image.name for image in model.images.values() if image.has_pose}


def _to_world(pycolmap: Any, model: Any) -> Any:
    """Return the similarity to a world with z up and a typical scale."""
    cameras, depths = [], []
    points = {key: point.xyz for key, point in model.points3D.items()}
    for image in model.images.values():
        if not image.has_pose:
            continue
        world_from_camera = inverse(_matrix(image.cam_from_world()))
        cameras.append(world_from_camera)
        seen = [p.point3D_id for p in image.points2D if p.has_point3D()]
        offsets = np.array([points[key] for key in seen]).reshape(-1, 3) - world_from_camera[:3, 3]
        depths.append(offsets @ world_from_camera[:3, 2])
    scale = TYPICAL_DEPTH_M / float(np.median(np.concatenate(depths)))
    scaled = np.array(cameras)
    scaled[:, :3, 3] *= scale
    world = upright_world(scaled, np.zeros((0, 3)))  # Points are too sparse for normals.
    return pycolmap.Sim3d(scale, pycolmap.Rotation3d(world[:3, :3]), world[:3, 3])


def _matrix(rigid: Any) -> Floats:
    motion = np.eye(4)
    motion[:3] = rigid.matrix()
    return motion
