"""Beds and bedding."""

from __future__ import annotations

import numpy as np

from gslts_sim.procedural import fabrics
from gslts_sim.procedural.catalog import materials
from gslts_sim.procedural.catalog.parts import legs
from gslts_sim.procedural.model import Kit, Model
from gslts_sim.procedural.shapes import box, cushion


def bed(kit: Kit, width: float = 0.0) -> Model:
    """Build a bed with a headboard, a mattress and a blanket, its head towards +y.

    Args:
        kit: Materials, style and random stream of the home.
        width: Along x, m; 0 samples one.
    """
    width = width or float(kit.rng.choice([1.0, 1.4, 1.6]))
    model = Model("Bed", receptacle=True)
    wood, length = materials.wood(kit), 2.0
    legs(model, width, length, 0.12, 0.07, wood)
    model.add(box(width + 0.04, length, 0.16), wood, (0, 0, 0.12))
    linen = kit.material(fabrics.weave, 0.32, 384, (0.93, 0.92, 0.89), (0.82, 0.82, 0.82), 128)
    model.add(cushion(width, length - 0.04, 0.22, 0.06), linen, (0, 0, 0.28))
    cover = kit.style.motif % 2
    cloth = materials.print_cloth(kit, cover)
    reach = 1.3
    spread = cushion(width + 0.07, reach, 0.27, 0.035)
    model.add(spread, cloth, (0, -(length - reach) / 2 - 0.03, 0.255))
    turned_back = cushion(width + 0.08, 0.28, 0.05, 0.02)
    model.add(turned_back, materials.fabric(kit), (0, reach - length / 2 - 0.18, 0.5), solid=False)
    top = reach - length / 2 - 0.18
    model.fills((-width / 2, top - 0.14, 0.5), (width / 2, top + 0.14, 0.55))
    board = length / 2 + 0.03
    if cover:
        model.add(box(width + 0.1, 0.06, 1.0), wood, (0, board, 0))
        for k in range(3):
            panel = box(width / 3 - 0.06, 0.01, 0.34)
            x = (k - 1) * width / 3
            model.add(panel, materials.second_wood(kit), (x, board - 0.033, 0.58), solid=False)
    else:
        model.add(box(width + 0.04, 0.05, 0.5), wood, (0, board, 0))
        padded = cushion(width + 0.04, 0.6, 0.1, 0.045).rotate("x", np.pi / 2)
        model.add(padded, materials.second_fabric(kit), (0, board + 0.05, 0.8))
    return model


def pillow(kit: Kit) -> Model:
    """Build a bed pillow that lies flat.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("Pillow", movable=True)
    cloth = materials.print_cloth(kit, int(kit.rng.integers(3)))
    model.add(cushion(0.6, 0.4, 0.13, 0.06, 0.7), cloth)
    return model


def throw_pillow(kit: Kit) -> Model:
    """Build a square scatter cushion that leans back, as a `Pillow`.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("Pillow", movable=True)
    side = float(kit.rng.uniform(0.34, 0.4))
    cloth = materials.print_cloth(kit, int(kit.rng.integers(4)))
    model.add(cushion(side, side, 0.13, 0.06, 0.75).rotate("x", np.pi / 2 - 0.3), cloth)
    return model


def towel(kit: Kit) -> Model:
    """Build a folded towel or blanket.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("Cloth", movable=True)
    cloth = materials.print_cloth(kit, int(kit.rng.integers(4)))
    for k in range(3):
        model.add(cushion(0.3 - 0.006 * k, 0.22, 0.028, 0.013), cloth, (0, 0, 0.027 * k))
    return model
