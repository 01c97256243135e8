"""Books, papers, boxes and small personal objects."""

from __future__ import annotations

import numpy as np

from gslts_sim.procedural import prints, textures
from gslts_sim.procedural.catalog import materials
from gslts_sim.procedural.inks import INKS, ink
from gslts_sim.procedural.mesh import join
from gslts_sim.procedural.model import Kit, Model
from gslts_sim.procedural.shapes import box, cylinder, tube


def book(kit: Kit) -> Model:
    """Build a book that lies on its back: two covers, a spine on the left, pages between.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("Book", movable=True, receptacle=True)
    width, depth = float(kit.rng.uniform(0.13, 0.18)), float(kit.rng.uniform(0.19, 0.25))
    height, board = float(kit.rng.uniform(0.02, 0.045)), 0.003
    cover = kit.print_material(prints.book_cover, (width, depth), 224)
    paper = kit.material(textures.wood, 0.04, 96, (0.8, 0.76, 0.66), (0.95, 0.92, 0.84))
    model.add(box(width, depth, board, upright=True), cover, (0, 0, height - board), solid=False)
    model.add(box(width, depth, board, upright=True), cover, solid=False)
    model.add(
        box(board, depth, height - 2 * board), cover, (-(width - board) / 2, 0, board), solid=False
    )
    pages = box(width - 0.008, depth - 0.008, height - 2 * board)
    model.add(pages, paper, (-0.002, 0, board), solid=False)
    model.fills((-width / 2, -depth / 2, 0), (width / 2, depth / 2, height))
    return model


def book_row(kit: Kit, width: float = 0.0) -> Model:
    """Build books that stand side by side: a fixed `Book`, since nobody takes a whole row.

    Args:
        kit: Materials, style and random stream of the home.
        width: Along x, m; 0 samples one.
    """
    width = width or float(kit.rng.uniform(0.18, 0.4))
    model = Model("Books")
    height, depth = float(kit.rng.uniform(0.2, 0.25)), 0.16
    count = max(3, round(width / 0.034))
    spines = kit.print_material(prints.book_spines, (width, height), 320, count)
    paper = kit.material(textures.wood, 0.04, 96, (0.8, 0.76, 0.66), (0.95, 0.92, 0.84))
    model.add(box(width, 0.01, height, upright=True), spines, (0, -depth / 2, 0))
    model.add(box(width - 0.004, depth - 0.015, height - 0.006), paper, (0, -0.002, 0))
    model.add(box(width, 0.004, height), spines, (0, depth / 2 - 0.006, 0), solid=False)
    return model


def newspaper(kit: Kit) -> Model:
    """Build a folded newspaper.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("Newspaper", movable=True)
    page = kit.print_material(prints.newspaper, (0.28, 0.36), 448)
    model.add(box(0.28, 0.36, 0.008, upright=True), page)
    return model


def carton(kit: Kit) -> Model:
    """Build a cardboard box, as a `Box`.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("Box", movable=True, receptacle=True)
    width, depth = float(kit.rng.uniform(0.25, 0.38)), float(kit.rng.uniform(0.2, 0.3))
    height = float(kit.rng.uniform(0.14, 0.24))
    board = kit.print_material(prints.carton, (width, height), 256)
    model.add(box(width, depth, height, upright=True), board)
    return model


def credit_card(kit: Kit) -> Model:
    """Build a bank card.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("CreditCard", movable=True)
    model.add(
        box(0.086, 0.054, 0.0015, upright=True),
        kit.print_material(prints.card, (0.086, 0.054), 160),
    )
    return model


def key_chain(kit: Kit) -> Model:
    """Build keys on a ring with a tag.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("KeyChain", movable=True)
    steel, brass = materials.metal(kit), materials.metal(kit, materials.BRASS)
    angles = np.linspace(0, 2 * np.pi, 15)
    ring = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1) * 0.015
    model.add(tube(ring, 0.0012, 6), steel, (0, 0, 0.003))
    for angle, material in ((0.3, brass), (-0.4, steel)):
        bow = cylinder(0.011, 0.0025, n=14).translate(0.028)
        key = join([bow, box(0.035, 0.006, 0.0025).translate(0.055)])
        model.add(key.rotate("z", angle), material, (0, 0, 0.001))
    tag = materials.plastic(kit, ink(kit.rng))
    model.add(box(0.022, 0.04, 0.004), tag, (-0.024, 0, 0))
    return model


def pencil_cup(kit: Kit) -> Model:
    """Build pencils in a mug, as a `Cup`.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("PencilCup", movable=True)
    model.add(cylinder(0.038, 0.1, n=22), materials.print_cloth(kit, 3))
    for k in range(5):
        angle = 2 * np.pi * k / 5
        x, y = 0.018 * np.cos(angle), 0.018 * np.sin(angle)
        colour = materials.plastic(kit, INKS[k])
        model.add(tube([(x, y, 0.095), (1.7 * x, 1.7 * y, 0.17)], 0.0038, 6), colour, solid=False)
    model.fills((-0.035, -0.035, 0.1), (0.035, 0.035, 0.17))
    return model


def pen(kit: Kit) -> Model:
    """Build a pen that lies.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("Pen", movable=True)
    model.add(
        tube([(-0.06, 0, 0.006), (0.06, 0, 0.006)], 0.006, 10),
        materials.plastic(kit, ink(kit.rng)),
    )
    model.add(tube([(0.06, 0, 0.006), (0.075, 0, 0.006)], 0.003, 8), materials.metal(kit))
    return model
