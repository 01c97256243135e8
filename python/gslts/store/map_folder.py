"""A map on disk: a folder of versions, a manifest, and the refined cameras of mapping."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from gslts.core.camera import Camera
from gslts.core.gaussian_map import GaussianMap
from gslts.io.atomic_files import name_in_errors, remove_tree, sync_folder, temporary_path
from gslts.io.map_files import read_map_file
from gslts.store.causes import ImportCause, MappingCause
from gslts.store.manifest import (
    CAMERAS,
    FORMAT,
    FORMAT_VERSION,
    MANIFEST,
    require_map_folder,
    split_version,
)
from gslts.store.map_store import MapStore
from gslts.store.records import NO_UPDATES, Updates

INTRINSICS = ("fx", "fy", "cx", "cy", "width", "height")
"""Fields of a camera in JSON, besides its pose."""


def write_map_folder(
    folder: Path,
    gaussian_map: GaussianMap,
    manifest: Mapping[str, Any],
    cameras: Mapping[str, Camera],
    finish: Callable[[Path], Mapping[str, Any]] = lambda _: {},
    *,
    cause: MappingCause | ImportCause | None = None,
) -> None:
    """Write a new folder with the first version of a map. It appears complete or not at all.

    Args:
        folder: Must not exist.
        gaussian_map: float32, with rising ids.
        manifest: JSON values; format and version are added.
        cameras: Cameras of the frames, by name.
        finish: Writes further files into the temporary folder that it gets, and returns what the
            manifest says of them.
        cause: Of the first version; None means mapping of the manifest's `dataset`.

    Raises:
        OSError: The folder exists or cannot be written.
        ValueError: The ids do not rise.
    """
    if folder.exists():
        raise FileExistsError(f"{folder} exists already")
    if cause is None:
        cause = MappingCause(dataset=manifest.get("dataset"))
    head = {"format": FORMAT, "version": FORMAT_VERSION, "gaussians": gaussian_map.size}
    folder.parent.mkdir(parents=True, exist_ok=True)
    temporary = temporary_path(folder)
    with name_in_errors(folder, temporary):
        temporary.mkdir()
    try:
        MapStore.create(temporary, gaussian_map, cause)
        records = {name: camera_to_json(camera) for name, camera in cameras.items()}
        _write_json(temporary / CAMERAS, records)
        _write_json(temporary / MANIFEST, {**head, **manifest, **finish(temporary)})
        sync_folder(temporary)
        temporary.rename(folder)
        sync_folder(folder.parent)
    except BaseException:
        remove_tree(temporary)
        raise


def read_map(path: Path | str) -> GaussianMap:
    """Read a map.

    Args:
        path: Folder of a map for its newest version, `FOLDER@NUMBER` for another one, or a .ply,
            .glb or .spz file of 3DGS.

    Returns:
        The map.

    Raises:
        OSError: A file cannot be read.
        ValueError: The path is no map, or there is no such version.
    """
    folder, number = split_version(Path(path))
    if not folder.is_dir():
        return read_map_file(Path(path))
    with open_map(folder) as store:
        return store.read(number)


def updates_of_map(path: Path | str) -> Updates:
    """Return what the updates of a map changed; see `History.updates`.

    Args:
        path: As for `read_map`.

    Returns:
        The updates; none for a file of 3DGS.

    Raises:
        OSError: A file cannot be read.
        ValueError: The path is no map, or there is no such version.
    """
    folder, number = split_version(Path(path))
    if not folder.is_dir():
        return NO_UPDATES
    with open_map(folder) as store:
        return store.updates(number)


def open_map(path: Path | str, *, writable: bool = False) -> MapStore:
    """Open the versions of a map.

    Args:
        path: Folder of the map.
        writable: Allow new versions; one process at a time can.

    Returns:
        The store, a context manager.

    Raises:
        OSError: The folder cannot be read, or another process writes it.
        ValueError: The path is no folder of a map.
    """
    path = Path(path)
    require_map_folder(path)
    return MapStore(path, writable=writable)


def camera_to_json(camera: Camera) -> dict[str, Any]:
    """Convert a camera to JSON values.

    Args:
        camera: Any camera.

    Returns:
        Intrinsics in px, and `world_from_camera` as 4 rows, m.
    """
    return {
        **{name: getattr(camera, name) for name in INTRINSICS},
        "world_from_camera": camera.world_from_camera.tolist(),
    }


def camera_from_json(record: Mapping[str, Any]) -> Camera:
    """Convert a camera from the JSON values of `camera_to_json`.

    Args:
        record: From a file that gslts wrote.

    Returns:
        The camera.

    Raises:
        TypeError: A field is missing or unknown.
        ValueError: A value is invalid.
    """
    pose = np.array(record["world_from_camera"], np.float64)
    return Camera(**{**record, "world_from_camera": pose})


def _write_json(path: Path, content: Any) -> None:
    with name_in_errors(path), path.open("w", encoding="utf-8") as file:
        json.dump(content, file, indent=1)
        file.write("\n")
        file.flush()
        os.fsync(file.fileno())
