"""Fitted kitchens: base units with worktops, sink, stove, fridge, wall cabinets."""

from __future__ import annotations

import numpy as np

from gslts_sim.procedural import pictures, textures
from gslts_sim.procedural.catalog import materials
from gslts_sim.procedural.catalog.parts import bar_handle, frame
from gslts_sim.procedural.model import Kit, Material, Model
from gslts_sim.procedural.noise import Colour
from gslts_sim.procedural.shapes import box, cylinder, tube

DEPTH_M, HEIGHT_M = 0.6, 0.9
SLAB_M, PLINTH_M = 0.04, 0.1


def worktop(kit: Kit) -> Material:
    """Return granite, marble or wood, by the style of the home.

    Args:
        kit: Materials, style and random stream of the home.
    """
    motif = kit.style.motif
    if motif in (0, 3):
        return materials.second_wood(kit)
    if motif in (1, 4):
        return kit.material(
            textures.stone, 0.9, 512, (0.93, 0.92, 0.9), (0.55, 0.54, 0.55), veined=True
        )
    return kit.material(
        textures.stone, 0.4, 512, (0.24, 0.24, 0.25), (0.62, 0.6, 0.57), veined=False
    )


def fronts(kit: Kit) -> Material:
    """Return painted or plain wood for doors and drawers.

    Args:
        kit: Materials, style and random stream of the home.
    """
    if kit.style.motif % 3 == 1:
        return materials.wood(kit)
    return materials.painted_wood(kit, kit.style.front)


def _door(
    model: Model, kit: Kit, width: float, height: float, at: tuple[float, float, float], side: int
) -> None:
    """Add a framed door; `side` is that of its handle, 0 for a drawer."""
    x, y, z = at
    material = fronts(kit)
    wide, high = width - 0.008, height - 0.008
    if side == 0:
        model.add(box(wide, 0.018, high), material, at, solid=False)
        handle = (x, y - 0.009, z + height * 0.5)
        bar_handle(model, materials.metal(kit), handle, min(0.16, width / 2), level=True)
        return
    model.add(frame(wide, high, 0.06, 0.02), material, at, solid=False)
    inner = box(wide - 0.12, 0.01, high - 0.12)
    model.add(inner, material, (x, y + 0.004, z + 0.06), solid=False)
    handle = (x + side * (width / 2 - 0.035), y - 0.01, z + height / 2)
    bar_handle(model, materials.metal(kit), handle, 0.14, level=False)


def _carcass(model: Model, kit: Kit, width: float, height: float) -> None:
    """Add the body of base units: plinth and box, below the worktop."""
    body = materials.painted_wood(kit, materials.WHITE)
    model.add(
        box(width, DEPTH_M - 0.08, PLINTH_M), materials.plastic(kit, materials.BLACK), (0, 0.03, 0)
    )
    model.add(box(width, DEPTH_M - 0.04, height), body, (0, 0.01, PLINTH_M))


def counter_top(kit: Kit, width: float) -> Model:
    """Build a run of base units under one worktop.

    Args:
        kit: Materials, style and random stream of the home.
        width: Along x, m.
    """
    model = Model("CounterTop", receptacle=True)
    tall = HEIGHT_M - SLAB_M - PLINTH_M
    _carcass(model, kit, width, tall)
    count = max(1, round(width / 0.5))
    wide = width / count
    front = -DEPTH_M / 2 + 0.02
    drawers = int(kit.rng.integers(count + 1))
    for k in range(count):
        x = (k - (count - 1) / 2) * wide
        if k == drawers:
            for row in range(3):
                _door(model, kit, wide, tall / 3, (x, front, PLINTH_M + row * tall / 3), 0)
        else:
            _door(model, kit, wide, tall, (x, front, PLINTH_M), 1 if k % 2 == 0 else -1)
    model.add(box(width, DEPTH_M, SLAB_M), worktop(kit), (0, 0, HEIGHT_M - SLAB_M))
    return model


def sink(kit: Kit, width: float = 0.8) -> Model:
    """Build a base unit with a steel basin, a worktop around it and a tap.

    Args:
        kit: Materials, style and random stream of the home.
        width: Along x, m.
    """
    model = Model("Sink", receptacle=True)
    bottom = HEIGHT_M - 0.2
    _carcass(model, kit, width, bottom - PLINTH_M)
    tall = HEIGHT_M - SLAB_M - PLINTH_M
    for side in (-1, 1):
        x = side * width / 4
        _door(model, kit, width / 2, tall, (x, -DEPTH_M / 2 + 0.02, PLINTH_M), -side)
    slab, steel = worktop(kit), materials.metal(kit)
    rim_x, front, rear = (width - 0.56) / 2, 0.08, 0.12
    top = HEIGHT_M - SLAB_M
    for x in (-1, 1):
        model.add(box(rim_x, DEPTH_M, SLAB_M), slab, (x * (width - rim_x) / 2, 0, top))
    model.add(box(0.56, front, SLAB_M), slab, (0, (front - DEPTH_M) / 2, top))
    model.add(box(0.56, rear, SLAB_M), slab, (0, (DEPTH_M - rear) / 2, top))
    depth = DEPTH_M - front - rear
    y = (front - rear) / 2
    model.add(box(0.56, depth, 0.004), steel, (0, y, bottom))
    model.add(
        cylinder(0.04, 0.002),
        materials.plastic(kit, materials.BLACK),
        (0, y, bottom + 0.004),
        solid=False,
    )
    wall = HEIGHT_M - bottom
    for x in (-1, 1):
        model.add(box(0.008, depth, wall), steel, (x * 0.276, y, bottom))
    for edge in (-1, 1):
        model.add(box(0.56, 0.008, wall), steel, (0, y + edge * (depth / 2 - 0.004), bottom))
    # Behind the doors and beside the basin.
    body = materials.painted_wood(kit, materials.WHITE)
    for x in (-1, 1):
        model.add(
            box(rim_x - 0.005, DEPTH_M - 0.04, top - bottom), body,
            (x * (width - rim_x) / 2, 0.01, bottom),
        )  # fmt: skip
    model.add(box(0.56, 0.03, top - bottom), body, (0, -DEPTH_M / 2 + 0.045, bottom))
    return model


def faucet(kit: Kit) -> Model:
    """Build a swan-necked tap that stands behind a basin.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("Faucet")
    steel = materials.metal(kit, (0.8, 0.81, 0.83))
    model.add(cylinder(0.025, 0.05, n=20), steel)
    angles = np.linspace(0, np.pi, 10)
    bend = np.stack([0 * angles, -0.08 + 0.08 * np.cos(angles), 0.22 + 0.08 * np.sin(angles)], 1)
    model.add(tube([(0, 0, 0.05), *bend, (0, -0.16, 0.17)], 0.011, 12), steel, solid=False)
    model.fills((-0.012, -0.172, 0.16), (0.012, 0.012, 0.31))
    model.add(tube([(0.02, 0, 0.035), (0.08, 0, 0.06)], 0.007, 8), steel, solid=False)
    return model


def stove(kit: Kit) -> Model:
    """Build a cooker: oven door with a window, knobs, a dark hob.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("Stove", receptacle=True)
    width = 0.6
    enamel = materials.metal(kit)
    dark = materials.plastic(kit, materials.BLACK)
    model.add(box(width, DEPTH_M - 0.04, HEIGHT_M - 0.02), enamel, (0, 0.01, 0))
    hob = kit.material(textures.speckles, 0.2, 256, (0.09, 0.09, 0.1), (0.3, 0.3, 0.32), 0.16)
    model.add(box(width, DEPTH_M - 0.03, 0.02), hob, (0, 0.015, HEIGHT_M - 0.02))
    front = -DEPTH_M / 2 + 0.02
    model.add(box(width - 0.02, 0.02, 0.5), enamel, (0, front, 0.22), solid=False)
    model.add(box(width - 0.14, 0.01, 0.28), hob, (0, front - 0.008, 0.3), solid=False)
    model.add(box(width - 0.02, 0.02, 0.17), enamel, (0, front, 0.03), solid=False)
    bar_handle(model, enamel, (0, front - 0.008, 0.67), 0.46, level=True)
    for k in range(5):
        knob = cylinder(0.02, 0.025, n=16).rotate("x", np.pi / 2)
        model.add(knob, dark, (-0.2 + 0.1 * k, front + 0.01, 0.79), solid=False)
    return model


def stove_burner(kit: Kit) -> Model:
    """Build a burner with its grate.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("StoveBurner", receptacle=True)
    iron = materials.plastic(kit, (0.16, 0.16, 0.17))
    model.add(cylinder(0.045, 0.014, n=24), materials.metal(kit, (0.4, 0.4, 0.42)), solid=False)
    for angle in np.pi / 4 * np.arange(4):
        x, y = 0.1 * np.cos(angle), 0.1 * np.sin(angle)
        model.add(tube([(-x, -y, 0.015), (x, y, 0.015)], 0.005, 6), iron, solid=False)
    model.fills((-0.1, -0.1, 0), (0.1, 0.1, 0.02))
    return model


def fridge(kit: Kit) -> Model:
    """Build a fridge with a freezer below, magnets and notes on its door.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("Fridge", receptacle=True)
    width, depth, height = 0.62, 0.6, 1.78
    colour = materials.STEEL if kit.style.motif % 2 else materials.WHITE
    steel = materials.metal(kit, colour)
    model.add(box(width, depth, height), steel)
    front = -depth / 2 - 0.012
    for z, tall in ((0.05, 0.6), (0.67, height - 0.69)):
        model.add(box(width - 0.005, 0.035, tall), steel, (0, front, z), solid=False)
    handle = materials.metal(kit, (0.5, 0.5, 0.52))
    bar_handle(model, handle, (width / 2 - 0.06, front - 0.017, 0.95), 0.4, level=False)
    bar_handle(model, handle, (width / 2 - 0.06, front - 0.017, 0.45), 0.3, level=False)
    for _ in range(4):
        wide, tall = kit.rng.uniform(0.06, 0.13), kit.rng.uniform(0.07, 0.15)
        at = (float(kit.rng.uniform(-0.2, 0.1)), front - 0.019, float(kit.rng.uniform(1.15, 1.5)))
        note = kit.print_material(pictures.picture, (float(wide), float(tall)), 96)
        model.add(box(float(wide), 0.002, float(tall), upright=True), note, at, solid=False)
    return model


def wall_cabinet(kit: Kit, width: float) -> Model:
    """Build a cabinet that hangs on a wall.

    Args:
        kit: Materials, style and random stream of the home.
        width: Along x, m.
    """
    model = Model("Cabinet", receptacle=True)
    depth, height = 0.34, 0.68
    model.add(
        box(width, depth - 0.02, height), materials.painted_wood(kit, materials.WHITE), (0, 0.01, 0)
    )
    count = max(1, round(width / 0.45))
    wide = width / count
    for k in range(count):
        x = (k - (count - 1) / 2) * wide
        _door(model, kit, wide, height, (x, -depth / 2 + 0.01, 0), 1 if k % 2 == 0 else -1)
    return model


def hood(kit: Kit) -> Model:
    """Build an extractor hood.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("RangeHood")
    steel = materials.metal(kit)
    model.add(box(0.6, 0.48, 0.06), steel)
    lower = cylinder(0.42, 0.2, 0.19, n=4).rotate("z", np.pi / 4)
    model.add(lower.scale(0.98, 0.78), steel, (0, 0, 0.06))
    model.add(box(0.26, 0.24, 0.4), steel, (0, 0.12, 0.2))
    return model


def splash_back(kit: Kit, width: float, height: float = 0.55) -> Model:
    """Build tiles on the wall above a worktop.

    Args:
        kit: Materials, style and random stream of the home.
        width: Along x, m.
        height: Along z, m.
    """
    model = Model("Backsplash")
    style = kit.style
    light: Colour = (0.93, 0.93, 0.9)
    if style.motif % 2:
        tiles = kit.material(textures.tiles, 0.6, 512, light, style.accent, (6, 6), checkered=True)
    else:
        tiles = kit.material(textures.tiles, 0.6, 512, light, (0.8, 0.86, 0.86), (8, 4), bond=True)
    model.add(box(width, 0.008, height, upright=True), tiles)
    return model
