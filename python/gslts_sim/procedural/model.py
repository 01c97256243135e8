"""Materials, the style of a home, and models made of parts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gslts.types import Bytes, Floats
from gslts_sim.home import HomeObject
from gslts_sim.mesh import Surface
from gslts_sim.procedural.mesh import Mesh
from gslts_sim.procedural.noise import Colour, Image, Rng, to_bytes

TEXTURE_STREAM = 1
"""Key that separates the random streams of textures from those of shapes and poses."""


@dataclass(frozen=True, eq=False)
class Material:
    """A texture and its size.

    Args:
        texture: [h,w,3] uint8, sRGB.
        size_m: Width and height of one repeat, m.
        fitted: It starts at the origin of the texture coordinates of each part, as a print must.
        emission: Radiance of a white texel while a light of the object is on.
    """

    texture: Bytes
    size_m: tuple[float, float]
    fitted: bool
    emission: float = 0.0


class Kit:
    """Source of the objects of one home: a random stream, a style and materials.

    Textures have random streams of their own, so that their resolution never changes a shape.

    Args:
        seed: Key of the random streams.
        detail: Scale of the resolution of textures.
    """

    def __init__(self, seed: tuple[int, ...], detail: float = 1.0) -> None:
        self.rng = np.random.default_rng(seed)
        self.style = Style.sample(self.rng)
        self._seed, self._detail = seed, detail
        self._materials: dict[tuple[Any, ...], Material] = {}
        self._prints = 0

    def material(
        self, draw: Callable[..., Image], size_m: float, px: int, *args: Any, **kwargs: Any
    ) -> Material:
        """Return a repeating material; the same for the same arguments.

        Args:
            draw: Function of `textures` or `fabrics`.
            size_m: Width and height of one repeat, m.
            px: Width and height of the texture.
            *args: Passed to `draw`.
            **kwargs: Passed to `draw`.
        """
        key = (draw.__name__, size_m, px, *args, *sorted(kwargs.items()))
        if key not in self._materials:
            texture = self._draw(draw, (px, px), *args, **kwargs)
            self._materials[key] = Material(texture, (size_m, size_m), fitted=False)
        return self._materials[key]

    def print_material(
        self, draw: Callable[..., Image], size_m: tuple[float, float], px: int, *args: Any
    ) -> Material:
        """Draw a new material that fits one side exactly.

        Args:
            draw: Function of `prints`, `textures` or `fabrics`.
            size_m: Width and height of the side, m.
            px: Pixels of the longer side.
            *args: Passed to `draw`.
        """
        scale = px / max(size_m)
        shape = (max(8, round(size_m[1] * scale)), max(8, round(size_m[0] * scale)))
        return Material(self._draw(draw, shape, *args), size_m, fitted=True)

    def _draw(
        self, draw: Callable[..., Image], shape: tuple[int, int], *args: Any, **kwargs: Any
    ) -> Bytes:
        self._prints += 1
        stream = np.random.default_rng((*self._seed, TEXTURE_STREAM, self._prints))
        h, w = (max(32, round(length * self._detail)) for length in shape)
        return to_bytes(draw(stream, (h, w), *args, **kwargs))


WOODS: tuple[tuple[Colour, Colour], ...] = (
    ((0.5, 0.34, 0.2), (0.76, 0.58, 0.38)),  # oak
    ((0.28, 0.17, 0.1), (0.5, 0.33, 0.2)),  # walnut
    ((0.66, 0.48, 0.28), (0.9, 0.75, 0.52)),  # pine
    ((0.36, 0.17, 0.1), (0.62, 0.33, 0.2)),  # cherry
    ((0.56, 0.46, 0.36), (0.8, 0.71, 0.6)),  # ash
)
FABRICS: tuple[tuple[Colour, Colour], ...] = (
    ((0.36, 0.4, 0.46), (0.56, 0.6, 0.65)),
    ((0.62, 0.54, 0.43), (0.8, 0.72, 0.61)),
    ((0.18, 0.3, 0.42), (0.34, 0.48, 0.6)),
    ((0.5, 0.22, 0.17), (0.7, 0.38, 0.29)),
    ((0.3, 0.38, 0.25), (0.5, 0.57, 0.4)),
    ((0.28, 0.26, 0.26), (0.46, 0.44, 0.43)),
    ((0.66, 0.5, 0.2), (0.85, 0.69, 0.36)),
)
ACCENTS: tuple[Colour, ...] = (
    (0.74, 0.3, 0.2), (0.16, 0.42, 0.5), (0.84, 0.62, 0.22), (0.3, 0.45, 0.3),
    (0.6, 0.28, 0.36), (0.24, 0.32, 0.56),
)  # fmt: skip
WALLS: tuple[Colour, ...] = (
    (0.9, 0.87, 0.8), (0.82, 0.87, 0.85), (0.88, 0.82, 0.72), (0.8, 0.84, 0.9),
    (0.85, 0.89, 0.79), (0.92, 0.84, 0.79), (0.86, 0.85, 0.84),
)  # fmt: skip
FRONTS: tuple[Colour, ...] = (
    (0.9, 0.89, 0.85), (0.44, 0.55, 0.52), (0.33, 0.42, 0.54), (0.82, 0.77, 0.66),
    (0.58, 0.62, 0.54),
)  # fmt: skip


@dataclass(frozen=True)
class Style:
    """Colours and motifs that all objects of one home share."""

    wood: tuple[Colour, Colour]
    second_wood: tuple[Colour, Colour]
    floor_wood: tuple[Colour, Colour]
    fabric: tuple[Colour, Colour]
    second_fabric: tuple[Colour, Colour]
    accent: Colour
    second_accent: Colour
    wall: Colour
    front: Colour
    motif: int

    @classmethod
    def sample(cls, rng: Rng) -> Style:
        """Sample a style; its two woods, fabrics and accents differ.

        Args:
            rng: Random stream.
        """
        woods = rng.permutation(len(WOODS))
        fabrics, accents = rng.permutation(len(FABRICS)), rng.permutation(len(ACCENTS))
        return cls(
            wood=WOODS[woods[0]],
            second_wood=WOODS[woods[1]],
            floor_wood=WOODS[woods[2]],
            fabric=FABRICS[fabrics[0]],
            second_fabric=FABRICS[fabrics[1]],
            accent=ACCENTS[accents[0]],
            second_accent=ACCENTS[accents[1]],
            wall=WALLS[rng.integers(len(WALLS))],
            front=FRONTS[rng.integers(len(FRONTS))],
            motif=int(rng.integers(6)),
        )


@dataclass
class Model:
    """Builder of an object, in a frame with z up, its front towards -y.

    Args:
        type: Such as `Mug`.
        movable: Whether people carry it about.
        receptacle: Whether other objects may stand on it or in it.
    """

    type: str
    movable: bool = False
    receptacle: bool = False
    _parts: list[tuple[Mesh, Material]] = field(default_factory=list)
    _boxes: list[Floats] = field(default_factory=list)

    def add(
        self,
        mesh: Mesh,
        material: Material,
        at: tuple[float, float, float] = (0, 0, 0),
        *,
        solid: bool = True,
    ) -> None:
        """Add a part.

        Args:
            mesh: Its shape.
            material: Of the part.
            at: Shift of the shape, m.
            solid: Add the box around it to the boxes of the model, too.
        """
        part = mesh.translate(*at)
        self._parts.append((part, material))
        if solid:
            self.fills(part.vertices.min(axis=0), part.vertices.max(axis=0))

    def fills(self, lower: NDArray[Any] | Any, upper: NDArray[Any] | Any) -> None:
        """Add a box to those that decide about collisions and support.

        Args:
            lower: (3,) lower corner, m.
            upper: (3,) upper corner, m.
        """
        self._boxes.append(np.array([lower, upper], np.float64))

    @property
    def bounds(self) -> Floats:
        """[2,3] corners of the axis-aligned box around all parts and boxes, m."""
        points = np.concatenate([mesh.vertices for mesh, _ in self._parts] + self._boxes)
        return np.stack([points.min(axis=0), points.max(axis=0)])

    @property
    def size(self) -> Floats:
        """(3,) width, depth and height, m."""
        lower, upper = self.bounds
        size: Floats = upper - lower
        return size

    def object(self, object_id: str, world_from_object: Floats, parent: str | None) -> HomeObject:
        """Return the finished object, its origin in the middle of its underside.

        Args:
            object_id: Its id.
            world_from_object: [4,4] float64 pose, m.
            parent: Id of the receptacle that it stands on.
        """
        lower, upper = self.bounds
        origin = np.array([(lower[0] + upper[0]) / 2, (lower[1] + upper[1]) / 2, lower[2]])
        groups: dict[int, list[tuple[Mesh, Material]]] = {}
        for mesh, material in self._parts:
            groups.setdefault(id(material), []).append((mesh, material))
        return HomeObject(
            id=object_id,
            type=self.type,
            surfaces=tuple(_surface(parts, origin) for parts in groups.values()),
            boxes=_round(np.array(self._boxes) - origin),
            world_from_object=world_from_object,
            movable=self.movable,
            receptacle=self.receptacle,
            parent=parent,
        )


def _surface(parts: list[tuple[Mesh, Material]], origin: Floats) -> Surface:
    """Return the surface of the parts of one material; textures start elsewhere on every part."""
    material = parts[0][1]
    starts = np.cumsum([0] + [len(mesh.vertices) for mesh, _ in parts])
    shifts = (np.arange(len(parts))[:, None] * (0.377, 0.619)) % 1
    if material.fitted:
        shifts[:] = 0
    uvs = [m.uvs_m / material.size_m + s for (m, _), s in zip(parts, shifts, strict=True)]
    faces = [m.faces + start for (m, _), start in zip(parts, starts, strict=False)]
    return Surface(
        vertices=_round(np.concatenate([mesh.vertices for mesh, _ in parts]) - origin),
        faces=np.concatenate(faces).astype(np.int32),
        uvs=np.round(np.concatenate(uvs), 6).astype(np.float32),
        texture=material.texture,
        emission=material.emission,
    )


def _round(lengths_m: Floats) -> Floats:
    """Round to the micrometre: the last bits of sines depend on the machine."""
    return np.round(lengths_m, 6) + 0.0
