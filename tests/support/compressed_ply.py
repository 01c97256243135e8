"""Writer of the compressed PLY files of PlayCanvas and SuperSplat, from their description."""

from pathlib import Path

import numpy as np
import plyfile
from numpy.typing import NDArray

import gslts
from gslts.core.gaussian_map import SH_C0

CHUNK = 256


def write_compressed_ply(gaussian_map: gslts.GaussianMap, path: Path, colors: bool) -> None:
    """Write a map with or without bounds of colours; without, colours lie from 0 to 1."""
    opacities = 1 / (1 + np.exp(-gaussian_map.logit_opacities.astype(np.float64)))
    values = {
        "": gaussian_map.means.astype(np.float64),
        "scale_": gaussian_map.log_scales.astype(np.float64),
        "color": 0.5 + SH_C0 * gaussian_map.sh[:, 0].astype(np.float64),
    }
    starts = np.arange(0, gaussian_map.size, CHUNK)
    chunk_of = np.arange(gaussian_map.size) // CHUNK
    chunks: dict[str, NDArray[np.float32]] = {}
    units = {}
    for name, rows in values.items():
        low = np.minimum.reduceat(rows, starts).astype(np.float32)
        high = np.maximum.reduceat(rows, starts).astype(np.float32)
        if name == "color" and not colors:
            low, high = np.zeros_like(low), np.ones_like(high)
        elif name == "color":
            chunks |= {f"min_{c}": low[:, i] for i, c in enumerate("rgb")}
            chunks |= {f"max_{c}": high[:, i] for i, c in enumerate("rgb")}
        else:
            chunks |= {f"min_{name}{c}": low[:, i] for i, c in enumerate("xyz")}
            chunks |= {f"max_{name}{c}": high[:, i] for i, c in enumerate("xyz")}
        range_ = np.maximum(high - low, 1e-9)[chunk_of]
        units[name] = ((rows - low[chunk_of]) / range_).clip(0, 1)
    vertex = {
        "packed_position": _pack(units[""], (11, 10, 11)),
        "packed_rotation": _pack_quats(gaussian_map.quats.astype(np.float64)),
        "packed_scale": _pack(units["scale_"], (11, 10, 11)),
        "packed_color": _pack(np.column_stack([units["color"], opacities]), (8, 8, 8, 8)),
    }
    elements = [_element("chunk", chunks), _element("vertex", vertex)]
    if gaussian_map.sh_degree > 0:
        rest = gaussian_map.sh[:, 1:].transpose(0, 2, 1).reshape(gaussian_map.size, -1)
        packed = np.floor(256 * (rest / 8 + 0.5)).clip(0, 255).astype(np.uint8)
        names = {f"f_rest_{i}": packed[:, i] for i in range(packed.shape[1])}
        elements.append(_element("sh", names))
    plyfile.PlyData(elements).write(path)


def _pack(units: NDArray[np.float64], bits: tuple[int, ...]) -> NDArray[np.uint32]:
    result = np.zeros(len(units), np.uint32)
    for column, count in zip(units.T, bits, strict=True):
        result = result << count | np.rint(column * (2**count - 1)).astype(np.uint32)
    return result


def _pack_quats(quats: NDArray[np.float64]) -> NDArray[np.uint32]:
    unit = quats / np.linalg.norm(quats, axis=1, keepdims=True)
    result = np.empty(len(unit), np.uint32)
    for i, quat in enumerate(unit):
        largest = int(np.abs(quat).argmax())
        others = np.delete(quat * np.sign(quat[largest]), largest)
        packed = _pack((others / np.sqrt(2) + 0.5)[None], (10, 10, 10))
        result[i] = largest << 30 | int(packed[0])
    return result


def _element(name: str, columns: dict[str, NDArray]) -> plyfile.PlyElement:
    rows = np.empty(
        len(next(iter(columns.values()))), [(key, array.dtype) for key, array in columns.items()]
    )
    for key, array in columns.items():
        rows[key] = array
    return plyfile.PlyElement.describe(rows, name)
