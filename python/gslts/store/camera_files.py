"""Cameras from files: those of a map folder, hand-written JSON, and trajectories."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError

from gslts.core.camera import Camera, TrainingCamera, at_pose, new_viewpoints
from gslts.datasets.dataset import MAX_SIDE_PX, rigid
from gslts.datasets.tum import read_trajectory
from gslts.io.bounded_files import read_bounded
from gslts.io.image_files import MAX_PIXELS
from gslts.io.messages import first_problem
from gslts.store.causes import UpdateFrame, ViewsCause
from gslts.store.history import History
from gslts.store.manifest import CAMERAS, split_version
from gslts.store.map_folder import camera_to_json, open_map
from gslts.store.records import Version

MAX_BYTES = 1 << 28
"""Bounds the memory for a hostile file: 256 MiB hold the cameras of 500,000 frames."""

Row = Annotated[list[FiniteFloat], Field(min_length=4, max_length=4)]


class _Intrinsics(BaseModel):
    """All intrinsics, px. Files of other programs may hold more fields."""

    model_config = ConfigDict(extra="ignore", frozen=True)

    fx: FiniteFloat
    fy: FiniteFloat
    cx: FiniteFloat
    cy: FiniteFloat
    width: Annotated[int, Field(ge=1, le=MAX_SIDE_PX)]
    height: Annotated[int, Field(ge=1, le=MAX_SIDE_PX)]


class _Pose(BaseModel):
    model_config = ConfigDict(extra="ignore", frozen=True)

    world_from_camera: Annotated[list[Row], Field(min_length=4, max_length=4)]


def read_cameras(path: Path, intrinsics: Camera | None = None) -> dict[str, Camera]:
    """Read cameras by name, from a file like `cameras.json` of a map folder.

    Args:
        path: JSON object with one object per camera: `world_from_camera` [4,4] in m, and fx, fy,
            cx, cy, width and height in px.
        intrinsics: Camera whose intrinsics are used for an object without any.

    Returns:
        The cameras by name.

    Raises:
        OSError: The file cannot be read.
        ValueError: The file is damaged or a camera is invalid; the message names both.
    """
    return {
        name: _parse_camera(record, intrinsics, f"{path}: {name!r}")
        for name, record in _read_object(path).items()
    }


def cameras_of_map(path: Path) -> dict[str, Camera]:
    """Read the training cameras of a version of a map, by name of the frame.

    Args:
        path: Folder of a map, `FOLDER@NUMBER`, or a PLY file.

    Returns:
        Cameras of mapping, and of later views where the viewpoint was new. Empty for a
        PLY file.

    Raises:
        OSError: A file cannot be read.
        ValueError: A file is damaged.
    """
    folder, number = split_version(path)
    if not folder.is_dir():
        return {}
    with open_map(folder) as store:
        return cameras_of_store(store, number)


def cameras_of_store(store: History, number: int | None = None) -> dict[str, Camera]:
    """Read the training cameras of a version of an open map; see `cameras_of_map`.

    Args:
        store: History of the map.
        number: Of the version; None means the newest.
    """
    lineage = store.lineage(number)
    first_id = lineage[0].next_id
    cameras: dict[str, Camera] = {
        name: TrainingCamera(camera, first_id)
        for name, camera in read_cameras(store.folder / CAMERAS).items()
    }
    for version in lineage:
        cameras |= cameras_of_version(version)
    return cameras


def cameras_of_version(version: Version) -> dict[str, Camera]:
    """Return the cameras with a new viewpoint of the views that led to a version.

    Args:
        version: Of any kind.

    Returns:
        The cameras by name; empty if no views led to it.

    Raises:
        ValueError: A pose is not rigid.
    """
    if not isinstance(version.cause, ViewsCause):
        return {}
    names = {f"version {version.number}/{k}": f for k, f in enumerate(version.cause.frames)}
    return {
        name: TrainingCamera(_parse_camera(frame.model_dump(), None, name), version.next_id)
        for name, frame in names.items()
        if frame.new_viewpoint
    }


def frame_records(known: Iterable[Camera], cameras: Sequence[Camera]) -> tuple[UpdateFrame, ...]:
    """Return the records of the cameras of new views, for the cause of a version.

    Args:
        known: Training cameras of the map so far.
        cameras: Of the views.
    """
    return tuple(
        UpdateFrame(**camera_to_json(camera), new_viewpoint=new)
        for camera, new in zip(cameras, new_viewpoints(known, cameras), strict=True)
    )


def read_camera(path: Path, intrinsics: Camera | None = None) -> Camera:
    """Read a file of one camera, a JSON object as in `read_cameras`.

    Args:
        path: The file.
        intrinsics: Camera whose intrinsics are used if the file has none.

    Returns:
        The camera.

    Raises:
        OSError: The file cannot be read.
        ValueError: The file is damaged or the camera is invalid.
    """
    return _parse_camera(_read_object(path), intrinsics, str(path))


def read_intrinsics(path: Path) -> Camera:
    """Read a file of one camera that may lack a pose.

    Args:
        path: JSON object as in `read_cameras`.

    Returns:
        The camera; without a pose in the file it is at the origin of the world.

    Raises:
        OSError: The file cannot be read.
        ValueError: The file is damaged or the camera is invalid.
    """
    record = {"world_from_camera": np.eye(4).tolist(), **_read_object(path)}
    return _parse_camera(record, None, str(path))


def read_camera_path(path: Path, intrinsics: Camera | None = None) -> list[Camera]:
    """Read a sequence of cameras.

    Args:
        path: A .json file as in `read_cameras`, or lines of text in the format of TUM RGB-D: time
            tx ty tz qx qy qz qw of world_from_camera.
        intrinsics: Camera whose intrinsics are used for poses without any.

    Returns:
        The cameras in the order of the file.

    Raises:
        OSError: The file cannot be read.
        ValueError: The file is damaged or holds no camera.
    """
    if path.suffix.lower() == ".json":
        cameras = list(read_cameras(path, intrinsics).values())
    else:
        poses = read_trajectory(path)
        if intrinsics is None and poses:
            raise ValueError(f"{path}: a trajectory has no intrinsics")
        cameras = [] if intrinsics is None else [at_pose(intrinsics, pose) for pose in poses]
    if not cameras:
        raise ValueError(f"{path}: it holds no camera")
    return cameras


def _read_object(path: Path) -> dict[str, Any]:
    content = read_bounded(path, MAX_BYTES)
    try:
        value = json.loads(content)
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{path}: {error}") from None
    if not isinstance(value, dict):
        raise ValueError(f"{path}: expected a JSON object")
    return value


def _parse_camera(record: Any, intrinsics: Camera | None, where: str) -> Camera:
    try:
        pose = rigid(np.array(_Pose.model_validate(record).world_from_camera))
        if intrinsics is not None and not record.keys() & _Intrinsics.model_fields:
            return at_pose(intrinsics, pose)
        known = _Intrinsics.model_validate(record)
        if known.width * known.height > MAX_PIXELS:
            raise ValueError(f"{known.width} x {known.height} px are more than {MAX_PIXELS}")
        return Camera(**known.model_dump(), world_from_camera=pose)
    except ValidationError as error:
        raise ValueError(f"{where}: {first_problem(error)}") from None
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from None
