"""Maps in the PLY format of 3D Gaussian splatting (Kerbl et al. 2023).

The element `vertex` has these properties:

- x, y, z: `means`; nx, ny, nz: written as 0, because some viewers require them, and not read.
- f_dc_0..2, f_rest_0..3(K-1)-1: `sh`. f_rest holds the K-1 coefficients of red, then those of
  green, then those of blue.
- opacity: `logit_opacities`; scale_0..2: `log_scales`; rot_0..3: `quats`.
- feature_0..D-1: `features`; id_low, id_high: the halves of `ids`, unless those are 0, 1, ...

The comment `gslts origin X Y Z` holds the map's `origin`. Without it the origin is zero, or the
median of centres in double that are 2,048 m or more away. Other tools show a map around its own
origin. Axes and units are not converted: a scene from structure from motion is
seldom in metres with z up.

Variants of other programs are read, too: fewer or other properties and types, red, green, blue
(uchar) instead of f_dc, an infinite opacity and a scale of minus infinity (as opacity 1 or 0 and
scale 0), and the compressed layout of PlayCanvas and SuperSplat.
"""

from __future__ import annotations

import logging
import os

from gslts._core import io as _core
from gslts._core.map import GaussianViewFloat
from gslts.core.gaussian_map import GaussianMap

__all__ = ["read_ply", "write_ply"]

_logger = logging.getLogger(__name__)


def read_ply(path: str | os.PathLike[str]) -> GaussianMap:
    """Read a map from a PLY file, ascii or binary, of this or another program.

    Properties may have any order and any number type, and the file may have other elements. Other
    properties of `vertex` are ignored, and the logger `gslts.io.ply` warns with their names.
    Memory is bounded by the size of the file.

    Args:
        path: A regular file.

    Returns:
        The map, float32. Its ids are 0, 1, ... unless the file has others.

    Raises:
        OSError: The file cannot be opened or read (FileNotFoundError, PermissionError, ...).
        ValueError: The contents are wrong; one line names the file, the header's line or the row
            and property, and what is wrong.
    """
    arrays, ignored = _core.read_ply(path)
    if ignored:
        _logger.warning("%s: ignored properties of vertex: %s", path, ", ".join(ignored))
    return GaussianMap(**arrays)


def write_ply(gaussian_map: GaussianMap, path: str | os.PathLike[str]) -> None:
    """Write a map atomically as binary little-endian PLY; `read_ply` returns the same bits.

    Args:
        gaussian_map: float32.
        path: Where to write; a symbolic link is followed.

    Raises:
        OSError: The file cannot be written, or the path is there already but is no regular file.
        ValueError: The map is float64 (write `gaussian_map.astype(np.float32)`), or its features
            are so many, over 9,000, that their names do not fit into a header.
    """
    view = gaussian_map.view()
    if not isinstance(view, GaussianViewFloat):
        raise ValueError(
            f"write_ply: gaussian_map is {gaussian_map.dtype}, and PLY files hold float32: "
            "write gaussian_map.astype(np.float32)"
        )
    _core.write_ply(view, gaussian_map.ids, path)
