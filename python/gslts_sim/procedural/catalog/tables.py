"""Tables and desks."""

from __future__ import annotations

import numpy as np

from gslts_sim.procedural import fabrics
from gslts_sim.procedural.catalog import materials
from gslts_sim.procedural.catalog.parts import knob, legs
from gslts_sim.procedural.model import Kit, Model
from gslts_sim.procedural.noise import tint
from gslts_sim.procedural.shapes import box, cylinder


def dining_table(kit: Kit, width: float = 1.4, depth: float = 0.85) -> Model:
    """Build a rectangular table with an apron.

    Args:
        kit: Materials, style and random stream of the home.
        width: Along x, m.
        depth: Along y, m.
    """
    model = Model("DiningTable", receptacle=True)
    wood = materials.wood(kit)
    height, top = 0.74, 0.035
    legs(model, width - 0.06, depth - 0.06, height - top, 0.06, wood)
    model.add(box(width, depth, top), wood, (0, 0, height - top))
    for y in (-1, 1):
        model.add(
            box(width - 0.2, 0.02, 0.07), wood, (0, y * (depth / 2 - 0.06), height - top - 0.07)
        )
    for x in (-1, 1):
        model.add(
            box(0.02, depth - 0.2, 0.07), wood, (x * (width / 2 - 0.06), 0, height - top - 0.07)
        )
    return model


def round_table(kit: Kit, radius: float = 0.5) -> Model:
    """Build a round dining table on a column; its boxes leave the corners out.

    Args:
        kit: Materials, style and random stream of the home.
        radius: m.
    """
    model = Model("DiningTable", receptacle=True)
    wood = materials.wood(kit)
    model.add(cylinder(radius, 0.03, n=48), wood, (0, 0, 0.71), solid=False)
    for share in (0.38, 0.7, 0.92):
        x, y = radius * share, radius * np.sqrt(1 - share**2)
        model.fills((-x, -y, 0.71), (x, y, 0.74))
    model.add(cylinder(0.05, 0.67, n=20), wood, (0, 0, 0.04))
    model.add(cylinder(0.27, 0.04, 0.2, n=32), wood)
    return model


def coffee_table(kit: Kit, width: float = 1.0) -> Model:
    """Build a low table with a shelf.

    Args:
        kit: Materials, style and random stream of the home.
        width: Along x, m.
    """
    model = Model("CoffeeTable", receptacle=True)
    wood, depth = materials.wood(kit), 0.55
    legs(model, width, depth, 0.38, 0.05, wood)
    model.add(box(width + 0.04, depth + 0.04, 0.035), wood, (0, 0, 0.38))
    model.add(box(width - 0.1, depth - 0.1, 0.02), materials.second_wood(kit), (0, 0, 0.12))
    return model


def side_table(kit: Kit) -> Model:
    """Build a small table with a drawer, beside a bed or a sofa.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("SideTable", receptacle=True)
    wood, side = materials.wood(kit), 0.43
    legs(model, side - 0.02, side - 0.04, 0.36, 0.035, wood)
    model.add(box(side - 0.02, side - 0.04, 0.15), wood, (0, 0, 0.36))
    model.add(box(side + 0.02, side, 0.025), wood, (0, 0, 0.51))
    front = materials.second_wood(kit)
    model.add(box(side - 0.07, 0.012, 0.11), front, (0, -side / 2 + 0.014, 0.38), solid=False)
    knob(model, materials.metal(kit, materials.BRASS), (0, -side / 2 + 0.01, 0.435))
    model.add(box(side - 0.08, side - 0.08, 0.018), wood, (0, 0, 0.12))
    return model


def desk(kit: Kit, width: float = 1.2) -> Model:
    """Build a writing desk with three drawers on its right.

    Args:
        kit: Materials, style and random stream of the home.
        width: Along x, m.
    """
    model = Model("Desk", receptacle=True)
    wood, front = materials.wood(kit), materials.painted_wood(kit, kit.style.front)
    depth, height = 0.6, 0.72
    model.add(box(width, depth, 0.03), wood, (0, 0, height))
    model.add(box(0.03, depth - 0.04, height), wood, (-width / 2 + 0.02, 0, 0))
    x = width / 2 - 0.2
    model.add(box(0.38, depth - 0.04, height), wood, (x, 0, 0))
    for k in range(3):
        at = (x, -depth / 2 + 0.014, 0.08 + 0.21 * k)
        model.add(box(0.34, 0.014, 0.19), front, at, solid=False)
        knob(model, materials.metal(kit), (x, -depth / 2 + 0.007, 0.175 + 0.21 * k))
    model.add(box(width - 0.44, 0.02, 0.35), wood, (-0.18, depth / 2 - 0.04, height - 0.35))
    return model


def tv_stand(kit: Kit, width: float = 1.4) -> Model:
    """Build a low board with two doors and an open middle.

    Args:
        kit: Materials, style and random stream of the home.
        width: Along x, m.
    """
    model = Model("TVStand", receptacle=True)
    wood, front = materials.wood(kit), materials.painted_wood(kit, kit.style.front)
    depth, height = 0.42, 0.48
    legs(model, width - 0.1, depth - 0.06, 0.1, 0.04, wood)
    third = width / 3
    model.add(box(width, depth, 0.025), wood, (0, 0, 0.1))
    model.add(box(width, depth, 0.025), wood, (0, 0, height - 0.025))
    model.add(box(third, 0.012, height - 0.15), wood, (0, depth / 2 - 0.006, 0.125))
    for x in (-third, third):
        model.add(box(third, depth, height - 0.15), wood, (x, 0, 0.125))
        door = box(third - 0.03, 0.014, height - 0.18)
        model.add(door, front, (x, -depth / 2 - 0.006, 0.14), solid=False)
        knob(model, materials.metal(kit, materials.BRASS), (x * 0.72, -depth / 2 - 0.013, 0.3))
    model.add(box(third, depth - 0.05, 0.018), wood, (0, 0, 0.28))
    return model


def rug_like(kit: Kit, width: float, depth: float) -> Model:
    """Build a rug.

    Args:
        kit: Materials, style and random stream of the home.
        width: Along x, m.
        depth: Along y, m.
    """
    model = Model("Rug", receptacle=True)
    style = kit.style
    ground = tint(style.accent, 0.55, 0.12)
    knotted = kit.print_material(
        fabrics.rug, (width, depth), 768, ground, (0.86, 0.8, 0.68), style.second_accent
    )
    model.add(box(width, depth, 0.01, upright=True), knotted)
    return model
