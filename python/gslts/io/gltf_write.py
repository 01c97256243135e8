"""Maps in binary glTF files (.glb) with the ratified extension KHR_gaussian_splatting.

A file holds one primitive of points with these attributes:

- POSITION: `means`; COLOR_0: the colour of SH degree 0, for viewers without the extension.
- KHR_gaussian_splatting:ROTATION (unit quaternion, xyzw), :SCALE (m, not its logarithm), :OPACITY
  (0 to 1), :SH_DEGREE_l_COEF_n (RGB, in the order and with the signs of 3DGS).
- _ROTATION, _LOG_SCALE, _LOGIT_OPACITY: what the map stores, which those do not determine to the
  last bit; _FEATURE_0..D-1: `features`; _ID: `ids` as four 16-bit numbers, lowest first, unless
  they are 0, 1, ... So a file that `write_glb` wrote holds every bit of a map, like a PLY file.

In glTF y points up. The matrix of the node turns the map, where z does, and holds its `origin`: the
attributes are those of the map. What a program wrote on the map stands in the `extras` of the node.

Source: KHR_gaussian_splatting and glTF 2.0, Khronos Group.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping
from math import isqrt
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gslts.core.gaussian_map import SH_C0, FloatArray, GaussianMap
from gslts.core.se3 import product
from gslts.io.activation import opacities_of, scales_of, to_bytes, unit_quats
from gslts.io.atomic_files import write_atomic
from gslts.io.gltf_file import COMPONENTS, WIDTHS, Z_UP, Tree
from gslts.types import Floats32

EXTENSION = "KHR_gaussian_splatting"
KERNEL, COLOR_SPACE, PROJECTION = "ellipse", "srgb_rec709_display", "perspective"
"""Those of 3DGS."""
POINTS = 0
"""Mode of glTF's primitives."""
ARRAY_BUFFER = 34962
"""Target of buffer views of attributes."""
MAX_GLB_BYTES = (1 << 32) - 1
"""Maximum size of a file, bytes: its header holds the size in 32 bits."""
COMPONENT_OF = {np.dtype(name): number for number, name in COMPONENTS.items()}
"""Component type by dtype."""
KIND_OF = {width: kind for kind, width in WIDTHS.items()}
"""Accessor type by its number of components."""


def write_glb(
    gaussian_map: GaussianMap, path: Path, about: Mapping[str, Any] | None = None
) -> None:
    """Write a map atomically as a .glb file; `read_glb` returns the same bits.

    Args:
        gaussian_map: float32, at least one Gaussian.
        path: File to write.
        about: JSON values on the map, for the `extras` of the node, such as its version and the
            names of its objects.

    Raises:
        OSError: The file cannot be written; an old file is unchanged.
        ValueError: The map is empty, float64, or larger than a .glb file can be.
    """
    if gaussian_map.dtype != np.float32:
        raise ValueError(
            f"write_glb: gaussian_map is {gaussian_map.dtype}, and the file holds float32: write "
            "gaussian_map.astype(np.float32)"
        )
    if gaussian_map.size == 0:
        raise ValueError(f"{path}: the map has no Gaussians, and a .glb file holds at least one")
    content = _container(_tree(gaussian_map, about or {}), _attributes(gaussian_map))
    if len(content) > MAX_GLB_BYTES:
        raise ValueError(f"{path}: {len(content)} bytes are too many for a .glb; write a .ply")
    write_atomic(path, content)


def harmonic_name(basis: int) -> str:
    """Return the name of the attribute of a spherical harmonic.

    Args:
        basis: Its number in the order of 3DGS, from 0.
    """
    degree = isqrt(basis)
    return f"{EXTENSION}:SH_DEGREE_{degree}_COEF_{basis - degree**2}"


def derive_rotations(stored: FloatArray) -> Floats32:
    """Compute the attribute ROTATION.

    Args:
        stored: [N,4] `_ROTATION`, xyzw.

    Returns:
        [N,4] float32, xyzw.
    """
    wxyz = np.roll(stored.astype(np.float64), 1, axis=1)
    return np.roll(unit_quats(wxyz), -1, axis=1).astype(np.float32)


def derive_scales(stored: FloatArray) -> Floats32:
    """Compute the attribute SCALE.

    Args:
        stored: [N,3] `_LOG_SCALE`.

    Returns:
        [N,3] float32, m.
    """
    with np.errstate(over="ignore"):
        return np.minimum(scales_of(stored), np.finfo(np.float32).max).astype(np.float32)


def derive_opacities(stored: FloatArray) -> Floats32:
    """Compute the attribute OPACITY.

    Args:
        stored: [N] `_LOGIT_OPACITY`.

    Returns:
        [N] float32, 0 to 1.
    """
    return opacities_of(stored).astype(np.float32)


def _attributes(gaussian_map: GaussianMap) -> dict[str, NDArray[Any]]:
    """Return the arrays [N,...] of the primitive by name."""
    opacities = opacities_of(gaussian_map.logit_opacities)
    colors = 0.5 + SH_C0 * gaussian_map.sh[:, 0].astype(np.float64)
    rotations = np.roll(gaussian_map.quats, -1, axis=1)
    arrays: dict[str, NDArray[Any]] = {
        "POSITION": gaussian_map.means,
        "COLOR_0": to_bytes(255 * np.column_stack([colors, opacities])),
        f"{EXTENSION}:ROTATION": derive_rotations(rotations),
        f"{EXTENSION}:SCALE": derive_scales(gaussian_map.log_scales),
        f"{EXTENSION}:OPACITY": derive_opacities(gaussian_map.logit_opacities),
    }
    for basis in range(gaussian_map.sh.shape[1]):
        arrays[harmonic_name(basis)] = gaussian_map.sh[:, basis]
    arrays["_ROTATION"] = rotations
    arrays["_LOG_SCALE"] = gaussian_map.log_scales
    arrays["_LOGIT_OPACITY"] = gaussian_map.logit_opacities
    for k in range(gaussian_map.feature_dims):
        arrays[f"_FEATURE_{k}"] = gaussian_map.features[:, k]
    if not np.array_equal(gaussian_map.ids, np.arange(gaussian_map.size)):
        arrays["_ID"] = gaussian_map.ids.astype("<u8").view("<u2").reshape(-1, 4)
    return arrays


def _tree(gaussian_map: GaussianMap, about: Mapping[str, Any]) -> Tree:
    """Return the JSON without accessors and buffers."""
    world_from_map = np.eye(4)
    world_from_map[:3, 3] = gaussian_map.origin
    matrix = product(Z_UP.T, world_from_map)
    node: Tree = {"mesh": 0, "matrix": matrix.T.ravel().tolist()}
    if about:
        node["extras"] = {"gslts": about}
    extension = {
        "kernel": KERNEL,
        "colorSpace": COLOR_SPACE,
        "projection": PROJECTION,
        "sortingMethod": "cameraDistance",
    }
    return {
        "asset": {"version": "2.0", "generator": "gslts"},
        "extensionsUsed": [EXTENSION],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [node],
        "meshes": [{"primitives": [{"mode": POINTS, "extensions": {EXTENSION: extension}}]}],
    }


def _container(tree: Tree, arrays: Mapping[str, NDArray[Any]]) -> bytes:
    """Return the bytes of a file: the JSON, completed, and the arrays in its binary chunk."""
    accessors: list[Tree] = []
    views: list[Tree] = []
    parts: list[bytes] = []
    end = 0
    for name, array in arrays.items():
        width = array.size // len(array)
        accessor = {
            "bufferView": len(views),
            "componentType": COMPONENT_OF[array.dtype],
            "count": len(array),
            "type": KIND_OF[width],
        }
        if array.dtype == np.uint8:
            accessor["normalized"] = True
        if name == "POSITION":
            accessor |= {"min": array.min(axis=0).tolist(), "max": array.max(axis=0).tolist()}
        accessors.append(accessor)
        view = {"buffer": 0, "byteOffset": end, "byteLength": array.nbytes}
        views.append({**view, "target": ARRAY_BUFFER})
        parts.append(array.tobytes())  # A multiple of 4 bytes, as glTF asks for.
        end += array.nbytes
    tree["meshes"][0]["primitives"][0]["attributes"] = {name: k for k, name in enumerate(arrays)}
    tree |= {"accessors": accessors, "bufferViews": views, "buffers": [{"byteLength": end}]}
    text = json.dumps(tree, separators=(",", ":"), allow_nan=False).encode()
    text += b" " * (-len(text) % 4)
    size = 12 + 8 + len(text) + 8 + end
    head = struct.pack("<4sII I4s", b"glTF", 2, size & MAX_GLB_BYTES, len(text), b"JSON")
    return b"".join([head, text, struct.pack("<I4s", end & MAX_GLB_BYTES, b"BIN\0"), *parts])
