"""Maps in single files, by the suffix of the file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from gslts.core.gaussian_map import GaussianMap
from gslts.io import splat, spz
from gslts.io.gltf_read import read_glb
from gslts.io.gltf_write import write_glb
from gslts.io.ply import read_ply, write_ply

READ_SUFFIXES = (".ply", ".glb", ".spz")
"""Suffixes of files that are read."""
WRITTEN_SUFFIXES = (*READ_SUFFIXES, ".splat")
"""Suffixes of files that are written."""
MAX_ROUNDING_M = 1e-3
"""Rounding of centres that is worth a note: a millimetre."""


def read_map_file(path: Path) -> GaussianMap:
    """Read a map from a file of this or another program.

    Args:
        path: A file that ends in one of `READ_SUFFIXES`; with any other suffix it is read as PLY.

    Returns:
        The map, float32.

    Raises:
        OSError: The file cannot be read.
        ValueError: The contents are wrong or not supported; one line names the file and the part.
    """
    suffix = path.suffix.lower()
    if suffix == ".gltf":
        raise ValueError(f"{path}: only binary glTF is read; save it as .glb")
    return {".glb": read_glb, ".spz": spz.read_spz}.get(suffix, read_ply)(path)


def write_map_file(
    gaussian_map: GaussianMap,
    path: Path,
    about: Mapping[str, Any] | None = None,
    spz_version: int = 4,
) -> None:
    """Write a map to a file, atomically.

    Args:
        gaussian_map: float32.
        path: A file that ends in one of `WRITTEN_SUFFIXES`.
        about: JSON values on the map, which a .glb file holds.
        spz_version: 3 or 4, of a .spz file.

    Raises:
        OSError: The file cannot be written; an old file is unchanged.
        ValueError: The suffix is unknown, or the format cannot hold the map.
    """
    suffix = path.suffix.lower()
    if suffix == ".ply":
        write_ply(gaussian_map, path)
    elif suffix == ".glb":
        write_glb(gaussian_map, path, about)
    elif suffix == ".spz":
        spz.write_spz(gaussian_map, path, spz_version)
    elif suffix == ".splat":
        splat.write_splat(gaussian_map, path)
    else:
        raise ValueError(f"{path}: must end in {' or '.join(WRITTEN_SUFFIXES)}")


def losses_of(gaussian_map: GaussianMap, suffix: str) -> list[str]:
    """Describe what a format does not keep of a map, as clauses of a message.

    Args:
        gaussian_map: The map.
        suffix: One of `WRITTEN_SUFFIXES`.
    """
    losses: list[str] = []
    if suffix == ".splat" and gaussian_map.sh_degree > 0:
        losses.append(
            "the format has colours of SH degree 0 only, the map has degree "
            f"{gaussian_map.sh_degree}"
        )
    if suffix in (".spz", ".splat"):
        if gaussian_map.feature_dims > 0:
            losses.append("the format has no semantic features")
        rounding_m = (spz if suffix == ".spz" else splat).rounding_m(gaussian_map)
        if rounding_m > MAX_ROUNDING_M:
            losses.append(
                f"centres are rounded by up to {1000 * rounding_m:.3g} mm, as the format has no "
                "origin"
            )
    return losses
