"""Base colours and textures of glTF materials."""

from __future__ import annotations

import io
import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np

from gslts.io.gltf_file import Tree
from gslts.types import Bytes, Floats, Floats32
from gslts_sim.gltf.file import HomeFile
from gslts_sim.texture_atlas import LINEAR_OF_BYTE, srgb_from_linear

MAX_TEXTURE_PX = 8192
"""Maximum length of a side of a texture, px."""
MAX_TOTAL_PX = 400_000_000
"""Maximum number of pixels of all textures; with their mip levels, they take 1.6 GB."""
FORMATS = ("PNG", "JPEG", "WEBP")
"""Image formats that are read."""


@dataclass(frozen=True, eq=False)
class BaseColour:
    """Base colour of a material.

    Args:
        image: Index of its texture's image; None if it has no texture.
        factor: (3,) float64, linear RGB, multiplied with the texture.
        uv_set: Number of the set of texture coordinates.
        uv_from_raw: [2,3] float64: uv = uv_from_raw @ (u, v, 1).
    """

    image: int | None
    factor: Floats
    uv_set: int
    uv_from_raw: Floats

    @classmethod
    def from_material(cls, file: HomeFile, material: Any) -> BaseColour:
        """Read the base colour of a material.

        Args:
            file: The glTF file.
            material: Its index, unvalidated; None for white.

        Raises:
            BadFileError: The material is damaged.
        """
        tree: Tree = {} if material is None else file.item("materials", material)
        tree = tree.get("pbrMetallicRoughness", {})
        factor = np.array(tree.get("baseColorFactor", (1, 1, 1, 1)), np.float64)
        if factor.shape != (4,) or not np.isfinite(factor).all():
            file.reject(f"materials[{material}]: baseColorFactor: expected 4 numbers")
        info = tree.get("baseColorTexture")
        if info is None:
            return cls(None, factor[:3], 0, np.eye(2, 3))
        texture = file.item("textures", info.get("index"))
        webp = texture.get("extensions", {}).get("EXT_texture_webp", {})
        image = webp.get("source", texture.get("source"))
        if image is None:
            file.reject(f"textures[{info['index']}] has no PNG, JPEG or WebP image")
        transform = info.get("extensions", {}).get("KHR_texture_transform", {})
        uv_set = transform.get("texCoord", info.get("texCoord", 0))
        return cls(image, factor[:3], uv_set, _uv_from_raw(transform))


def _uv_from_raw(transform: Tree) -> Floats:
    """Return the matrix [2,3] of KHR_texture_transform: scale, rotation, then offset.

    The rotation is counter-clockwise with v pointing down, as in the extension's example of a
    quadrant; the matrix in its text rotates clockwise.
    """
    offset = np.array(transform.get("offset", (0, 0)), np.float64).reshape(2, 1)
    scale = np.array(transform.get("scale", (1, 1)), np.float64).reshape(2)
    cosine, sine = (f(float(transform.get("rotation", 0))) for f in (np.cos, np.sin))
    rotation = np.array([[cosine, sine], [-sine, cosine]])
    return np.hstack([rotation * scale, offset])


class Textures:
    """Decoder and cache of the textures of a file; equal surfaces share one texture.

    Args:
        file: The glTF file.
    """

    def __init__(self, file: HomeFile) -> None:
        self._file = file
        self._pixels_left = MAX_TOTAL_PX
        self._images: dict[int, Bytes] = {}
        self._tinted: dict[tuple[int | None, bytes], Bytes] = {}

    def tint(self, image: int | None, factor: Floats) -> Bytes:
        """Return an image multiplied by a colour in linear light.

        Args:
            image: Its index; None for a white texel.
            factor: (3,) float64, linear RGB.

        Returns:
            [h,w,3] uint8, sRGB.

        Raises:
            BadFileError: The image is missing, damaged or too large.
        """
        factor = np.clip(factor, 0, 1)
        key = image, factor.tobytes()
        if key not in self._tinted:
            texture = np.full((1, 1, 3), 255, np.uint8) if image is None else self._image(image)
            if (factor != 1).any():
                self._take(texture.shape[0] * texture.shape[1])
                # A table with the new value of each of the 256 values of a channel.
                table = srgb_bytes(LINEAR_OF_BYTE.astype(np.float64)[:, None] * factor)
                texture = np.stack([table[:, k][texture[..., k]] for k in range(3)], axis=-1)
            self._tinted[key] = texture
        return self._tinted[key]

    def _take(self, pixels: int) -> None:
        self._pixels_left -= pixels
        if self._pixels_left < 0:
            self._file.reject(f"its textures have over {MAX_TOTAL_PX} pixels")

    def _image(self, index: int) -> Bytes:
        if index not in self._images:
            entry = self._file.item("images", index)
            if "bufferView" in entry:
                data = self._file.view(entry["bufferView"])
            else:
                data = self._file.resource(entry.get("uri"))
            self._images[index] = self._decode(data, f"images[{index}]")
        return self._images[index]

    def _decode(self, data: memoryview, name: str) -> Bytes:
        from PIL import Image

        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # Of large images; ours are limited below.
                with Image.open(io.BytesIO(data), formats=FORMATS) as image:
                    width, height = image.size
                    if max(width, height) > MAX_TEXTURE_PX:
                        self._file.reject(
                            f"{name} is {width} x {height} pixels, the maximum is {MAX_TEXTURE_PX}"
                        )
                    self._take(width * height)
                    return _rgb(image)
        except (OSError, SyntaxError, Image.DecompressionBombError) as error:
            self._file.reject(f"{name} cannot be read as {', '.join(FORMATS)}: {error}")


def _rgb(image: Any) -> Bytes:
    """Return [h,w,3] uint8: grey and palettes become RGB, opacity is dropped."""
    if image.mode.startswith("I"):  # 16-bit grey, which PIL would clip.
        grey = (np.asarray(image).astype(np.uint32) >> 8).astype(np.uint8)
        return np.repeat(grey[..., None], 3, axis=2)
    opaque = image.convert("RGBA") if image.mode in ("P", "PA", "LA") else image
    return np.array(opaque.convert("RGB"))


def srgb_bytes(linear: Floats) -> Bytes:
    """Convert linear light to 8-bit sRGB.

    Args:
        linear: Clipped to 0 to 1.
    """
    result: Bytes = np.rint(255 * srgb_from_linear(np.clip(linear, 0, 1))).astype(np.uint8)
    return result


def palette(colours: Floats) -> tuple[Bytes, Floats32]:
    """Make a texture with one texel per colour, for triangles of one colour each.

    Args:
        colours: [F,3] float64, linear RGB of each triangle.

    Returns:
        The texture [h,w,3] uint8 and texture coordinates [F,3,2] float32 at the texels' centres.
    """
    distinct, index = np.unique(srgb_bytes(colours), axis=0, return_inverse=True)
    width = int(np.ceil(np.sqrt(len(distinct))))
    height = -(-len(distinct) // width)
    texels = np.zeros((height * width, 3), np.uint8)
    texels[: len(distinct)] = distinct
    uv = np.stack([(index % width + 0.5) / width, (index // width + 0.5) / height], axis=1)
    uvs = np.repeat(uv.astype(np.float32)[:, None], 3, axis=1)
    return texels.reshape(height, width, 3), uvs
