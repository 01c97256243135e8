"""Wardrobes, shelves and other storage furniture."""

from __future__ import annotations

import numpy as np

from gslts_sim.procedural import fabrics
from gslts_sim.procedural.catalog import materials
from gslts_sim.procedural.catalog.parts import bar_handle, frame, knob, legs
from gslts_sim.procedural.model import Kit, Model
from gslts_sim.procedural.shapes import box, cylinder


def dresser(kit: Kit, width: float = 0.0) -> Model:
    """Build a chest of drawers in two columns.

    Args:
        kit: Materials, style and random stream of the home.
        width: Along x, m; 0 samples one.
    """
    width = width or float(kit.rng.choice([0.8, 1.0, 1.2]))
    model = Model("Dresser", receptacle=True)
    wood, depth, height = materials.wood(kit), 0.46, 0.85
    legs(model, width - 0.04, depth - 0.04, 0.08, 0.05, wood)
    model.add(box(width, depth, height - 0.105), wood, (0, 0, 0.08))
    model.add(box(width + 0.03, depth + 0.03, 0.025), wood, (0, 0, height - 0.025))
    front = (
        materials.second_wood(kit)
        if kit.style.motif < 3
        else materials.painted_wood(kit, kit.style.front)
    )
    brass = materials.metal(kit, materials.BRASS)
    rows, gap = 4, 0.012
    tall = (height - 0.105) / rows
    for row in range(rows):
        for x in (-width / 4, width / 4):
            at = (x, -depth / 2 - 0.005, 0.08 + gap / 2 + row * tall)
            model.add(box(width / 2 - 0.03, 0.016, tall - gap), front, at, solid=False)
            for side in (-0.1, 0.1):
                knob(model, brass, (x + side, -depth / 2 - 0.013, 0.08 + (row + 0.5) * tall))
    return model


def wardrobe(kit: Kit, width: float = 0.0) -> Model:
    """Build a wardrobe with panelled doors.

    Args:
        kit: Materials, style and random stream of the home.
        width: Along x, m; 0 samples one.
    """
    width = width or float(kit.rng.choice([1.0, 1.2, 1.5]))
    model = Model("Wardrobe", receptacle=True)
    wood, depth, height = materials.wood(kit), 0.58, 2.0
    model.add(box(width, depth, height - 0.06), wood, (0, 0, 0.06))
    model.add(box(width - 0.06, depth - 0.06, 0.06), wood)
    model.add(box(width + 0.03, depth + 0.02, 0.03), wood, (0, 0, height))
    doors = round(width / 0.5)
    wide = width / doors
    steel = materials.metal(kit, materials.BRASS)
    for k in range(doors):
        x = (k - (doors - 1) / 2) * wide
        rail = frame(wide - 0.012, height - 0.12, 0.08, 0.02)
        model.add(rail, wood, (x, -depth / 2 - 0.008, 0.09), solid=False)
        inner = box(wide - 0.17, 0.01, height - 0.28)
        model.add(inner, materials.second_wood(kit), (x, -depth / 2 - 0.004, 0.17), solid=False)
        side = 1 if k % 2 == 0 else -1
        at = (x + side * (wide / 2 - 0.045), -depth / 2 - 0.018, 1.0)
        bar_handle(model, steel, at, 0.16, level=False)
    return model


def bookcase(kit: Kit, width: float = 0.8, height: float = 1.8) -> Model:
    """Build open shelves with a back; each board carries objects.

    Args:
        kit: Materials, style and random stream of the home.
        width: Along x, m.
        height: Along z, m.
    """
    model = Model("ShelvingUnit", receptacle=True)
    wood, depth, board = materials.wood(kit), 0.3, 0.022
    for x in (-1, 1):
        model.add(box(board, depth, height), wood, (x * (width - board) / 2, 0, 0))
    inner = width - 2 * board
    model.add(box(inner, 0.01, height), materials.second_wood(kit), (0, depth / 2 - 0.005, 0))
    count = round(height / 0.36)
    for z in np.linspace(0.06, height - board, count + 1):
        model.add(box(inner, depth - 0.01, board), wood, (0, -0.005, float(z)))
    model.add(box(inner, 0.02, 0.06), wood, (0, -depth / 2 + 0.02, 0))
    return model


def wall_shelf(kit: Kit, width: float = 0.8) -> Model:
    """Build a board on two brackets that hangs on a wall.

    Args:
        kit: Materials, style and random stream of the home.
        width: Along x, m.
    """
    model = Model("Shelf", receptacle=True)
    model.add(box(width, 0.22, 0.025), materials.wood(kit), (0, 0, 0.12))
    dark = materials.metal(kit, materials.BLACK)
    for x in (-width / 2 + 0.12, width / 2 - 0.12):
        model.add(box(0.02, 0.012, 0.12), dark, (x, 0.104, 0))
        model.add(box(0.02, 0.18, 0.012), dark, (x, 0.02, 0.108))
    return model


def sideboard(kit: Kit, width: float = 1.2) -> Model:
    """Build a low cupboard with doors, in living and dining rooms.

    Args:
        kit: Materials, style and random stream of the home.
        width: Along x, m.
    """
    model = Model("Cabinet", receptacle=True)
    wood, front = materials.wood(kit), materials.painted_wood(kit, kit.style.front)
    depth, height = 0.42, 0.8
    legs(model, width - 0.06, depth - 0.06, 0.12, 0.04, wood)
    model.add(box(width, depth, height - 0.12), wood, (0, 0, 0.12))
    doors = 3
    for k in range(doors):
        x = (k - 1) * width / doors
        panel = frame(width / doors - 0.02, height - 0.17, 0.05, 0.018)
        model.add(panel, front, (x, -depth / 2 - 0.007, 0.145), solid=False)
        inner = box(width / doors - 0.12, 0.008, height - 0.27)
        model.add(inner, materials.second_wood(kit), (x, -depth / 2 - 0.003, 0.195), solid=False)
        knob(model, materials.metal(kit, materials.BRASS), (x + 0.14, -depth / 2 - 0.015, 0.45))
    return model


def laundry_hamper(kit: Kit) -> Model:
    """Build a wicker basket with a lid.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("LaundryHamper", movable=True, receptacle=True)
    willow = kit.material(fabrics.wicker, 0.24, 256, (0.75, 0.58, 0.36))
    model.add(cylinder(0.19, 0.5, 0.21, n=28), willow)
    model.add(cylinder(0.215, 0.03, 0.2, n=28), willow, (0, 0, 0.5))
    return model


def garbage_can(kit: Kit) -> Model:
    """Build a pedal bin.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("GarbageCan", movable=True)
    steel, dark = materials.metal(kit), materials.plastic(kit, materials.BLACK)
    model.add(cylinder(0.14, 0.03, n=28), dark)
    model.add(cylinder(0.135, 0.42, n=28), steel, (0, 0, 0.03))
    model.add(cylinder(0.14, 0.05, 0.09, n=28), dark, (0, 0, 0.45))
    model.add(box(0.07, 0.05, 0.015), dark, (0, -0.15, 0.01), solid=False)
    return model
