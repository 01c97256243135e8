"""Parts that many things have: legs, knobs, handles, frames."""

from __future__ import annotations

import numpy as np

from gslts_sim.procedural.model import Material, Model
from gslts_sim.procedural.shapes import Mesh, box, cylinder, joined, tube


def legs(
    model: Model, width: float, depth: float, height: float, thickness: float, material: Material
) -> None:
    """Four square legs, their outer sides `width` and `depth` apart, m."""
    x, y = (width - thickness) / 2, (depth - thickness) / 2
    for at in ((-x, -y, 0), (x, -y, 0), (-x, y, 0), (x, y, 0)):
        model.add(box(thickness, thickness, height), material, at)


def knob(model: Model, material: Material, at: tuple[float, float, float]) -> None:
    """A knob that sticks out of a front."""
    model.add(cylinder(0.014, 0.025, n=12).turned("x", np.pi / 2), material, at, solid=False)


def bar_handle(
    model: Model, material: Material, at: tuple[float, float, float], length: float, *, level: bool
) -> None:
    """A bar in front of a door, `at` its middle on the door's surface."""
    x, y, z = at
    half = (length / 2, 0.0) if level else (0.0, length / 2)
    ends = [(x - half[0], y, z - half[1]), (x + half[0], y, z + half[1])]
    out = [(a, b - 0.028, c) for a, b, c in ends]
    for end, outer in zip(ends, out, strict=True):
        model.add(tube([end, outer], 0.005, 6), material, solid=False)
    model.add(tube(out, 0.006, 8), material, solid=False)


def frame(width: float, height: float, border: float, depth: float) -> Mesh:
    """A rectangular frame that stands on its lower edge, its front towards -y."""
    inner = height - 2 * border
    side = box(border, depth, inner)
    x = (width - border) / 2
    return joined(
        [
            box(width, depth, border),
            box(width, depth, border).moved(z=height - border),
            side.moved(-x, 0, border),
            side.moved(x, 0, border),
        ]
    )


def ring_handle(radius: float, thickness: float, out: float) -> Mesh:
    """Half a ring in the x-z plane, its ends at x = 0 and z = +-radius."""
    angles = np.linspace(-np.pi / 2, np.pi / 2, 9)
    path = np.stack([out * np.cos(angles), 0 * angles, radius * np.sin(angles)], axis=1)
    return tube(path, thickness, 8)
