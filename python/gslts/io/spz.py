"""Maps in the compressed format SPZ of Niantic, about a tenth of the size of a PLY file.

Positions are 24-bit fixed-point numbers, with 12 bits after the point, 0.24 mm, unless the map is
wider than 4 km. Scales are rounded to 1/16 of a logarithm, opacities and colours of SH degree 0 to
8 bits, quaternions to 9 bits and a sign for each of the three smaller components, other harmonics
to 6 bits from -1 to 1. The format has neither ids, features nor an origin. Its axes are x right,
y up, z back, unless an extension says otherwise: y points up as z does in a map.

Source: nianticlabs/spz.
"""

from __future__ import annotations

import logging
from dataclasses import replace
from math import sqrt
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gslts.core.gaussian_map import FloatArray, GaussianMap
from gslts.core.similarity import transform_map
from gslts.core.spherical_harmonics import MAX_DEGREE
from gslts.io.activation import logits_of, opacities_of, to_bytes, unit_quats
from gslts.io.atomic_files import write_atomic
from gslts.io.gltf_file import Z_UP
from gslts.io.spz_streams import SpzHeader, pack_streams, unpack_streams
from gslts.types import Bytes, Floats

VERSIONS = (3, 4)
"""Versions that are written; 1 and 2 are read, too."""
FRACTIONAL_BITS = 12
"""Bits after the point of positions, as other programs write."""
POSITION_BITS = 24
SCALE_STEPS, MIN_LOG_SCALE = 16, -10.0
"""Steps per unit of a logarithm of a scale, and the logarithm that byte 0 stands for."""
COLOR_RANGE = 0.15
"""A byte of colour is 255 times this coefficient of degree 0, plus 127.5."""
HARMONIC_STEP = 4
"""Step to which bytes of harmonics are rounded, a power of 2; readers need not know it. With
Niantic's steps, 8 in degree 1 and 16 beyond, a file of degree 3 is 28% smaller, and renderings of a
room have a PSNR of 31.5 instead of 43.6 dB to those of the map; with 1 it is 41% larger, for 54.4
dB."""
ANTIALIASED = 1
"""Flag of Gaussians that were trained with a filter for antialiasing."""
MAGNITUDE = 511
"""The 9-bit number that stands for 1/sqrt(2), which no second largest component exceeds."""

_logger = logging.getLogger(__name__)


def write_spz(gaussian_map: GaussianMap, path: Path, version: int = 4) -> None:
    """Write a map atomically without features, ids and origin, rounded.

    Args:
        gaussian_map: Map of any dtype.
        path: File to write.
        version: 4, or 3 for programs that do not read it yet.

    Raises:
        OSError: The file cannot be written; an old file is unchanged.
        ValueError: The version is unknown, or the map lies too far from the world's origin.
    """
    if version not in VERSIONS:
        raise ValueError(f"write_spz: version: expected 3 or 4, got {version}")
    turned = transform_map(replace(gaussian_map, origin=np.zeros(3)), Z_UP.T)
    positions = turned.means + gaussian_map.origin @ Z_UP[:3, :3]
    bits = _fractional_bits(positions, path)
    header = SpzHeader(version, turned.size, turned.sh_degree, bits)
    streams: dict[str, NDArray[Any]] = {
        "positions": _pack_positions(positions, bits),
        "alphas": to_bytes(255 * opacities_of(turned.logit_opacities)),
        "colors": to_bytes(255 * COLOR_RANGE * turned.sh[:, 0] + 127.5),
        "scales": to_bytes(SCALE_STEPS * (turned.log_scales - MIN_LOG_SCALE)),
        "rotations": _pack_quats(turned.quats),
        "harmonics": _pack_harmonics(turned.sh[:, 1:]),
    }
    packed = {name: stream.tobytes() for name, stream in streams.items()}
    write_atomic(path, pack_streams(header, packed))


def read_spz(path: Path) -> GaussianMap:
    """Read a map from an .spz file of this or another program; z points up in the map.

    Harmonics beyond degree 3 are left out, with a warning.

    Args:
        path: A regular file. It is untrusted: memory is bounded by its size.

    Returns:
        The map, float32, with ids 0, 1, ...

    Raises:
        OSError: The file cannot be read.
        ValueError: The contents are wrong or not supported; one line names the file and the part.
    """
    header, streams = unpack_streams(path)
    if header.flags & ANTIALIASED:
        _logger.warning(
            "%s: trained with antialiasing; without it, edges are rendered thicker", path
        )
    if header.degree > MAX_DEGREE:
        _logger.warning("%s: harmonics of degree %d are left out", path, header.degree)
    data = {
        name: np.frombuffer(streams[name], np.uint8).reshape(header.size, width)
        for name, width in header.widths().items()
    }
    arrays: dict[str, Any] = {
        "means": _unpack_positions(data["positions"], header),
        "quats": _unpack_quats(data["rotations"], header.version),
        "log_scales": data["scales"] / SCALE_STEPS + MIN_LOG_SCALE,
        "logit_opacities": logits_of(data["alphas"].ravel() / 255),
        "sh": _unpack_harmonics(data["colors"], data["harmonics"], header.degree),
    }
    for name, array in arrays.items():
        arrays[name] = array.astype(np.float32)
    try:
        return transform_map(GaussianMap(**arrays), Z_UP @ np.diag([*header.axes, 1]))
    except ValueError as error:  # Positions of 16 bits may be infinite.
        raise ValueError(f"{path}: {error}") from None


def rounding_m(gaussian_map: GaussianMap) -> float:
    """Return the maximum rounding error of centres in this format, m.

    Args:
        gaussian_map: Map to be written.

    Raises:
        ValueError: The map lies too far from the world's origin.
    """
    positions = gaussian_map.means + gaussian_map.origin
    return float(0.5 ** (1 + _fractional_bits(positions, Path("map"))))


def _fractional_bits(positions: Floats, path: Path) -> int:
    farthest_m = float(np.abs(positions).max(initial=0))
    whole_bits = max(0, int(np.ceil(np.log2(farthest_m + 1))))
    bits = min(FRACTIONAL_BITS, POSITION_BITS - 1 - whole_bits)
    if bits < 0:
        raise ValueError(f"{path}: a Gaussian {farthest_m:.3g} m from the origin; write a .ply")
    return bits


def _pack_positions(positions: Floats, fractional_bits: int) -> Bytes:
    fixed = np.rint(positions * 2.0**fractional_bits).astype("<i4")
    return np.ascontiguousarray(fixed[..., None].view(np.uint8)[..., :3])


def _unpack_positions(data: Bytes, header: SpzHeader) -> FloatArray:
    if header.version == 1:
        return np.ascontiguousarray(data).view("<f2").reshape(-1, 3).astype(np.float32)
    parts = np.zeros((header.size, 3, 4), np.uint8)
    parts[..., 1:] = data.reshape(-1, 3, 3)
    fixed = parts.view("<i4")[..., 0] >> 8  # The shift spreads the sign.
    return fixed / 2.0**header.fractional_bits


def _pack_quats(quats: FloatArray) -> NDArray[np.uint32]:
    """Pack quaternions: the index of the largest component, xyzw, and the three others."""
    xyzw = np.roll(unit_quats(quats.astype(np.float64)), -1, axis=1)
    largest = np.abs(xyzw).argmax(axis=1)
    rows = np.arange(len(xyzw))
    xyzw *= np.where(xyzw[rows, largest] < 0, -1, 1)[:, None]
    others = xyzw[largest[:, None] != np.arange(4)].reshape(-1, 3)
    sizes = (MAGNITUDE * sqrt(2) * np.abs(others) + 0.5).astype(np.uint32)
    parts = (others < 0).astype(np.uint32) << 9 | sizes.clip(0, MAGNITUDE)
    packed: NDArray[np.uint32] = largest.astype(np.uint32) << 30 | parts[:, 0] << 20
    packed |= parts[:, 1] << 10 | parts[:, 2]
    return packed.astype("<u4")


def _unpack_quats(data: Bytes, version: int) -> Floats:
    """Return quaternions [N,4] wxyz."""
    if version < 3:
        xyz = data / 127.5 - 1
        w = np.sqrt(np.maximum(0, 1 - (xyz**2).sum(axis=1)))
        return np.column_stack([w, xyz])
    packed = np.ascontiguousarray(data[:, :4]).view("<u4")
    parts = packed >> np.array([20, 10, 0], np.uint32) & 1023
    others = (parts & MAGNITUDE) / (MAGNITUDE * sqrt(2)) * np.where(parts >> 9, -1, 1)
    rest = np.sqrt(np.maximum(0, 1 - (others**2).sum(axis=1)))
    is_largest = packed >> 30 == np.arange(4)
    xyzw = np.empty((len(packed), 4))
    xyzw[is_largest] = rest
    xyzw[~is_largest] = others.ravel()
    return np.roll(xyzw, 1, axis=1)


def _pack_harmonics(sh: FloatArray) -> Bytes:
    """Pack harmonics [N,K-1,3] of degree 1 and more."""
    numbers = np.rint(128 * sh.clip(-1, 1)).astype(np.int16) + 128
    return to_bytes((numbers + HARMONIC_STEP // 2) & -HARMONIC_STEP)


def _unpack_harmonics(colors: Bytes, harmonics: Bytes, degree: int) -> FloatArray:
    bases = (min(degree, MAX_DEGREE) + 1) ** 2
    sh = np.empty((len(colors), bases, 3), np.float32)
    sh[:, 0] = (colors / 255 - 0.5) / COLOR_RANGE
    stored = harmonics[:, : 3 * (bases - 1)].reshape(len(colors), bases - 1, 3)
    sh[:, 1:] = (stored.astype(np.float32) - 128) / 128
    return sh
