"""Cameras from files: those of a map folder, one written by hand, a trajectory."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError

from gslts.core.camera import Camera, at_pose
from gslts.datasets.dataset import MAX_PIXELS, rigid
from gslts.datasets.tum import read_trajectory
from gslts.store.map_folder import CAMERAS, folder_of, open_map
from gslts.store.records import Version

MAX_BYTES = 1 << 28

Row = Annotated[list[FiniteFloat], Field(min_length=4, max_length=4)]


class _Lens(BaseModel):
    """All intrinsics, px."""

    model_config = ConfigDict(extra="ignore", frozen=True)

    fx: FiniteFloat
    fy: FiniteFloat
    cx: FiniteFloat
    cy: FiniteFloat
    width: Annotated[int, Field(ge=1, le=1 << 16)]
    height: Annotated[int, Field(ge=1, le=1 << 16)]


class _Pose(BaseModel):
    model_config = ConfigDict(extra="ignore", frozen=True)

    world_from_camera: Annotated[list[Row], Field(min_length=4, max_length=4)]


def read_cameras(path: Path, lens: Camera | None = None) -> dict[str, Camera]:
    """Cameras by name, from a file like the `cameras.json` of a map folder.

    Args:
        path: An object of JSON with an object for each camera: world_from_camera [4,4], and fx, fy,
            cx, cy, width and height in px.
        lens: Whose intrinsics an object without any takes.

    Raises:
        OSError: The file cannot be read.
        ValueError: It is damaged, or a camera is none; the message names both.
    """
    return {
        name: _camera(entry, lens, f"{path}: {name!r}") for name, entry in _object(path).items()
    }


def cameras_of_map(path: Path) -> dict[str, Camera]:
    """Where a map was made and updated from, by name of the frame; none for a PLY file.

    Frames of updates count where they look from elsewhere than all before.

    Args:
        path: As `gslts.store.map_folder.read_map` takes it.

    Raises:
        OSError: The file cannot be read.
        ValueError: It is damaged.
    """
    folder, number = folder_of(path)
    if not folder.is_dir():
        return {}
    cameras = read_cameras(folder / CAMERAS)
    with open_map(folder) as store:
        way = store.way_to(number)
    for version in way:
        cameras |= cameras_of_update(version)
    return cameras


def cameras_of_update(version: Version) -> dict[str, Camera]:
    """The cameras of the frames that led to a version, but for those of older viewpoints, by name.

    Raises:
        ValueError: They are damaged.
    """
    cameras = {}
    for k, entry in enumerate(version.cause.get("frames", ())):
        if not (isinstance(entry, dict) and entry.get("new_viewpoint") is False):
            name = f"version {version.number}/{k}"
            cameras[name] = _camera(entry, None, name)
    return cameras


def read_camera(path: Path, lens: Camera | None = None) -> Camera:
    """The one camera of a file, an object of JSON like one of those of `read_cameras`."""
    return _camera(_object(path), lens, str(path))


def read_lens(path: Path) -> Camera:
    """As `read_camera`, of a file that need not tell a pose: the camera is at the origin then."""
    return _camera({"world_from_camera": np.eye(4).tolist(), **_object(path)}, None, str(path))


def read_path(path: Path, lens: Camera | None = None) -> list[Camera]:
    """Cameras one after the other.

    Args:
        path: Either a file like those of `read_cameras`, ending in .json, or lines of text in the
            format of TUM RGB-D: time tx ty tz qx qy qz qw, of world_from_camera.
        lens: Whose intrinsics poses without any take.

    Raises:
        OSError: The file cannot be read.
        ValueError: It is damaged or holds no camera.
    """
    if path.suffix.lower() == ".json":
        cameras = list(read_cameras(path, lens).values())
    else:
        poses = read_trajectory(path)
        if lens is None and poses:
            raise ValueError(f"{path}: a trajectory has no intrinsics")
        cameras = [at_pose(lens, pose) for pose in poses] if lens is not None else []
    if not cameras:
        raise ValueError(f"{path}: there is no camera in it")
    return cameras


def _object(path: Path) -> dict[str, Any]:
    with path.open("rb") as file:
        content = file.read(MAX_BYTES + 1)
    if len(content) > MAX_BYTES:
        raise ValueError(f"{path}: larger than {MAX_BYTES >> 20} MiB")
    try:
        value = json.loads(content)
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{path}: {error}") from None
    if not isinstance(value, dict):
        raise ValueError(f"{path}: expected an object of JSON")
    return value


def _camera(entry: Any, lens: Camera | None, where: str) -> Camera:
    try:
        pose = rigid(np.array(_Pose.model_validate(entry).world_from_camera))
        if lens is not None and isinstance(entry, dict) and not entry.keys() & _Lens.model_fields:
            return at_pose(lens, pose)
        known = _Lens.model_validate(entry)
        if known.width * known.height > MAX_PIXELS:
            raise ValueError(f"{known.width} x {known.height} px are more than {MAX_PIXELS}")
        return Camera(**known.model_dump(), world_from_camera=pose)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = ".".join(map(str, first["loc"])) or "it"
        raise ValueError(f"{where}: {place}: {first['msg']}") from None
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from None
