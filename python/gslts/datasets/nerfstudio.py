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
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, TypeAdapter, ValidationError

from gslts.datasets.dataset import (
    MAX_LIST_BYTES,
    MAX_SIDE_PX,
    Dataset,
    ImageFrame,
    image_size,
    name_of,
    pinhole,
    rigid,
    with_unique_names,
)
from gslts.datasets.undistort import Lens, lens_or_none

OPENGL_FROM_OPENCV = np.diag([1.0, -1.0, -1.0, 1.0])
"""[4,4] change of camera axes: y and z point the other way."""
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


class _Frame(_Intrinsics):
    file_path: str
    depth_file_path: str | None = None
    instance_file_path: str | None = None
    transform_matrix: Annotated[list[Row], Field(min_length=3, max_length=4)] | None = None


class _Object(BaseModel):
    model_config = ConfigDict(extra="ignore", frozen=True)

    objectType: str  # noqa: N815


_OBJECTS = TypeAdapter(list[_Object])
"""Parser of `objects.json`."""


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
    if file.stat().st_size > MAX_LIST_BYTES:
        raise ValueError(f"{file}: larger than {MAX_LIST_BYTES >> 20} MiB")
    try:
        content = _File.model_validate_json(file.read_bytes())
    except ValidationError as error:
        raise ValueError(f"{file}: {_first(error)}") from None
    if content.camera_model not in (*PERSPECTIVE, FISHEYE):
        raise ValueError(f"{file}: camera_model {content.camera_model} is not supported")
    frames: list[ImageFrame] = []
    unposed: set[Path] = set()
    skipped: list[str] = []
    types = _types(path / OBJECTS)
    for number, entry in enumerate(content.frames):
        try:
            frame = _Frame.model_validate({**_merge_shared(content), **_dict(entry)})
            frames.append(_image_frame(path, frame, content, number, types))
            if frame.transform_matrix is None:
                unposed.add(frames[-1].rgb)
        except ValidationError as error:
            skipped.append(f"frames[{number}]: {_first(error)}")
        except (OSError, ValueError) as error:
            skipped.append(f"frames[{number}]: {error}")
    named = with_unique_names(frames, path)
    return Dataset(
        name_of(path),
        tuple(frame for frame in named if frame.rgb not in unposed),
        tuple(skipped),
        unposed=tuple(frame for frame in named if frame.rgb in unposed),
    )


def _image_frame(
    path: Path, frame: _Frame, content: _File, number: int, types: tuple[str, ...]
) -> ImageFrame:
    rgb = path / frame.file_path
    if not rgb.name:
        raise ValueError(f"file_path: {frame.file_path!r} is not a file")
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
    depth = None if frame.depth_file_path is None else path / frame.depth_file_path
    return ImageFrame(
        rgb,
        camera,
        depth,
        content.depth_unit_scale_factor,
        time_s=float(number),
        lens=_lens(frame, content.camera_model == FISHEYE),
        instances=_instances(path, frame) if types else None,
        types=types,
    )


def _instances(path: Path, frame: _Frame) -> Path | None:
    """Return the label image if it exists: frames can be used without it."""
    name = frame.instance_file_path
    return path / name if name and (path / name).exists() else None


def _types(path: Path) -> tuple[str, ...]:
    """Read the types of the objects; none without such a file."""
    if not path.exists():
        return ()
    if path.stat().st_size > MAX_LIST_BYTES:
        raise ValueError(f"{path}: larger than {MAX_LIST_BYTES >> 20} MiB")
    try:
        return tuple(item.objectType for item in _OBJECTS.validate_json(path.read_bytes()))
    except ValidationError as error:
        raise ValueError(f"{path}: {_first(error)}") from None


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


def _first(error: ValidationError) -> str:
    first = error.errors(include_url=False)[0]
    where = ".".join(str(part) for part in first["loc"])
    value = first["input"]
    if not where or not isinstance(value, str | int | float):  # Others may be as long as the file.
        return f"{where or 'file'}: {first['msg']}"
    return f"{where}: {first['msg']}, got {value!r:.40}"
