"""Devices."""

from __future__ import annotations

import numpy as np

from gslts_sim.procedural import prints
from gslts_sim.procedural.catalog import materials
from gslts_sim.procedural.catalog.parts import ring_handle
from gslts_sim.procedural.inks import ink
from gslts_sim.procedural.model import Kit, Model
from gslts_sim.procedural.shapes import box, cushion, cylinder, lathe, tube


def television(kit: Kit, width: float = 1.1) -> Model:
    """Build a flat screen on a foot, with a programme on.

    Args:
        kit: Materials, style and random stream of the home.
        width: Along x, m.
    """
    model = Model("Television")
    dark = materials.plastic(kit, materials.BLACK)
    height = width * 0.57
    model.add(box(0.45, 0.2, 0.015), dark)
    model.add(box(0.08, 0.04, 0.06), dark, (0, 0.02, 0.015))
    model.add(box(width, 0.045, height), dark, (0, 0.01, 0.07))
    size = (width - 0.03, height - 0.035)
    picture = kit.print_material(prints.broadcast, size, 512)
    model.add(box(size[0], 0.004, size[1], upright=True), picture, (0, -0.013, 0.09), solid=False)
    return model


def laptop(kit: Kit) -> Model:
    """Build an open laptop.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("Laptop", movable=True)
    body = ((0.75, 0.76, 0.78), (0.28, 0.28, 0.3), (0.85, 0.82, 0.76))[int(kit.rng.integers(3))]
    case = materials.metal(kit, body)
    width, depth = 0.33, 0.23
    model.add(box(width, depth, 0.018), case)
    keys = kit.print_material(prints.keyboard, (width, depth), 256, body)
    model.add(box(width, depth, 0.001, upright=True), keys, (0, 0, 0.018), solid=False)
    lid = box(width, 0.008, depth)
    size = (width - 0.016, depth - 0.02)
    screen = kit.print_material(prints.desktop, size, 320)
    face = box(*(size[0], 0.001, size[1]), upright=True).translate(0, -0.0045, 0.012)
    at = (0.0, depth / 2 - 0.003, 0.016)
    model.add(lid.rotate("x", -0.3), case, at)
    model.add(face.rotate("x", -0.3), screen, at, solid=False)
    return model


def cell_phone(kit: Kit) -> Model:
    """Build a telephone, screen up.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("CellPhone", movable=True)
    model.add(box(0.074, 0.15, 0.008), materials.plastic(kit, ink(kit.rng)))
    screen = kit.print_material(prints.phone, (0.07, 0.146), 160)
    model.add(box(0.07, 0.146, 0.001, upright=True), screen, (0, 0, 0.008), solid=False)
    return model


def remote_control(kit: Kit) -> Model:
    """Build a remote control, buttons up.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("RemoteControl", movable=True)
    model.add(cushion(0.05, 0.18, 0.018, 0.006), materials.plastic(kit, materials.BLACK))
    face = kit.print_material(prints.remote, (0.044, 0.172), 192)
    model.add(box(0.044, 0.172, 0.0015, upright=True), face, (0, 0, 0.017), solid=False)
    return model


def alarm_clock(kit: Kit) -> Model:
    """Build an alarm clock with two bells, or one with a display.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("AlarmClock", movable=True)
    colour = kit.style.accent
    case = materials.plastic(kit, colour)
    if kit.rng.random() < 0.5:
        model.add(cushion(0.17, 0.08, 0.09, 0.018), case)
        face = kit.print_material(prints.digits, (0.14, 0.06), 128, (0.95, 0.3, 0.2))
        model.add(box(0.14, 0.002, 0.06, upright=True), face, (0, -0.04, 0.015), solid=False)
        return model
    body = cylinder(0.055, 0.045, n=28).rotate("x", np.pi / 2).translate(0, 0.0225, 0.068)
    model.add(body, case)
    dial = kit.print_material(prints.clock_face, (0.1, 0.1), 128)
    glass = cylinder(0.05, 0.002, n=28).rotate("x", np.pi / 2).translate(0, -0.0225, 0.068)
    model.add(glass, dial, solid=False)
    brass = materials.metal(kit, materials.BRASS)
    for x in (-0.035, 0.035):
        model.add(lathe([(0, 0), (0.026, 0), (0.02, 0.018), (0, 0.024)], 16), brass, (x, 0, 0.118))
        model.add(tube([(x, 0, 0), (x * 0.7, 0, 0.03)], 0.005, 8), brass)
    model.add(ring_handle(0.02, 0.003, 0.02).rotate("y", -np.pi / 2), brass, (0, 0, 0.13))
    return model


def desk_lamp(kit: Kit) -> Model:
    """Build a lamp on a jointed arm, or one with a cloth shade.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("DeskLamp", movable=True)
    if kit.rng.random() < 0.5:
        base = materials.fleck(kit, kit.style.second_accent, (0.9, 0.88, 0.8), 0.12)
        profile = [(0, 0), (0.06, 0), (0.075, 0.05), (0.06, 0.12), (0.025, 0.18), (0.012, 0.24)]
        model.add(lathe([*profile, (0, 0.24)], 24), base)
        shade = [(0.13, 0.2), (0.085, 0.38), (0.083, 0.378), (0.128, 0.2)]
        cloth = materials.print_cloth(kit, 2)
        model.add(lathe([*shade, shade[0]], 28), cloth)
        return model
    colour = materials.plastic(kit, kit.style.accent)
    model.add(cylinder(0.085, 0.02, n=28), colour)
    arm = materials.metal(kit)
    model.add(tube([(0, 0, 0.02), (0, 0.07, 0.24)], 0.008), arm)
    model.add(tube([(0, 0.07, 0.24), (0, -0.09, 0.4)], 0.008), arm)
    cone = [(0, 0.1), (0.025, 0.1), (0.07, 0), (0.068, 0), (0.023, 0.095), (0, 0.095)][::-1]
    model.add(lathe(cone, 24).rotate("x", -0.5), colour, (0, -0.14, 0.33))
    return model


def floor_lamp(kit: Kit) -> Model:
    """Build a standing lamp with a drum shade.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("FloorLamp", movable=True)
    dark = materials.metal(kit, (0.3, 0.28, 0.26))
    model.add(cylinder(0.15, 0.025, n=32), dark)
    model.add(cylinder(0.012, 1.35, n=12), dark, (0, 0, 0.025))
    shade = [(0.22, 1.25), (0.17, 1.55), (0.168, 1.55), (0.218, 1.25), (0.22, 1.25)]
    model.add(lathe(shade, 36), materials.print_cloth(kit, 4))
    return model


def coffee_machine(kit: Kit) -> Model:
    """Build a filter machine with its jug.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("CoffeeMachine", movable=True, receptacle=True)
    case = materials.plastic(kit, materials.BLACK if kit.style.motif % 2 else kit.style.accent)
    steel = materials.metal(kit)
    model.add(cushion(0.2, 0.26, 0.03, 0.01), case)
    model.add(cushion(0.2, 0.1, 0.33, 0.015), case, (0, 0.08, 0.01))
    model.add(cushion(0.2, 0.25, 0.1, 0.02), case, (0, 0.005, 0.25))
    jug = [(0, 0.03), (0.06, 0.03), (0.072, 0.08), (0.055, 0.16), (0.045, 0.175), (0, 0.175)]
    model.add(lathe(jug, 24), materials.plastic(kit, (0.2, 0.12, 0.08)), (0, -0.045, 0))
    model.add(
        ring_handle(0.045, 0.007, 0.04).rotate("z", -np.pi / 2), steel, (0, -0.11, 0.1), solid=False
    )
    model.add(
        box(0.16, 0.002, 0.05, upright=True),
        kit.print_material(prints.digits, (0.16, 0.05), 96, (0.4, 0.85, 0.95)),
        (0, -0.121, 0.275),
        solid=False,
    )
    return model


def toaster(kit: Kit) -> Model:
    """Build a toaster with two slots.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("Toaster", movable=True)
    steel, dark = materials.metal(kit), materials.plastic(kit, materials.BLACK)
    model.add(cushion(0.28, 0.17, 0.18, 0.035), steel, (0, 0, 0.01))
    model.add(box(0.24, 0.13, 0.015), dark)
    for y in (-0.03, 0.03):
        model.add(box(0.19, 0.025, 0.003), dark, (0, y, 0.189), solid=False)
    model.add(box(0.02, 0.03, 0.02), dark, (0.145, 0, 0.12), solid=False)
    return model


def microwave(kit: Kit) -> Model:
    """Build a microwave oven.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("Microwave", receptacle=True)
    case, dark = materials.metal(kit), materials.plastic(kit, materials.BLACK)
    model.add(box(0.48, 0.34, 0.26), case, (0, 0, 0.012))
    for x in (-0.2, 0.2):
        model.add(box(0.03, 0.28, 0.012), dark, (x, 0, 0))
    model.add(box(0.34, 0.012, 0.23), dark, (-0.06, -0.172, 0.027), solid=False)
    face = kit.print_material(prints.digits, (0.1, 0.05), 96, (0.3, 0.95, 0.5))
    model.add(box(0.1, 0.003, 0.05, upright=True), face, (0.175, -0.171, 0.2), solid=False)
    for row in range(4):
        for column in range(3):
            at = (0.145 + 0.03 * column, -0.172, 0.05 + 0.034 * row)
            model.add(box(0.022, 0.006, 0.022), dark, at, solid=False)
    model.add(tube([(0.095, -0.195, 0.06), (0.095, -0.195, 0.22)], 0.007, 8), case, solid=False)
    return model


def kettle(kit: Kit) -> Model:
    """Build a kettle with a handle above and a spout.

    Args:
        kit: Materials, style and random stream of the home.
    """
    model = Model("Kettle", movable=True)
    enamel = materials.fleck(kit, kit.style.second_accent, (0.95, 0.93, 0.86), 0.1)
    dark = materials.plastic(kit, materials.BLACK)
    body = [(0, 0), (0.08, 0), (0.095, 0.03), (0.085, 0.1), (0.05, 0.14), (0, 0.145)]
    model.add(lathe(body, 28), enamel)
    model.add(
        lathe([(0, 0), (0.014, 0.005), (0.012, 0.022), (0, 0.027)], 12),
        dark,
        (0, 0, 0.145),
        solid=False,
    )
    model.add(tube([(0.08, 0, 0.06), (0.115, 0, 0.1), (0.13, 0, 0.13)], 0.014, 10), enamel)
    handle = ring_handle(0.07, 0.008, 0.09).rotate("y", -np.pi / 2)
    model.add(handle, dark, (0, 0, 0.125), solid=False)
    model.fills((-0.08, -0.01, 0.14), (0.08, 0.01, 0.225))
    return model
