"""Plants, pictures, mirrors, toys and other decoration."""

from __future__ import annotations

import numpy as np

from gslts_sim.procedural import fabrics, pictures, prints, textures
from gslts_sim.procedural.catalog import materials
from gslts_sim.procedural.catalog.parts import frame, ring_handle
from gslts_sim.procedural.inks import ink
from gslts_sim.procedural.mesh import join
from gslts_sim.procedural.model import Kit, Model
from gslts_sim.procedural.shapes import box, cushion, cylinder, ellipsoid, lathe, leaf, sheet, tube


def vase(kit: Kit) -> Model:
    """Build a vase with a few stems.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("Vase", movable=True)
    height = float(kit.rng.uniform(0.16, 0.26))
    profile = np.array(
        [
            (0, 0),
            (0.3, 0),
            (0.45, 0.3),
            (0.4, 0.6),
            (0.2, 0.85),
            (0.28, 1.0),
            (0.25, 1.0),
            (0.17, 0.85),
            (0, 0.8),
        ]
    ) * (height * 0.55, height)
    length = float(np.linalg.norm(np.diff(profile, axis=0), axis=1).sum())
    around = 2 * np.pi * float(profile[:, 0].max())
    glaze = kit.print_material(
        prints.plate_rings, (around, length), 192, (0.85, 0.8, 0.7), kit.style.accent
    )
    model.add(lathe(profile, 28), glaze)
    green = kit.material(textures.streaks, 0.1, 96, (0.2, 0.36, 0.16), (0.36, 0.52, 0.26))
    bloom = materials.fleck(kit, ink(kit.rng), (0.95, 0.8, 0.4), 0.2)
    stems = int(kit.rng.integers(0, 6))
    for k in range(stems):
        angle, lean = 2 * np.pi * k / stems, 0.05 * float(kit.rng.uniform(0.4, 1))
        top = (lean * np.cos(angle), lean * np.sin(angle), height * 1.6 + 0.02 * (k % 3))
        model.add(tube([(0, 0, height * 0.82), top], 0.003, 6), green, solid=False)
        model.add(ellipsoid(0.045, 0.045, 0.035, 12), bloom, top, solid=False)
    if stems:
        model.fills((-0.05, -0.05, height), (0.05, 0.05, height * 1.6 + 0.06))
    return model


def house_plant(kit: Kit, height: float = 0.0) -> Model:
    """Build a plant in a pot: small ones are for sills and tables, tall ones for the floor.

    Args:
        kit: Materials, style and random stream of the home.
        height: Along z, m; 0 samples a small one.
    """
    height = height or float(kit.rng.uniform(0.25, 0.36))
    model = Model("HousePlant", movable=True)
    pot = min(0.16, 0.1 + 0.05 * height) if height > 0.5 else 0.065
    clay = materials.fleck(kit, (0.68, 0.38, 0.26), (0.8, 0.55, 0.42), 0.3)
    soil = materials.fleck(kit, (0.2, 0.14, 0.1), (0.36, 0.27, 0.2), 0.5)
    green = kit.material(textures.streaks, 0.12, 192, (0.14, 0.34, 0.14), (0.4, 0.58, 0.28))
    rim = pot * 1.6
    profile = [
        (0, 0),
        (pot * 0.7, 0),
        (pot, rim),
        (pot * 0.9, rim),
        (pot * 0.85, rim - 0.02),
        (0, rim - 0.02),
    ]
    model.add(lathe(profile, 26), clay)
    model.add(cylinder(pot * 0.86, 0.01, n=20), soil, (0, 0, rim - 0.028), solid=False)
    count = 22 if height > 0.5 else 12
    blades = []
    for k in range(count):
        angle = 2.4 * k + float(kit.rng.uniform(-0.3, 0.3))
        share = (k + 1) / count
        z = rim + (height - rim) * share * 0.85
        length = (height - rim) * (0.44 if height > 0.5 else 0.6) * (1.15 - 0.5 * share)
        blade = leaf(length, length * 0.42, 1.5 - 0.5 * share).rotate("y", -0.85 - 0.3 * share)
        blades.append(blade.rotate("z", angle).translate(z=z - 0.04))
    foliage = join(blades)
    model.add(foliage, green, solid=False)
    stem = tube([(0, 0, rim - 0.02), (0.01, 0, height * 0.85)], 0.006 + 0.004 * (height > 0.5), 8)
    model.add(stem, green, solid=False)
    # Tips of leaves may touch other objects.
    lower, upper = foliage.vertices.min(axis=0) * 0.85, foliage.vertices.max(axis=0) * 0.85
    model.fills((*lower[:2], rim), (*upper[:2], float(foliage.vertices[:, 2].max())))
    return model


def painting(kit: Kit) -> Model:
    """Build a framed picture.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("Painting")
    width = float(kit.rng.uniform(0.45, 0.95))
    height = width * float(kit.rng.choice([0.7, 0.8, 1.25]))
    border = 0.035
    wood = materials.second_wood(kit)
    model.add(frame(width, height, border, 0.03), wood)
    size = (width - 2 * border, height - 2 * border)
    canvas = kit.print_material(pictures.picture, size, 448)
    model.add(box(size[0], 0.015, size[1], upright=True), canvas, (0, 0.0075, border), solid=False)
    return model


def mirror(kit: Kit) -> Model:
    """Build a mirror in a frame; its glass shows a soft reflection of a room.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("Mirror")
    width, height, border = 0.55, 0.95, 0.05
    model.add(frame(width, height, border, 0.03), materials.wood(kit))
    size = (width - 2 * border, height - 2 * border)
    glass = kit.print_material(pictures.reflection, size, 256, kit.style.wall)
    model.add(box(size[0], 0.012, size[1], upright=True), glass, (0, 0.009, border), solid=False)
    return model


def wall_clock(kit: Kit) -> Model:
    """Build a round clock on a wall.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("Clock")
    rim = cylinder(0.15, 0.035, n=36).rotate("x", np.pi / 2).translate(0, 0.0175, 0.15)
    model.add(rim, materials.second_wood(kit))
    dial = kit.print_material(prints.clock_face, (0.28, 0.28), 192)
    face = cylinder(0.14, 0.004, n=36).rotate("x", np.pi / 2).translate(0, -0.0165, 0.15)
    model.add(face, dial, solid=False)
    return model


def curtains(kit: Kit, width: float, side: float, height: float) -> Model:
    """Build a rod with two curtains drawn aside.

    Args:
        kit: Materials, style and random stream of the home.
        width: Of the rod, m.
        side: Width of each curtain, m.
        height: Along z, m.
    """
    model = Model("Curtains")
    cloth = materials.second_fabric(kit) if kit.style.motif % 2 else materials.print_cloth(kit, 0)
    x = np.linspace(0, side, 36)
    folds = np.stack([x, 0.028 * np.sin(x / side * 2 * np.pi * 5)], axis=1)
    for at in (-width / 2, width / 2 - side):
        model.add(sheet(folds, 0.006, height), cloth, (at, -0.04, 0))
    metal = materials.metal(kit, materials.BRASS)
    rod = tube(
        [(-width / 2 - 0.06, -0.037, height + 0.01), (width / 2 + 0.06, -0.037, height + 0.01)],
        0.012,
        10,
    )
    model.add(rod, metal)
    for at in (-width / 2 - 0.04, width / 2 + 0.04):
        model.add(box(0.02, 0.06, 0.02), metal, (at, -0.005, height))
    return model


def candle(kit: Kit) -> Model:
    """Build a candle on a dish.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("Candle", movable=True)
    model.add(
        lathe([(0, 0), (0.05, 0), (0.055, 0.012), (0, 0.008)], 20),
        materials.metal(kit, materials.BRASS),
    )
    wax = materials.fleck(kit, ink(kit.rng), (0.95, 0.9, 0.8), 0.25)
    tall = float(kit.rng.uniform(0.08, 0.16))
    model.add(cylinder(0.026, tall, n=20), wax, (0, 0, 0.008))
    model.add(
        cylinder(0.002, 0.012, n=6),
        materials.plastic(kit, materials.BLACK),
        (0, 0, tall + 0.008),
        solid=False,
    )
    return model


def statue(kit: Kit) -> Model:
    """Build a turned figure of stone.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("Statue", movable=True)
    marble = kit.material(
        textures.stone, 0.2, 256, (0.82, 0.8, 0.76), (0.45, 0.43, 0.42), veined=True
    )
    model.add(box(0.09, 0.09, 0.03), marble)
    profile = [
        (0, 0.03),
        (0.035, 0.03),
        (0.028, 0.08),
        (0.045, 0.14),
        (0.04, 0.18),
        (0.018, 0.2),
        (0.016, 0.215),
        (0.03, 0.24),
        (0.022, 0.27),
        (0, 0.28),
    ]
    model.add(lathe(profile, 22), marble)
    return model


def teddy_bear(kit: Kit) -> Model:
    """Build a teddy bear that sits.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("TeddyBear", movable=True)
    plush = kit.material(fabrics.fur, 0.12, 192, (0.46, 0.29, 0.15), (0.72, 0.5, 0.3))
    pale = kit.material(fabrics.fur, 0.12, 128, (0.75, 0.6, 0.42), (0.9, 0.78, 0.6))
    dark = materials.plastic(kit, materials.BLACK)
    model.add(ellipsoid(0.17, 0.15, 0.19), plush)
    model.add(ellipsoid(0.11, 0.04, 0.12), pale, (0, -0.062, 0.03), solid=False)
    model.add(ellipsoid(0.14, 0.13, 0.13), plush, (0, -0.005, 0.165))
    model.add(ellipsoid(0.06, 0.05, 0.045), pale, (0, -0.065, 0.19), solid=False)
    model.add(ellipsoid(0.02, 0.015, 0.014, 10), dark, (0, -0.089, 0.215), solid=False)
    for x in (-1, 1):
        model.add(ellipsoid(0.055, 0.03, 0.055, 14), plush, (x * 0.055, 0, 0.265), solid=False)
        model.add(ellipsoid(0.013, 0.01, 0.014, 10), dark, (x * 0.028, -0.064, 0.24), solid=False)
        model.add(ellipsoid(0.065, 0.16, 0.07, 16), plush, (x * 0.065, -0.11, 0))
        model.add(ellipsoid(0.05, 0.012, 0.055, 12), pale, (x * 0.065, -0.188, 0.008), solid=False)
        model.add(ellipsoid(0.055, 0.12, 0.06, 16), plush, (x * 0.095, -0.045, 0.1), solid=False)
    return model


def basket_ball(kit: Kit) -> Model:
    """Build a ball with seams.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("BasketBall", movable=True)
    skin = materials.fleck(kit, (0.8, 0.42, 0.16), (0.62, 0.3, 0.1), 0.5)
    dark = materials.plastic(kit, materials.BLACK)
    side = 0.24
    model.add(ellipsoid(side, side, side, 28), skin)
    angles = np.linspace(0, 2 * np.pi, 25)
    # The seams stand out by half a millimetre, but not below.
    ring = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1) * (side / 2 - 0.0025)
    seam = tube(ring, 0.003, 6)
    for mesh in (seam, seam.rotate("x", np.pi / 2), seam.rotate("y", np.pi / 2)):
        model.add(mesh, dark, (0, 0, side / 2 + 0.0005))
    return model


def dumbbell(kit: Kit) -> Model:
    """Build a dumbbell with hexagonal heads.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("Dumbbell", movable=True)
    rubber = materials.fleck(kit, (0.16, 0.16, 0.18), (0.34, 0.34, 0.36), 0.35)
    label = materials.plastic(kit, kit.style.accent)
    half = 0.048 * np.sqrt(3) / 2
    for x in (-1, 1):
        head = cylinder(0.048, 0.075, n=6).rotate("y", np.pi / 2).rotate("x", np.pi / 6)
        model.add(head, rubber, (x * 0.095 - 0.0375, 0, half))
        cap = cylinder(0.026, 0.002, n=18).rotate("y", x * np.pi / 2)
        model.add(cap, label, (x * 0.1325, 0, half), solid=False)
    grip = tube([(-0.06, 0, half), (0.06, 0, half)], 0.015, 14)
    model.add(grip, materials.metal(kit))
    return model


def watering_can(kit: Kit) -> Model:
    """Build a watering can.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("WateringCan", movable=True)
    tin = materials.fleck(kit, kit.style.second_accent, (0.9, 0.9, 0.85), 0.1)
    model.add(lathe([(0, 0), (0.08, 0), (0.08, 0.14), (0.07, 0.15), (0, 0.145)], 24), tin)
    model.add(tube([(0.07, 0, 0.05), (0.15, 0, 0.13), (0.19, 0, 0.17)], 0.012, 10), tin)
    model.add(
        cylinder(0.014, 0.03, 0.03, n=14).rotate("y", 0.9), tin, (0.185, 0, 0.165), solid=False
    )
    handle = ring_handle(0.06, 0.007, 0.06).rotate("y", -np.pi / 2)
    model.add(handle, tin, (0, 0, 0.14), solid=False)
    model.fills((-0.06, -0.008, 0.14), (0.06, 0.008, 0.21))
    return model


def tissue_box(kit: Kit) -> Model:
    """Build a box of tissues, one of them pulled out.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("TissueBox", movable=True)
    model.add(box(0.23, 0.12, 0.08), materials.print_cloth(kit, 4))
    paper = materials.fleck(kit, (0.95, 0.95, 0.93), (0.86, 0.87, 0.88), 0.4)
    model.add(cushion(0.07, 0.012, 0.05, 0.005).rotate("z", 0.3), paper, (0, 0, 0.08))
    return model
