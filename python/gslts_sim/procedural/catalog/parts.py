"""Parts that many objects have: legs, knobs, handles, frames."""

from __future__ import annotations

import numpy as np

from gslts_sim.procedural.mesh import Mesh, join
from gslts_sim.procedural.model import Material, Model
from gslts_sim.procedural.shapes import box, cylinder, tube


def legs(
    model: Model, width: float, depth: float, height: float, thickness: float, material: Material
) -> None:
    """Add four square legs.

    Args:
        model: Model to which the part is added.
        width: Between the outer sides along x, m.
        depth: Between the outer sides along y, m.
        height: Along z, m.
        thickness: Of a leg, m.
        material: Of the part.
    """
    x, y = (width - thickness) / 2, (depth - thickness) / 2
    for at in ((-x, -y, 0), (x, -y, 0), (-x, y, 0), (x, y, 0)):
        model.add(box(thickness, thickness, height), material, at)


def knob(model: Model, material: Material, at: tuple[float, float, float]) -> None:
    """Add a knob that sticks out of a front.

    Args:
        model: Model to which the part is added.
        material: Of the part.
        at: Its middle on the front, m.
    """
    model.add(cylinder(0.014, 0.025, n=12).rotate("x", np.pi / 2), material, at, solid=False)


def bar_handle(
    model: Model, material: Material, at: tuple[float, float, float], length: float, *, level: bool
) -> None:
    """Add a bar in front of a door.

    Args:
        model: Model to which the part is added.
        material: Of the part.
        at: Its middle on the door's surface, m.
        length: m.
        level: Horizontal instead of upright.
    """
    x, y, z = at
    half = (length / 2, 0.0) if level else (0.0, length / 2)
    ends = [(x - half[0], y, z - half[1]), (x + half[0], y, z + half[1])]
    out = [(a, b - 0.028, c) for a, b, c in ends]
    for end, outer in zip(ends, out, strict=True):
        model.add(tube([end, outer], 0.005, 6), material, solid=False)
    model.add(tube(out, 0.006, 8), material, solid=False)


def frame(width: float, height: float, border: float, depth: float) -> Mesh:
    """Build a rectangular frame that stands on its lower edge, its front towards -y.

    Args:
        width: Along x, m.
        height: Along z, m.
        border: Width of its sides, m.
        depth: Along y, m.
    """
    inner = height - 2 * border
    side = box(border, depth, inner)
    x = (width - border) / 2
    return join(
        [
            box(width, depth, border),
            box(width, depth, border).translate(z=height - border),
            side.translate(-x, 0, border),
            side.translate(x, 0, border),
        ]
    )


def ring_handle(radius: float, thickness: float, out: float) -> Mesh:
    """Build half a ring in the x-z plane, with ends at x = 0 and z = +-radius.

    Args:
        radius: Of the ends, m.
        thickness: Radius of the rod, m.
        out: Distance of its middle from x = 0, m.
    """
    angles = np.linspace(-np.pi / 2, np.pi / 2, 9)
    path = np.stack([out * np.cos(angles), 0 * angles, radius * np.sin(angles)], axis=1)
    return tube(path, thickness, 8)
