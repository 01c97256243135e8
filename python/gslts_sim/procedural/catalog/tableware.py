"""Plates, cups, pots and the like."""

from __future__ import annotations

import numpy as np

from gslts_sim.procedural import fabrics, prints, textures
from gslts_sim.procedural.catalog import materials
from gslts_sim.procedural.catalog.parts import ring_handle
from gslts_sim.procedural.inks import ink
from gslts_sim.procedural.model import Kit, Material, Model
from gslts_sim.procedural.noise import tint
from gslts_sim.procedural.shapes import box, cushion, cylinder, lathe, tube

GLAZES = ((0.94, 0.92, 0.88), (0.8, 0.86, 0.88), (0.9, 0.84, 0.72), (0.42, 0.55, 0.6))


def _glazed(kit: Kit, circumference: float, length: float, px: int = 160) -> Material:
    """Return printed earthenware for a lathe of this circumference and length of profile, m."""
    glaze = GLAZES[int(kit.rng.integers(len(GLAZES)))]
    band = ink(kit.rng)
    return kit.print_material(prints.plate_rings, (circumference, length), px, glaze, band)


def _length(profile: list[tuple[float, float]]) -> float:
    return float(np.linalg.norm(np.diff(np.array(profile), axis=0), axis=1).sum())


def mug(kit: Kit) -> Model:
    """Build a mug with a handle.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("Mug", movable=True)
    radius, height = 0.04, float(kit.rng.uniform(0.085, 0.105))
    profile = [
        (0, 0),
        (radius * 0.9, 0),
        (radius, 0.01),
        (radius, height),
        (radius - 0.004, height),
        (radius - 0.004, 0.008),
        (0, 0.008),
    ]
    glaze = _glazed(kit, 2 * np.pi * radius, _length(profile), 192)
    model.add(lathe(profile, 24), glaze)
    model.add(ring_handle(0.028, 0.006, 0.026), glaze, (radius - 0.002, 0, height / 2))
    return model


def cup(kit: Kit) -> Model:
    """Build a tea cup on its saucer.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("Cup", movable=True)
    saucer = [(0, 0), (0.035, 0), (0.07, 0.012), (0.068, 0.015), (0.03, 0.006), (0, 0.006)]
    glaze = _glazed(kit, 2 * np.pi * 0.07, _length(saucer), 160)
    model.add(lathe(saucer, 24), glaze)
    bowl = [
        (0, 0),
        (0.02, 0),
        (0.034, 0.018),
        (0.042, 0.06),
        (0.039, 0.06),
        (0.03, 0.02),
        (0, 0.01),
    ]
    model.add(lathe(bowl, 24), glaze, (0, 0, 0.006))
    model.add(ring_handle(0.016, 0.004, 0.018), glaze, (0.038, 0, 0.042), solid=False)
    return model


def plate(kit: Kit) -> Model:
    """Build a dinner plate.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("Plate", movable=True, receptacle=True)
    radius = float(kit.rng.uniform(0.11, 0.135))
    profile = [
        (0, 0),
        (radius * 0.6, 0),
        (radius, 0.018),
        (radius - 0.002, 0.021),
        (radius * 0.62, 0.006),
        (0, 0.006),
    ]
    model.add(
        lathe(profile, 36), _glazed(kit, 2 * np.pi * radius, _length(profile), 224), solid=False
    )
    half = radius * 0.6
    model.fills((-half, -half, 0), (half, half, 0.006))
    for x0, y0, x1, y1 in _rim_boxes(radius, half):
        model.fills((x0, y0, 0.006), (x1, y1, 0.021))
    return model


def _rim_boxes(outer: float, inner: float) -> list[tuple[float, float, float, float]]:
    """Return four boxes (left, front, right, rear) around a square opening."""
    return [
        (-outer, -outer, outer, -inner),
        (-outer, inner, outer, outer),
        (-outer, -inner, -inner, inner),
        (inner, -inner, outer, inner),
    ]


def bowl(kit: Kit) -> Model:
    """Build a bowl that can hold objects.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("Bowl", movable=True, receptacle=True)
    radius, height = float(kit.rng.uniform(0.08, 0.13)), float(kit.rng.uniform(0.06, 0.08))
    profile = [
        (0, 0),
        (radius * 0.5, 0),
        (radius * 0.85, height * 0.45),
        (radius, height),
        (radius - 0.004, height),
        (radius * 0.8, height * 0.47),
        (radius * 0.48, 0.008),
        (0, 0.008),
    ]
    model.add(
        lathe(profile, 32), _glazed(kit, 2 * np.pi * radius, _length(profile), 224), solid=False
    )
    half = radius * 0.7
    model.fills((-half, -half, 0), (half, half, 0.008))
    for x0, y0, x1, y1 in _rim_boxes(radius, half):
        model.fills((x0, y0, 0.0), (x1, y1, height))
    return model


def pan(kit: Kit) -> Model:
    """Build a frying pan.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("Pan", movable=True, receptacle=True)
    iron = kit.material(textures.speckles, 0.12, 192, (0.15, 0.15, 0.16), (0.32, 0.32, 0.33), 0.15)
    profile = [(0, 0), (0.1, 0), (0.128, 0.045), (0.125, 0.045), (0.098, 0.004), (0, 0.004)]
    model.add(lathe(profile, 32), iron, solid=False)
    model.fills((-0.1, -0.1, 0), (0.1, 0.1, 0.006))
    for x0, y0, x1, y1 in _rim_boxes(0.125, 0.1):
        model.fills((x0, y0, 0.006), (x1, y1, 0.045))
    model.add(
        tube([(0.12, 0, 0.035), (0.2, 0, 0.06), (0.3, 0, 0.065)], 0.011, 10),
        materials.second_wood(kit),
    )
    return model


def pot(kit: Kit) -> Model:
    """Build a pot with a lid and two handles.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("Pot", movable=True)
    colour = ink(kit.rng)
    body = materials.fleck(kit, colour, tint(colour, 1.0, 0.25), 0.12)
    dark = materials.plastic(kit, materials.BLACK)
    profile = [
        (0, 0),
        (0.095, 0),
        (0.1, 0.01),
        (0.1, 0.13),
        (0.104, 0.133),
        (0.09, 0.15),
        (0, 0.158),
    ]
    model.add(lathe(profile, 32), body)
    model.add(
        lathe([(0, 0), (0.012, 0), (0.02, 0.02), (0, 0.025)], 14), dark, (0, 0, 0.157), solid=False
    )
    for side in (0, np.pi):
        grip = ring_handle(0.03, 0.006, 0.03).rotate("x", np.pi / 2).translate(0.097, 0, 0.1)
        model.add(grip.rotate("z", side), dark)
    return model


def bottle(kit: Kit) -> Model:
    """Build a bottle with a label: oil, vinegar, juice.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("Bottle", movable=True)
    glass = ((0.16, 0.3, 0.16), (0.42, 0.24, 0.1), (0.75, 0.6, 0.2), (0.5, 0.16, 0.14))
    colour = glass[int(kit.rng.integers(len(glass)))]
    name = ("OIL", "VINEGAR", "JUICE", "SYRUP")[int(kit.rng.integers(4))]
    radius, height = 0.036, float(kit.rng.uniform(0.23, 0.28))
    profile = [
        (0, 0),
        (radius, 0),
        (radius, height * 0.6),
        (0.014, height * 0.78),
        (0.013, height * 0.94),
        (0, height * 0.94),
    ]
    model.add(lathe(profile, 24), materials.plastic(kit, colour))
    _label(model, kit, radius + 0.0006, height * 0.4, height * 0.12, name)
    model.add(
        cylinder(0.015, height * 0.07, n=16),
        materials.plastic(kit, materials.BLACK),
        (0, 0, height * 0.93),
        solid=False,
    )
    return model


def wine_bottle(kit: Kit) -> Model:
    """Build a bottle of wine.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("WineBottle", movable=True)
    glass = materials.plastic(kit, (0.1, 0.2, 0.12))
    profile = [
        (0, 0),
        (0.038, 0),
        (0.038, 0.19),
        (0.032, 0.215),
        (0.014, 0.24),
        (0.014, 0.3),
        (0, 0.3),
    ]
    model.add(lathe(profile, 24), glass)
    _label(model, kit, 0.0386, 0.1, 0.06, "WINE")
    return model


def soap_bottle(kit: Kit) -> Model:
    """Build a dispenser of soap.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("SoapBottle", movable=True)
    colour = ink(kit.rng)
    model.add(
        lathe([(0, 0), (0.032, 0), (0.032, 0.12), (0.012, 0.14), (0, 0.14)], 20),
        materials.plastic(kit, colour),
    )
    _label(model, kit, 0.0326, 0.07, 0.025, "SOAP")
    white = materials.plastic(kit, materials.WHITE)
    model.add(cylinder(0.006, 0.04, n=10), white, (0, 0, 0.14), solid=False)
    model.add(box(0.014, 0.05, 0.01), white, (0, -0.015, 0.175))
    return model


def _label(model: Model, kit: Kit, radius: float, height: float, z: float, name: str) -> None:
    """Add a printed label twice around a cylinder."""
    width = np.pi * radius
    label = kit.print_material(prints.package, (width, height), 160, name, ink(kit.rng))
    shell = [(radius - 0.0005, 0), (radius, 0), (radius, height), (radius - 0.0005, height)]
    model.add(lathe([*shell, shell[0]], 24), label, (0, 0, z), solid=False)


def shaker(kit: Kit, kind: str) -> Model:
    """Build a salt shaker or a pepper mill.

    Args:
        kit: Materials, style and random stream of the home.
        kind: `SaltShaker` or `PepperShaker`.
    """
    model = Model(kind, movable=True)
    wood = materials.second_wood(kit)
    body = materials.plastic(kit, materials.WHITE) if kind == "SaltShaker" else wood
    profile = [
        (0, 0),
        (0.022, 0),
        (0.024, 0.01),
        (0.015, 0.045),
        (0.02, 0.075),
        (0.012, 0.09),
        (0, 0.092),
    ]
    model.add(lathe(profile, 18), body)
    model.add(cylinder(0.0165, 0.008, n=18), materials.metal(kit), (0, 0, 0.042), solid=False)
    return model


def salt_shaker(kit: Kit) -> Model:
    """Build a shaker of salt.

    Args:
        kit: Materials, style and random stream of the home.
    """
    return shaker(kit, "SaltShaker")


def pepper_shaker(kit: Kit) -> Model:
    """Build a pepper mill.

    Args:
        kit: Materials, style and random stream of the home.
    """
    return shaker(kit, "PepperShaker")


def cutting_board(kit: Kit) -> Model:
    """Build a board to cut bread on.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("CuttingBoard", movable=True, receptacle=True)
    model.add(box(0.38, 0.26, 0.02), materials.second_wood(kit))
    return model


def knife(kit: Kit) -> Model:
    """Build a kitchen knife.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("Knife", movable=True)
    model.add(box(0.18, 0.03, 0.003), materials.metal(kit), (0.05, 0, 0.005), solid=False)
    model.add(cushion(0.11, 0.024, 0.016, 0.006), materials.second_wood(kit), (-0.09, 0, 0))
    model.fills((-0.035, -0.015, 0), (0.14, 0.015, 0.016))
    return model


def spoon(kit: Kit) -> Model:
    """Build a wooden spoon.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("Spoon", movable=True)
    wood = materials.second_wood(kit)
    model.add(tube([(-0.14, 0, 0.006), (0.1, 0, 0.006)], 0.006, 8), wood)
    model.add(cushion(0.07, 0.045, 0.014, 0.0065), wood, (0.12, 0, 0))
    return model


def paper_towel(kit: Kit) -> Model:
    """Build a roll of paper towels on its stand.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("PaperTowelRoll", movable=True)
    paper = kit.material(
        fabrics.pattern, 0.2, 256, (0.95, 0.94, 0.92), (0.72, 0.8, 0.88), (0.6, 0.7, 0.8), 2
    )
    wood = materials.second_wood(kit)
    model.add(cylinder(0.075, 0.015, n=28), wood)
    model.add(cylinder(0.058, 0.23, n=28), paper, (0, 0, 0.015))
    model.add(cylinder(0.012, 0.06, n=12), wood, (0, 0, 0.245))
    return model


def sponge(kit: Kit) -> Model:
    """Build a washing-up sponge.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("DishSponge", movable=True)
    yellow = materials.fleck(kit, (0.9, 0.78, 0.25), (0.7, 0.55, 0.12), 0.35)
    green = materials.fleck(kit, (0.2, 0.45, 0.25), (0.35, 0.6, 0.35), 0.4)
    model.add(box(0.1, 0.065, 0.024), yellow)
    model.add(box(0.1, 0.065, 0.008), green, (0, 0, 0.024))
    return model
