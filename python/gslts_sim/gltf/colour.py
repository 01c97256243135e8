"""Base colours of glTF materials as textures."""

from __future__ import annotations

import io
import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gslts.types import Floats
from gslts_sim.gltf.file import GltfFile, Tree
from gslts_sim.texture_atlas import LINEAR_OF_BYTE, srgb_from_linear

Texture = NDArray[np.uint8]

TEXTURE_PX = 8192
"""Longest side of a texture."""
ALL_TEXTURES_PX = 400_000_000
"""Pixels of all textures; with their smaller versions, 1.6 GB."""
FORMATS = ("PNG", "JPEG", "WEBP")

WHITE = np.ones(3)


@dataclass(frozen=True, eq=False)
class BaseColour:
    """The base colour of a material.

    Args:
        image: Index of its texture's image; None if it has no texture.
        factor: (3,) float64, linear RGB, multiplied into the texture.
        uv_set: Number of the texture coordinates.
        uv_from_raw: [2,3] float64: uv = uv_from_raw @ (u, v, 1).
    """

    image: int | None
    factor: Floats
    uv_set: int
    uv_from_raw: Floats

    @classmethod
    def of(cls, file: GltfFile, material: Any) -> BaseColour:
        """That of a material, by index; white where there is none."""
        look: Tree = {} if material is None else file.item("materials", material)
        look = look.get("pbrMetallicRoughness", {})
        factor = np.array(look.get("baseColorFactor", (1, 1, 1, 1)), np.float64)
        if factor.shape != (4,) or not np.isfinite(factor).all():
            file.refuse(f"materials[{material}]: baseColorFactor: expected 4 numbers")
        info = look.get("baseColorTexture")
        if info is None:
            return cls(None, factor[:3], 0, np.eye(2, 3))
        texture = file.item("textures", info.get("index"))
        webp = texture.get("extensions", {}).get("EXT_texture_webp", {})
        image = webp.get("source", texture.get("source"))
        if image is None:
            file.refuse(f"textures[{info['index']}] has no PNG, JPEG or WebP image")
        change = info.get("extensions", {}).get("KHR_texture_transform", {})
        uv_set = change.get("texCoord", info.get("texCoord", 0))
        return cls(image, factor[:3], uv_set, _uv_from_raw(change))


def _uv_from_raw(change: Tree) -> Floats:
    """[2,3] of KHR_texture_transform: scaled, turned counter-clockwise as v points down, shifted.

    Source: the extension's example of a quadrant; the matrix in its text turns the other way.
    """
    offset = np.array(change.get("offset", (0, 0)), np.float64).reshape(2, 1)
    scale = np.array(change.get("scale", (1, 1)), np.float64).reshape(2)
    cosine, sine = (f(float(change.get("rotation", 0))) for f in (np.cos, np.sin))
    turn = np.array([[cosine, sine], [-sine, cosine]])
    return np.hstack([turn * scale, offset])


class Textures:
    """The textures of a file; surfaces that look the same share theirs."""

    def __init__(self, file: GltfFile) -> None:
        self._file = file
        self._pixels_left = ALL_TEXTURES_PX
        self._images: dict[int, Texture] = {}
        self._tinted: dict[tuple[int | None, bytes], Texture] = {}

    def tinted(self, image: int | None, factor: Floats) -> Texture:
        """[h,w,3] uint8, sRGB: an image, or white, times a factor (3,) of linear light."""
        factor = np.clip(factor, 0, 1)
        key = image, factor.tobytes()
        if key not in self._tinted:
            texture = np.full((1, 1, 3), 255, np.uint8) if image is None else self._image(image)
            if not np.array_equal(factor, WHITE):
                self._take(texture.shape[0] * texture.shape[1])
                # Channel by channel in 256 steps: a table says what each byte becomes.
                table = srgb_bytes(LINEAR_OF_BYTE.astype(np.float64)[:, None] * factor)
                texture = np.stack([table[:, k][texture[..., k]] for k in range(3)], axis=-1)
            self._tinted[key] = texture
        return self._tinted[key]

    def _take(self, pixels: int) -> None:
        self._pixels_left -= pixels
        if self._pixels_left < 0:
            self._file.refuse(f"its textures have over {ALL_TEXTURES_PX} pixels")

    def _image(self, index: int) -> Texture:
        if index not in self._images:
            entry = self._file.item("images", index)
            if "bufferView" in entry:
                data = self._file.view(entry["bufferView"])
            else:
                data = self._file.resource(entry.get("uri"))
            self._images[index] = self._decoded(data, f"images[{index}]")
        return self._images[index]

    def _decoded(self, data: memoryview, name: str) -> Texture:
        from PIL import Image

        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # Of large images; ours are limited below.
                with Image.open(io.BytesIO(data), formats=FORMATS) as image:
                    width, height = image.size
                    if max(width, height) > TEXTURE_PX:
                        self._file.refuse(
                            f"{name} is {width} x {height} pixels, at most {TEXTURE_PX} are read"
                        )
                    self._take(width * height)
                    return _rgb(image)
        except (OSError, SyntaxError, Image.DecompressionBombError) as error:
            self._file.refuse(f"{name} cannot be read as {', '.join(FORMATS)}: {error}")


def _rgb(image: Any) -> Texture:
    """[h,w,3] uint8: grey and palettes become colours, the opacity is dropped."""
    if image.mode.startswith("I"):  # Grey with 16 bits, which PIL would clip.
        grey = (np.asarray(image).astype(np.uint32) >> 8).astype(np.uint8)
        return np.repeat(grey[..., None], 3, axis=2)
    opaque = image.convert("RGBA") if image.mode in ("P", "PA", "LA") else image
    return np.array(opaque.convert("RGB"))


def srgb_bytes(linear: Floats) -> Texture:
    """SRGB bytes of linear light from 0 to 1."""
    result: Texture = np.rint(255 * srgb_from_linear(np.clip(linear, 0, 1))).astype(np.uint8)
    return result


def palette(colours: Floats) -> tuple[Texture, NDArray[np.float32]]:
    """A texture with a texel for each colour, for triangles of one colour each.

    Args:
        colours: [F,3] float64, linear RGB, one a triangle.

    Returns:
        The texture [h,w,3] uint8 and texture coordinates [F,3,2] float32 in the texels' middles.
    """
    distinct, index = np.unique(srgb_bytes(colours), axis=0, return_inverse=True)
    width = int(np.ceil(np.sqrt(len(distinct))))
    height = -(-len(distinct) // width)
    texels = np.zeros((height * width, 3), np.uint8)
    texels[: len(distinct)] = distinct
    uv = np.stack([(index % width + 0.5) / width, (index // width + 0.5) / height], axis=1)
    uvs = np.repeat(uv.astype(np.float32)[:, None], 3, axis=1)
    return texels.reshape(height, width, 3), uvs
