"""Floor, walls, ceiling, windows, doors and their fixtures."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from gslts_sim.procedural import pictures, textures
from gslts_sim.procedural.catalog import materials
from gslts_sim.procedural.catalog.parts import frame, knob
from gslts_sim.procedural.model import Kit, Material, Model
from gslts_sim.procedural.noise import tint
from gslts_sim.procedural.shapes import box, cylinder

THICKNESS_M = 0.12
SKIRTING_M = 0.08


@dataclass(frozen=True)
class Opening:
    """Hole in a wall: from `left` to `right` along it and from `bottom` to `top`, m."""

    left: float
    right: float
    bottom: float
    top: float


def floor_material(kit: Kit, room_type: str) -> Material:
    """Return tiles for kitchens, boards or parquet for other rooms and some kitchens.

    Args:
        kit: Materials, style and random stream of the home.
        room_type: Such as `kitchen`.
    """
    style = kit.style
    if room_type == "kitchen" and style.motif < 4:
        light = ((0.85, 0.82, 0.76), (0.88, 0.87, 0.85), (0.74, 0.6, 0.48), (0.8, 0.8, 0.78))
        if style.motif == 1:
            return kit.material(
                textures.tiles, 1.2, 768, light[1], (0.34, 0.36, 0.38), (4, 4), checkered=True
            )
        second = tint(light[style.motif], 0.86)
        return kit.material(textures.tiles, 1.2, 768, light[style.motif], second, (3, 3))
    if style.motif % 3 == 2:
        return kit.material(textures.herringbone, 1.2, 800, *style.floor_wood)
    return kit.material(textures.planks, 1.6, 1024, *style.floor_wood)


def wall_material(kit: Kit) -> Material:
    """Return painted plaster.

    Args:
        kit: Materials, style and random stream of the home.
    """
    return kit.material(textures.plaster, 1.2, 768, kit.style.wall)


def accent_material(kit: Kit) -> Material:
    """Return wallpaper, or bricks, for one wall.

    Args:
        kit: Materials, style and random stream of the home.
    """
    style = kit.style
    if style.motif == 5:
        return kit.material(textures.bricks, 1.0, 768, (0.62, 0.35, 0.27), (0.75, 0.47, 0.36))
    ink = tuple(0.55 * w + 0.45 * a for w, a in zip(style.wall, style.second_accent, strict=True))
    return kit.material(textures.wallpaper, 0.8, 640, style.wall, ink, style.motif % 4)


def floor(kit: Kit, width: float, depth: float, room_type: str) -> Model:
    """Build the floor of a room.

    Args:
        kit: Materials, style and random stream of the home.
        width: Along x, m.
        depth: Along y, m.
        room_type: Such as `kitchen`.
    """
    model = Model("Floor", receptacle=True)
    model.add(box(width, depth, THICKNESS_M), floor_material(kit, room_type), (0, 0, -THICKNESS_M))
    return model


def ceiling(kit: Kit, width: float, depth: float) -> Model:
    """Build the ceiling of a room.

    Args:
        kit: Materials, style and random stream of the home.
        width: Along x, m.
        depth: Along y, m.
    """
    model = Model("Ceiling")
    white = kit.material(textures.plaster, 1.5, 512, (0.95, 0.94, 0.92))
    model.add(box(width, depth, THICKNESS_M), white)
    return model


def wall(kit: Kit, length: float, height: float, openings: list[Opening], *, accent: bool) -> Model:
    """Build a wall, its inner side at the front, with openings and a skirting board.

    Args:
        kit: Materials, style and random stream of the home.
        length: Along x, m.
        height: Along z, m.
        openings: Holes for windows and doors.
        accent: Use the accent material.
    """
    model = Model("Wall")
    # Fitted: one print runs over the whole wall, whatever pieces it is made of.
    material = replace(accent_material(kit) if accent else wall_material(kit), fitted=True)
    skirting = materials.painted_wood(kit, materials.WHITE)
    xs = sorted({0.0, length, *(x for o in openings for x in (o.left, o.right))})
    for left, right in pairwise(xs):
        holes = sorted((o.bottom, o.top) for o in openings if o.left < right and o.right > left)
        z = 0.0
        for bottom, top in [*holes, (height, height)]:
            if bottom > z:
                part = box(right - left, THICKNESS_M, bottom - z, upright=True)
                at = ((left + right - length) / 2, THICKNESS_M / 2, z)
                model.add(part.shift_texture(left, height - bottom), material, at)
            z = top
        if not any(bottom <= 0 for bottom, _ in holes):
            board = box(right - left, 0.012, SKIRTING_M)
            model.add(board, skirting, ((left + right - length) / 2, -0.006, 0), solid=False)
    return model


def window(kit: Kit, width: float, height: float) -> Model:
    """Build a window that fills an opening, with a sill that stands out into the room.

    Args:
        kit: Materials, style and random stream of the home.
        width: Along x, m.
        height: Along z, m.
    """
    model = Model("Window", receptacle=True)
    white = materials.painted_wood(kit, materials.WHITE)
    sill = 0.03
    model.add(box(width, 0.17, sill), white, (0, -0.025, 0))
    high = height - sill
    model.add(frame(width, high, 0.05, 0.05), white, (0, 0.035, sill))
    size = (width - 0.1, high - 0.1)
    view = kit.print_material(pictures.outdoors, size, 640)
    model.add(box(size[0], 0.01, size[1], upright=True), view, (0, 0.045, sill + 0.05))
    model.add(box(0.04, 0.03, size[1]), white, (0, 0.03, sill + 0.05), solid=False)
    if kit.style.motif % 2:
        model.add(box(size[0], 0.03, 0.03), white, (0, 0.03, sill + high * 0.62), solid=False)
    return model


WINDOW_DEPTH_M = 0.06
"""Depth to which a window reaches into its wall, m."""

DOOR_M = (0.86, 2.04)
DOOR_DEPTH_M = 0.08
"""Depth to which a door reaches into its wall, m."""


def door(kit: Kit) -> Model:
    """Build a closed door with panels, in an opening, and its casing on the wall.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("Door")
    width, height = DOOR_M
    white = materials.painted_wood(kit, materials.WHITE)
    leaf = materials.wood(kit) if kit.style.motif % 2 else white
    model.add(box(width, 0.045, height), leaf, (0, 0.0575, 0))
    for x in (-0.2, 0.2):
        for z, tall in ((0.18, 0.7), (1.05, 0.8)):
            model.add(frame(0.3, tall, 0.03, 0.014), leaf, (x, 0.032, z), solid=False)
    model.add(box(width, 0.035, 0.006), materials.wood(kit), (0, 0.0175, 0))
    border = 0.07
    for x in (-1, 1):
        at = (x * (width + border) / 2, -0.0075, 0.0)
        model.add(box(border, 0.015, height + border), white, at)
    model.add(box(width, 0.015, border), white, (0, -0.0075, height))
    brass = materials.metal(kit, materials.BRASS)
    knob(model, brass, (width / 2 - 0.07, 0.035, 1.02))
    grip = cylinder(0.01, 0.12, n=10).rotate("y", -np.pi / 2)
    model.add(grip, brass, (width / 2 - 0.06, 0.01, 1.02), solid=False)
    return model


def light_switch(kit: Kit) -> Model:
    """Build a switch beside a door.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("LightSwitch")
    white, ivory = (
        materials.plastic(kit, materials.WHITE),
        materials.plastic(kit, (0.8, 0.78, 0.72)),
    )
    model.add(box(0.085, 0.01, 0.085), white)
    model.add(box(0.05, 0.006, 0.05), ivory, (0, -0.007, 0.0175), solid=False)
    return model


def ceiling_lamp(kit: Kit, side: float) -> Model:
    """Build a flat square lamp.

    Args:
        kit: Materials, style and random stream of the home.
        side: Edge, m.
    """
    model = Model("CeilingLamp")
    glass = materials.fleck(kit, (0.98, 0.96, 0.9), (0.9, 0.86, 0.76), 0.25)
    glass = replace(glass, emission=0.6)
    model.add(
        frame(side, side, 0.03, 0.06).rotate("x", np.pi / 2).translate(0, side / 2, 0.03),
        materials.metal(kit),
    )
    model.add(box(side - 0.06, side - 0.06, 0.045), glass, (0, 0, 0.012))
    return model
