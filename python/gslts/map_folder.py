"""A map on the disk: a folder with the Gaussians, a manifest, and the cameras as corrected."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from gslts.camera import Camera
from gslts.files import naming
from gslts.gaussian_map import GaussianMap
from gslts.ply import read_ply, write_ply

FORMAT, VERSION = "gslts-map", 1
PLY, MANIFEST, CAMERAS = "map.ply", "manifest.json", "cameras.json"
MAX_MANIFEST_BYTES = 16 << 20


def write_map_folder(
    folder: Path,
    gaussian_map: GaussianMap,
    manifest: Mapping[str, Any],
    cameras: Mapping[str, Camera],
    finish: Callable[[Path], None] = lambda _: None,
) -> None:
    """Writes a new folder, which is there whole or not at all.

    Args:
        folder: Must not be there yet.
        gaussian_map: float32.
        manifest: What else is to be known, in values of JSON; format and version are added.
        cameras: By name of the frame.
        finish: Puts further files into the folder, before it appears.

    Raises:
        OSError: It cannot be written, or is there already.
    """
    if folder.exists():
        raise FileExistsError(f"{folder} is there already")
    folder.parent.mkdir(parents=True, exist_ok=True)
    temporary = folder.with_name(f".{folder.name}.{os.getpid()}.part")
    temporary.mkdir()
    try:
        write_ply(gaussian_map, temporary / PLY)
        known = {"format": FORMAT, "version": VERSION, "gaussians": gaussian_map.size, **manifest}
        _write_json(temporary / MANIFEST, known)
        _write_json(temporary / CAMERAS, {name: plain_camera(one) for name, one in cameras.items()})
        finish(temporary)
        temporary.rename(folder)
    except BaseException:
        shutil.rmtree(temporary, ignore_errors=True)
        raise


def read_map_folder(folder: Path) -> tuple[GaussianMap, dict[str, Any]]:
    """The map and the manifest of a folder.

    Raises:
        OSError: A file cannot be read.
        ValueError: It is no map, or of another version.
    """
    path = folder / MANIFEST
    with path.open("rb") as file:
        content = file.read(MAX_MANIFEST_BYTES + 1)
    try:
        manifest = json.loads(content[:MAX_MANIFEST_BYTES])
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    if not isinstance(manifest, dict) or manifest.get("format") != FORMAT:
        raise ValueError(f"{path}: it is not the manifest of a map")
    if manifest.get("version") != VERSION:
        raise ValueError(
            f"{path}: version is {manifest.get('version')!r}, this gslts reads {VERSION}"
        )
    gaussian_map = read_ply(folder / PLY)
    if gaussian_map.size != manifest.get("gaussians"):
        raise ValueError(
            f"{folder}: {PLY} has {gaussian_map.size} Gaussians, the manifest says "
            f"{manifest.get('gaussians')!r}"
        )
    return gaussian_map, manifest


def read_map(path: Path) -> GaussianMap:
    """The map of a folder, or of a PLY file of 3DGS.

    Raises:
        OSError: A file cannot be read.
        ValueError: It is no map.
    """
    return read_map_folder(path)[0] if path.is_dir() else read_ply(path)


def ply_of(path: Path) -> Path:
    """The file with the Gaussians of what `read_map` takes."""
    return path / PLY if path.is_dir() else path


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
