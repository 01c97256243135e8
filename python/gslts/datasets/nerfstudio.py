"""nerfstudio's `transforms.json` (Tancik et al. 2023): poses in the axes of OpenGL.

Recordings of simulated homes also hold object labels: an image `instance_file_path` for each frame,
and `objects.json` with the types of the objects.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError

from gslts.datasets.dataset import (
    MAX_SIDE_PX,
    Dataset,
    gather,
    name_of,
    pinhole,
    resize_camera,
    rigid,
)
from gslts.datasets.files import MissingImageError, image_file, read_json
from gslts.datasets.image_frame import ImageFrame, with_unique_names
from gslts.datasets.poses import OPENGL_FROM_OPENCV
from gslts.datasets.undistort import Lens, lens_or_none
from gslts.io.image_files import image_size
from gslts.io.messages import first_problem

OBJECTS = "objects.json"
"""File with the types of the labelled objects."""
PERSPECTIVE = ("OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL")
"""Camera models of nerfstudio with Brown's distortion, or none."""
FISHEYE = "OPENCV_FISHEYE"
"""Camera model of Kannala and Brandt (2006)."""

Row = tuple[FiniteFloat, FiniteFloat, FiniteFloat, FiniteFloat]
Side = Annotated[int, Field(ge=0, le=MAX_SIDE_PX)]
Angle = Annotated[FiniteFloat, Field(strict=True, gt=1e-6, lt=math.pi)]
"""Field of view, rad; its bounds keep the tangent of the half finite and positive."""


class _Intrinsics(BaseModel):
    """Intrinsics, at the top of the file for all frames or at a frame."""

    model_config = ConfigDict(extra="ignore", frozen=True)

    w: Side | None = None
    h: Side | None = None
    fl_x: FiniteFloat | None = None
    fl_y: FiniteFloat | None = None
    cx: FiniteFloat | None = None
    cy: FiniteFloat | None = None
    camera_angle_x: Angle | None = None
    k1: FiniteFloat = 0.0
    k2: FiniteFloat = 0.0
    k3: FiniteFloat = 0.0
    k4: FiniteFloat = 0.0
    p1: FiniteFloat = 0.0
    p2: FiniteFloat = 0.0
    is_fisheye: bool = False


class _Frame(_Intrinsics):
    file_path: str
    depth_file_path: str | None = None
    instance_file_path: str | None = None
    mask_path: str | None = None
    transform_matrix: Annotated[list[Row], Field(min_length=3, max_length=4)] | None = None


class _Object(BaseModel):
    model_config = ConfigDict(extra="ignore", frozen=True)

    objectType: str  # noqa: N815


class _File(_Intrinsics):
    camera_model: str = "OPENCV"
    depth_unit_scale_factor: Annotated[FiniteFloat, Field(gt=0)] = 0.001
    frames: list[Any]


def is_nerfstudio(path: Path) -> bool:
    """Return True if a folder has a `transforms.json`.

    Args:
        path: Any path.
    """
    return (path / "transforms.json").exists()


def open_nerfstudio(path: Path) -> Dataset:
    """Open a data set.

    Args:
        path: Folder with `transforms.json`.

    Raises:
        OSError: The file cannot be read.
        ValueError: The file is damaged, or its lens model is not supported.
    """
    file = path / "transforms.json"
    content = read_json(file, _File)
    if content.camera_model not in (*PERSPECTIVE, FISHEYE):
        raise ValueError(f"{file}: camera_model {content.camera_model} is not supported")
    types = _types(path / OBJECTS)
    unposed: set[Path] = set()

    def make(entry: tuple[int, Any]) -> ImageFrame:
        number, values = entry
        try:
            frame = _Frame.model_validate({**_merge_shared(content), **_dict(values)})
        except ValidationError as error:
            raise ValueError(first_problem(error)) from None
        made = _image_frame(path, frame, content, number, types)
        if frame.transform_matrix is None:
            unposed.add(made.rgb)
        return made

    entries = ((f"frames[{entry[0]}]", entry) for entry in enumerate(content.frames))
    frames, skipped, missing = gather(entries, make)
    named = with_unique_names(frames, path)
    return Dataset(
        name_of(path),
        tuple(frame for frame in named if frame.rgb not in unposed),
        skipped,
        unposed=tuple(frame for frame in named if frame.rgb in unposed),
        missing=missing,
    )


def _image_frame(
    path: Path, frame: _Frame, content: _File, number: int, types: tuple[str, ...]
) -> ImageFrame:
    rgb = image_file(path, frame.file_path)
    width, height = (frame.w, frame.h) if frame.w and frame.h else image_size(rgb)
    fx = frame.fl_x
    if fx is None:
        if frame.camera_angle_x is None:
            raise ValueError(f"{rgb}: neither fl_x nor camera_angle_x is given")
        fx = width / 2 / float(np.tan(frame.camera_angle_x / 2))
    pose = np.eye(4)
    if frame.transform_matrix is not None:
        matrix = np.vstack([np.array(frame.transform_matrix)[:3], [0, 0, 0, 1]])
        pose = rigid(matrix @ OPENGL_FROM_OPENCV)
    intrinsics = (
        fx,
        fx if frame.fl_y is None else frame.fl_y,
        width / 2 if frame.cx is None else frame.cx,
        height / 2 if frame.cy is None else frame.cy,
    )
    camera = pinhole(intrinsics, (width, height), pose)
    depth = depth_camera = mask = None
    if frame.depth_file_path is not None:
        depth = image_file(path, frame.depth_file_path, "depth image")
        depth_size = image_size(depth)
        if depth_size != (width, height):
            depth_camera = resize_camera(camera, depth_size)
    if frame.mask_path is not None:
        mask = image_file(path, frame.mask_path, "mask")
    return ImageFrame(
        rgb,
        camera,
        depth,
        content.depth_unit_scale_factor,
        time_s=float(number),
        depth_camera=depth_camera,
        lens=_lens(frame, content.camera_model == FISHEYE or frame.is_fisheye),
        instances=_instances(path, frame) if types else None,
        types=types,
        mask=mask,
    )


def _instances(path: Path, frame: _Frame) -> Path | None:
    """Return the label image if it exists: frames can be used without it."""
    try:
        return image_file(path, frame.instance_file_path) if frame.instance_file_path else None
    except MissingImageError:
        return None


def _types(path: Path) -> tuple[str, ...]:
    """Read the types of the objects; none without such a file."""
    if not path.exists():
        return ()
    return tuple(item.objectType for item in read_json(path, list[_Object]))


def _lens(frame: _Frame, fisheye: bool) -> Lens | None:
    if fisheye:
        return lens_or_none((frame.k1, frame.k2, frame.k3, frame.k4), fisheye=True)
    if frame.k4:
        raise ValueError(f"k4: {frame.k4:g} is for fisheyes only")
    return lens_or_none((frame.k1, frame.k2, frame.p1, frame.p2, frame.k3))


def _merge_shared(content: _File) -> dict[str, Any]:
    """Return the intrinsics at the top of the file, for frames without their own."""
    return {name: getattr(content, name) for name in _Intrinsics.model_fields}


def _dict(entry: Any) -> dict[str, Any]:
    if not isinstance(entry, dict):
        raise ValueError(f"expected an object, got {json.dumps(entry)[:40]}")
    return entry
