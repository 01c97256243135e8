"""Food."""

from __future__ import annotations

import numpy as np

from gslts_sim.procedural import prints, textures
from gslts_sim.procedural.catalog import materials
from gslts_sim.procedural.inks import ink
from gslts_sim.procedural.model import Kit, Model
from gslts_sim.procedural.noise import Colour
from gslts_sim.procedural.shapes import box, cushion, cylinder, ellipsoid, lathe, tube


def bread(kit: Kit) -> Model:
    """Build a loaf with cuts across its crust.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("Bread", movable=True)
    crust = kit.material(textures.crust, 0.2, 256, (0.55, 0.32, 0.14), (0.8, 0.55, 0.28))
    crumb = kit.material(textures.crust, 0.1, 128, (0.88, 0.75, 0.52), (0.95, 0.86, 0.66))
    length = float(kit.rng.uniform(0.24, 0.3))
    model.add(cushion(length, 0.12, 0.105, 0.05, 0.3), crust)
    for x in np.linspace(-length * 0.3, length * 0.3, 4):
        cut = cushion(0.016, 0.075, 0.012, 0.005).rotate("z", 0.35)
        model.add(cut, crumb, (float(x), 0, 0.094), solid=False)
    return model


def _fruit(
    model: Model, kit: Kit, size: tuple[float, float, float], skin: Colour, flush: Colour
) -> Model:
    """Build a round fruit with a stalk."""
    model.add(ellipsoid(*size), kit.material(textures.fruit_skin, 0.3, 192, skin, flush))
    stalk = tube([(0, 0, size[2] * 0.94), (0.004, 0, size[2] * 1.15)], 0.0025, 6)
    model.add(stalk, materials.second_wood(kit), solid=False)
    return model


def apple(kit: Kit) -> Model:
    """Build an apple, red or green.

    Args:
        kit: Materials, style and random stream of the home.
    """
    skins = (((0.7, 0.12, 0.12), (0.9, 0.62, 0.25)), ((0.5, 0.66, 0.2), (0.8, 0.82, 0.4)))
    side = float(kit.rng.uniform(0.07, 0.082))
    skin = skins[int(kit.rng.integers(2))]
    return _fruit(Model("Apple", movable=True), kit, (side, side, side * 0.9), *skin)


def tomato(kit: Kit) -> Model:
    """Build a tomato.

    Args:
        kit: Materials, style and random stream of the home.
    """
    side = float(kit.rng.uniform(0.06, 0.075))
    return _fruit(
        Model("Tomato", movable=True),
        kit,
        (side, side, side * 0.82),
        (0.78, 0.14, 0.1),
        (0.9, 0.36, 0.16),
    )


def potato(kit: Kit) -> Model:
    """Build a potato.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("Potato", movable=True)
    skin = kit.material(textures.crust, 0.1, 128, (0.6, 0.45, 0.27), (0.76, 0.6, 0.38))
    model.add(ellipsoid(0.1, 0.065, 0.058), skin)
    return model


def lettuce(kit: Kit) -> Model:
    """Build a head of lettuce: leaves around a heart.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("Lettuce", movable=True)
    green = kit.material(textures.streaks, 0.12, 192, (0.36, 0.56, 0.2), (0.72, 0.84, 0.45))
    model.add(ellipsoid(0.15, 0.15, 0.12), green)
    for k in range(7):
        angle = 2 * np.pi * k / 7
        blade = ellipsoid(0.03, 0.1, 0.11, 12).rotate("x", -0.5).translate(0, 0.05, 0.012)
        model.add(blade.rotate("z", angle), green, solid=False)
    return model


def cereal_box(kit: Kit) -> Model:
    """Build a packet of food, as a `Box`.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("Box", movable=True)
    name = ("OATS", "CORN", "RICE", "PASTA", "TEA", "COCOA")[int(kit.rng.integers(6))]
    width, depth = float(kit.rng.uniform(0.13, 0.19)), float(kit.rng.uniform(0.05, 0.07))
    height = float(kit.rng.uniform(0.19, 0.28))
    front = kit.print_material(prints.package, (width, height), 256, name, ink(kit.rng))
    model.add(box(width, depth, height, upright=True), front)
    return model


def jar(kit: Kit) -> Model:
    """Build a storage jar with a wooden lid, as a `Jar`.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("Jar", movable=True)
    name = ("SUGAR", "FLOUR", "BEANS", "NUTS")[int(kit.rng.integers(4))]
    content = materials.fleck(kit, (0.85, 0.78, 0.64), (0.6, 0.44, 0.28), 0.4)
    model.add(cylinder(0.05, 0.13, n=24), content)
    label = kit.print_material(prints.package, (0.16, 0.06), 160, name, ink(kit.rng))
    shell = [(0.05, 0), (0.0506, 0), (0.0506, 0.06), (0.05, 0.06), (0.05, 0)]
    model.add(lathe(shell, 24), label, (0, 0, 0.03), solid=False)
    model.add(cylinder(0.052, 0.022, n=24), materials.second_wood(kit), (0, 0, 0.13))
    return model
