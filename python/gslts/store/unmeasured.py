"""Unmeasured Gaussians: those of a map that no depth of its recording confirms.

Behind windows, in black skies and on dark surfaces a sensor measures nothing, and mapping puts
Gaussians anywhere along the ray. Ids are never used again, so that one list serves all versions;
what an update adds was measured.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load, save

from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.io.atomic_files import name_in_errors, sync_folder, write_atomic
from gslts.store.manifest import read_manifest, split_version
from gslts.types import Bools, Floats, Indices, Ints, UInts64

FILE, KEY = "unmeasured.safetensors", "unmeasured"
"""Name of the file in a map folder; key of its SHA-256 in the manifest, and of its array."""
NO_IDS: UInts64 = np.zeros(0, np.uint64)
"""Ids of a map of which nothing is known."""
MAX_BYTES = 1 << 30
"""Bounds the memory for a hostile file; 100 million ids take less."""
REPAIR = "copy it from a backup, or make the map again with gslts map"
"""Next step for error messages about a missing or damaged file."""
SURFACE_MARGIN_M, SURFACE_MARGIN_SHARE = 0.03, 0.02
"""A point within so many m, plus so much of its depth, of a surface is on it."""
MIN_CONFIRMED_SHARE = 0.5
"""Minimum share of the depths measured at a Gaussian, or behind it, that are at it."""


def surface_margin_m(depth_m: Floats) -> Floats:
    """Return how far a point may be from a surface that it is on.

    Args:
        depth_m: [...] depths of the points in a camera, m.

    Returns:
        [...] distances along the depth, m.
    """
    return SURFACE_MARGIN_M + SURFACE_MARGIN_SHARE * depth_m


def unmeasured_gaussians(gaussian_map: GaussianMap, frames: Iterable[RgbdFrame]) -> UInts64:
    """Find the Gaussians whose centres the depths of the frames do not confirm.

    Args:
        gaussian_map: Map of the frames.
        frames: At their poses in the map.

    Returns:
        [U] their ids, rising; none if no frame has a depth.
    """
    confirmed, passed = count_measurements(gaussian_map, frames)
    if not confirmed.any():
        return NO_IDS
    is_measured: Bools = confirmed >= np.maximum(1, MIN_CONFIRMED_SHARE * (confirmed + passed))
    return np.sort(gaussian_map.ids[~is_measured])


def count_measurements(gaussian_map: GaussianMap, frames: Iterable[RgbdFrame]) -> tuple[Ints, Ints]:
    """Count the frames that measured a surface at each Gaussian, and behind it.

    Args:
        gaussian_map: Map of the frames.
        frames: At their poses in the map.

    Returns:
        [N] each.
    """
    confirmed, passed = np.zeros((2, gaussian_map.size), np.int64)
    for frame in frames:
        registered = frame.registered()
        rows, depths_m, measured_m = _measurements(gaussian_map, registered)
        margins_m = surface_margin_m(depths_m)
        confirmed[rows] += np.abs(measured_m - depths_m) <= margins_m
        passed[rows] += measured_m > depths_m + margins_m
    return confirmed, passed


def _measurements(gaussian_map: GaussianMap, frame: RgbdFrame) -> tuple[Indices, Floats, Floats]:
    """Return the rows of Gaussians at whose pixel a depth is measured, their depths and it, m."""
    camera = frame.camera
    camera_from_world = np.linalg.inv(camera.world_from_camera)
    offset = camera_from_world[:3, :3] @ gaussian_map.origin + camera_from_world[:3, 3]
    x, y, z = (gaussian_map.means @ camera_from_world[:3, :3].T + offset).T
    ahead = np.maximum(z, 1e-9)
    u, v = camera.fx * x / ahead + camera.cx, camera.fy * y / ahead + camera.cy
    inside = (z > 0) & (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height)
    rows = np.flatnonzero(inside)
    depth = np.nan_to_num(frame.depth)[v[rows].astype(np.intp), u[rows].astype(np.intp)]
    rows, depth = rows[depth > 0], depth[depth > 0]
    return rows, z[rows].astype(np.float64), depth.astype(np.float64)


def write_unmeasured(ids: UInts64, folder: Path) -> str:
    """Write ids into a map folder, durable after a power loss.

    Args:
        ids: [U] of unmeasured Gaussians.
        folder: Map folder.

    Returns:
        SHA-256 of the file, for the manifest.

    Raises:
        OSError: The file cannot be written.
    """
    content = save({KEY: np.ascontiguousarray(ids)})
    write_atomic(folder / FILE, content)
    sync_folder(folder)
    return hashlib.sha256(content).hexdigest()


def read_unmeasured(path: Path) -> UInts64:
    """Read the ids of the unmeasured Gaussians of a map.

    Args:
        path: Map folder, a version of it such as MAP@3, or a PLY file.

    Returns:
        [U] ids, of which a version may lack some; none for a PLY file or an imported map.

    Raises:
        OSError: The file cannot be read.
        ValueError: The file is damaged.
    """
    folder, _ = split_version(path)
    digest = read_manifest(folder).get(KEY) if folder.is_dir() else None
    if digest is None:
        return NO_IDS
    file = folder / FILE
    try:
        with name_in_errors(file), file.open("rb") as opened:
            content = opened.read(MAX_BYTES + 1)
    except FileNotFoundError:
        raise FileNotFoundError(f"{file}: it is missing; {REPAIR}") from None
    if len(content) > MAX_BYTES or hashlib.sha256(content).hexdigest() != digest:
        raise ValueError(f"{file}: it is damaged: the manifest has another checksum; {REPAIR}")
    try:
        ids = load(content)[KEY]
    except (SafetensorError, KeyError) as error:
        raise ValueError(f"{file}: these are no ids: {error}") from None
    if ids.dtype != np.uint64 or ids.ndim != 1:
        raise ValueError(f"{file}: expected uint64 [U], got {ids.dtype} {ids.shape}")
    return np.asarray(ids)


def unmeasured_problems(folder: Path) -> list[str]:
    """Check the file of a map.

    Args:
        folder: Map folder.

    Returns:
        One line if the file is missing or damaged; none if it is valid.
    """
    try:
        read_unmeasured(folder)
    except (OSError, ValueError) as error:
        return [str(error)]
    return []
