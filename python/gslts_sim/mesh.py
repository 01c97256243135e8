"""Textured triangles of the objects of a home."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gslts.types import Bytes, Floats, Floats32, Ints32


@dataclass(frozen=True, eq=False)
class Surface:
    """Triangles that share one texture.

    Args:
        vertices: [V,3] float64, m, in the frame of the object.
        faces: [F,3] int32, counter-clockwise seen from outside.
        uvs: [F,3,2] float32, texture coordinates of the corners, as in glTF: (0, 0) is the upper
            left corner of the texture, (1, 1) the lower right, and the texture repeats beyond.
        texture: [h,w,3] uint8, sRGB.
        emission: Radiance of a white texel while a light of the object is on.

    Raises:
        ValueError: An array has a wrong shape or dtype, there is no triangle, or a vertex is not
            finite or does not exist.
    """

    vertices: Floats
    faces: Ints32
    uvs: Floats32
    texture: Bytes
    emission: float = 0.0

    def __post_init__(self) -> None:
        count = len(self.faces)
        _require("vertices", self.vertices, np.float64, (-1, 3))
        _require("faces", self.faces, np.int32, (-1, 3))
        _require("uvs", self.uvs, np.float32, (count, 3, 2))
        _require("texture", self.texture, np.uint8, (-1, -1, 3))
        if count == 0:
            raise ValueError("Surface: faces: there is no triangle")
        if self.texture.size == 0:
            raise ValueError("Surface: texture: there is no pixel")
        if not np.isfinite(self.vertices).all():
            row = int(np.flatnonzero(~np.isfinite(self.vertices).all(axis=1))[0])
            raise ValueError(f"Surface: vertices[{row}] is {self.vertices[row].tolist()}")
        if not np.isfinite(self.uvs).all():
            raise ValueError("Surface: uvs: all must be finite")
        if self.faces.min() < 0 or self.faces.max() >= len(self.vertices):
            raise ValueError(
                f"Surface: faces: vertices are 0 to {len(self.vertices) - 1}, got "
                f"{self.faces.min()} to {self.faces.max()}"
            )


def _require(name: str, array: NDArray[np.generic], dtype: type, shape: tuple[int, ...]) -> None:
    """Raise ValueError unless an array has a dtype and a shape; a length of -1 fits any."""
    fits = array.ndim == len(shape) and all(
        wanted in (-1, length) for wanted, length in zip(shape, array.shape, strict=True)
    )
    if array.dtype != dtype or not fits:
        expected = ", ".join("*" if length == -1 else str(length) for length in shape)
        raise ValueError(
            f"Surface: {name}: expected {np.dtype(dtype)} ({expected}), got {array.dtype} "
            f"{array.shape}"
        )
