"""A map on the disk: a folder with its versions, a manifest, and the cameras as corrected."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from gslts.core.camera import Camera
from gslts.core.gaussian_map import GaussianMap
from gslts.io.atomic_files import naming, part_of, remove_tree, sync_folder
from gslts.io.ply import read_ply
from gslts.store.manifest import (
    CAMERAS,
    FORMAT,
    MANIFEST,
    VERSION,
    folder_of,
    picture_path,
    read_manifest,
    require_versions,
)
from gslts.store.map_store import MapStore

__all__ = [
    "CAMERAS",
    "MANIFEST",
    "camera_of",
    "folder_of",
    "open_map",
    "picture_path",
    "plain_camera",
    "read_manifest",
    "read_map",
    "write_map_folder",
]


def write_map_folder(
    folder: Path,
    gaussian_map: GaussianMap,
    manifest: Mapping[str, Any],
    cameras: Mapping[str, Camera],
    finish: Callable[[Path], None] = lambda _: None,
) -> None:
    """Writes a new folder with the first version of a map; it is there whole or not at all.

    Args:
        folder: Must not be there yet.
        gaussian_map: float32; its ids rise from Gaussian to Gaussian.
        manifest: What else is to be known, in values of JSON; format and version are added.
        cameras: By name of the frame.
        finish: Puts further files into the folder, before it appears.

    Raises:
        OSError: It cannot be written, or is there already.
        ValueError: Ids do not rise.
    """
    if folder.exists():
        raise FileExistsError(f"{folder} is there already")
    folder.parent.mkdir(parents=True, exist_ok=True)
    temporary = part_of(folder)
    temporary.mkdir()
    try:
        known = {"format": FORMAT, "version": VERSION, "gaussians": gaussian_map.size, **manifest}
        MapStore.create(temporary, gaussian_map, {"dataset": manifest.get("dataset")})
        _write_json(temporary / MANIFEST, known)
        _write_json(temporary / CAMERAS, {name: plain_camera(one) for name, one in cameras.items()})
        finish(temporary)
        sync_folder(temporary)
        temporary.rename(folder)
        sync_folder(folder.parent)
    except BaseException:
        remove_tree(temporary)
        raise


def read_map(path: Path) -> GaussianMap:
    """A map: the newest version of a folder, another one, or a PLY file of 3DGS.

    Args:
        path: The folder; with `@` and a number behind it, that version; or the file.

    Raises:
        OSError: A file cannot be read.
        ValueError: It is no map, or there is no such version.
    """
    folder, number = folder_of(path)
    if not folder.is_dir():
        return read_ply(path)
    read_manifest(folder)
    with MapStore(folder) as store:
        return store.read(number)


def open_map(path: Path, *, writable: bool = False) -> MapStore:
    """The versions of a map.

    Args:
        path: Its folder.
        writable: See `MapStore`.

    Raises:
        OSError: It cannot be read, or another process writes it.
        ValueError: It is no folder of a map.
    """
    require_versions(path)
    return MapStore(path, writable=writable)


def plain_camera(camera: Camera) -> dict[str, Any]:
    """Its numbers, in values of JSON."""
    return {
        **{name: getattr(camera, name) for name in ("fx", "fy", "cx", "cy", "width", "height")},
        "world_from_camera": camera.world_from_camera.tolist(),
    }


def camera_of(plain: Mapping[str, Any]) -> Camera:
    """The inverse of `plain_camera`.

    Raises:
        TypeError: A number is missing, or there is another one.
        ValueError: The camera is none.
    """
    pose = np.array(plain["world_from_camera"], np.float64)
    return Camera(**{**plain, "world_from_camera": pose})


def _write_json(path: Path, content: Any) -> None:
    with naming(path), path.open("w", encoding="utf-8") as file:
        json.dump(content, file, indent=1)
        file.write("\n")
        file.flush()
        os.fsync(file.fileno())
