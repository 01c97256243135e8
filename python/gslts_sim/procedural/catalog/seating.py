"""Chairs, sofas and other seats."""

from __future__ import annotations

import numpy as np

from gslts_sim.procedural import fabrics
from gslts_sim.procedural.catalog import materials
from gslts_sim.procedural.catalog.parts import legs
from gslts_sim.procedural.model import Kit, Material, Model
from gslts_sim.procedural.shapes import box, cushion, cylinder, tube


def chair(kit: Kit) -> Model:
    """Build a dining chair with slats or a padded back.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("Chair", movable=True, receptacle=True)
    wood = materials.second_wood(kit)
    width, depth, seat = 0.43, 0.42, 0.45
    legs(model, width, depth, seat - 0.03, 0.035, wood)
    model.add(box(width, depth, 0.03), wood, (0, 0, seat - 0.03))
    model.add(
        cushion(width - 0.03, depth - 0.04, 0.025, 0.012),
        materials.print_cloth(kit, 1),
        (0, 0, seat),
    )
    back = depth / 2 - 0.0175
    for x in (-1, 1):
        model.add(box(0.035, 0.035, 0.43), wood, (x * (width - 0.035) / 2, back, seat))
    model.add(box(width - 0.07, 0.02, 0.07), wood, (0, back, seat + 0.35))
    if kit.style.motif % 2:
        for x in np.linspace(-0.12, 0.12, 4):
            model.add(box(0.03, 0.015, 0.25), wood, (x, back, seat + 0.1))
        model.add(box(width - 0.07, 0.02, 0.04), wood, (0, back, seat + 0.07))
    else:
        for k in range(3):
            model.add(box(width - 0.07, 0.015, 0.05), wood, (0, back, seat + 0.1 + 0.085 * k))
    return model


def sofa(kit: Kit, width: float = 0.0) -> Model:
    """Build a sofa with two or three seats.

    Args:
        kit: Materials, style and random stream of the home.
        width: Along x, m; 0 samples one.
    """
    seats = int(kit.rng.integers(2, 4))
    width = width or 0.66 * seats + 0.34
    model = Model("Sofa", receptacle=True)
    _upholstered(model, kit, width, seats, materials.fabric(kit), 0.17)
    return model


def arm_chair(kit: Kit) -> Model:
    """Build an armchair in cloth or leather.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("ArmChair", movable=True, receptacle=True)
    cover = (
        kit.material(fabrics.leather, 0.4, 384, (0.45, 0.27, 0.16))
        if kit.style.motif in (1, 4)
        else materials.second_fabric(kit)
    )
    _upholstered(model, kit, 0.84, 1, cover, 0.14)
    return model


def _upholstered(
    model: Model, kit: Kit, width: float, seats: int, cover: Material, arm: float
) -> None:
    """Add base, arms, back and a pair of cushions per seat."""
    depth, base, seat = 0.86, 0.12, 0.43
    legs(model, width - 0.06, depth - 0.06, base, 0.05, materials.wood(kit))
    model.add(cushion(width, depth, seat - base - 0.13, 0.03), cover, (0, 0, base))
    inner = (width - 2 * arm) / seats
    back = 0.22
    for x in (-1, 1):
        model.add(cushion(arm, depth, 0.5, 0.06), cover, (x * (width - arm) / 2, 0, base))
    model.add(cushion(width - 2 * arm, back, 0.66, 0.08), cover, (0, (depth - back) / 2, base))
    for k in range(seats):
        middle = (k - (seats - 1) / 2) * inner
        pad = cushion(inner - 0.01, depth - back - 0.01, 0.15, 0.05, 0.12)
        model.add(pad, cover, (middle, -back / 2, seat - 0.15))
        lean = cushion(inner - 0.02, 0.4, 0.17, 0.07, 0.35).rotate("x", np.pi / 2 - 0.12)
        model.add(lean, cover, (middle, depth / 2 - back + 0.02, seat + 0.19))


def ottoman(kit: Kit) -> Model:
    """Build a padded footstool.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("Ottoman", movable=True, receptacle=True)
    legs(model, 0.42, 0.42, 0.1, 0.04, materials.wood(kit))
    model.add(cushion(0.5, 0.5, 0.28, 0.05), materials.print_cloth(kit, 1), (0, 0, 0.1))
    return model


def desk_chair(kit: Kit) -> Model:
    """Build an office chair on a star-shaped base with castors, as a `Chair`.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("Chair", movable=True, receptacle=True)
    plastic, cover = materials.plastic(kit, materials.BLACK), materials.second_fabric(kit)
    for angle in 2 * np.pi / 5 * np.arange(5) + np.pi / 2:
        x, y = 0.27 * np.cos(angle), 0.27 * np.sin(angle)
        model.add(tube([(0, 0, 0.1), (x, y, 0.07)], 0.018, 8), plastic, solid=False)
        model.add(cylinder(0.025, 0.05, n=12), plastic, (x, y, 0), solid=False)
    model.fills((-0.27, -0.27, 0), (0.27, 0.27, 0.13))
    model.add(cylinder(0.025, 0.32, n=12), materials.metal(kit), (0, 0, 0.1))
    model.add(cushion(0.47, 0.46, 0.07, 0.03), cover, (0, 0, 0.42))
    model.add(box(0.06, 0.03, 0.2), plastic, (0, 0.22, 0.44))
    model.add(cushion(0.42, 0.07, 0.46, 0.033), cover, (0, 0.23, 0.58))
    return model
