"""Parts that all rooms have: a door, windows with curtains, ceiling lamps, pictures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gslts_sim.home import AreaLight
from gslts_sim.procedural.catalog import building, decoration
from gslts_sim.procedural.catalog.building import Opening
from gslts_sim.procedural.scene import GAP_M, Builder, Scene

DOOR_SPACE_M = 0.95
"""Depth of the floor before a door that is kept free."""


@dataclass(frozen=True)
class WindowPlan:
    """Position and size of a window.

    Args:
        side: Number of the wall.
        middle: Along the wall from its left corner, m.
        width: m.
        bottom: Height of its lower edge, m.
        top: Height of its upper edge, m.
    """

    side: int
    middle: float
    width: float
    bottom: float
    top: float

    @property
    def opening(self) -> Opening:
        """The hole in the wall."""
        half = self.width / 2
        return Opening(self.middle - half, self.middle + half, self.bottom, self.top)


def raise_shell(
    scene: Scene, door_side: int, door_at: float, windows: list[WindowPlan], accent: int
) -> None:
    """Build walls, floor, ceiling, a door and windows.

    Args:
        scene: Still empty.
        door_side: Number of the wall with the door.
        door_at: Middle of the door along that wall, m.
        windows: At least one, none on the door.
        accent: Number of the wall with wallpaper; -1 for none.
    """
    width, height = building.DOOR_M
    openings: dict[int, list[Opening]] = {}
    door_hole = Opening(door_at - width / 2, door_at + width / 2, 0.0, height)
    openings.setdefault(door_side, []).append(door_hole)
    for plan in windows:
        openings.setdefault(plan.side, []).append(plan.opening)
    scene.shell(openings, accent)
    scene.hang(scene.build(building.door), door_side, door_at, 0.0, building.DOOR_DEPTH_M)
    half = width / 2 + 0.08
    scene.keep_free_at(
        scene.sides[door_side], (door_at - half, door_at + half), (0.0, DOOR_SPACE_M)
    )
    for sign in (1, -1):
        at = door_at + sign * (width / 2 + 0.17)
        if 0.1 < at < scene.sides[door_side].length - 0.1:
            scene.hang(scene.build(building.light_switch), door_side, at, 1.05)
            break
    for plan in windows:
        pane = scene.build(building.window, plan.width, plan.top - plan.bottom)
        scene.hang(pane, plan.side, plan.middle, plan.bottom, building.WINDOW_DEPTH_M)
    # One window gives the daylight of all: every light costs a renderer a ray a pixel.
    _daylight(scene, max(windows, key=lambda plan: plan.width))


def _daylight(scene: Scene, plan: WindowPlan) -> None:
    """Add soft light from a window, just before its pane."""
    side = scene.sides[plan.side]
    x, y = side.point(plan.middle, 0.02)
    high = plan.top - plan.bottom
    along = np.array([*side.along, 0.0]) * (plan.width - 0.15)
    scene.lights.append(
        AreaLight(
            center=np.array([x, y, plan.bottom + high / 2 + 0.02]),
            edge_u=np.array([0.0, 0.0, high - 0.2]),
            edge_v=-along,
            radiance=np.array([1.5, 1.65, 1.85]),
        )
    )


def hang_curtains(scene: Scene, plan: WindowPlan) -> None:
    """Hang curtains on both sides of a window, where there is room for them.

    Args:
        scene: The room.
        plan: The window.
    """
    top = min(plan.top + 0.12, scene.size[2] - 0.06)
    length = scene.sides[plan.side].length
    width = min(plan.width + 0.62, 2 * min(plan.middle, length - plan.middle) - 0.16)
    side = (width - plan.width) / 2 - 0.01
    for bottom in (0.04, plan.bottom - 0.12):
        cloth = scene.build(decoration.curtains, width, side, top - bottom - 0.02)
        if side > 0.1 and scene.hang(cloth, plan.side, plan.middle, bottom, before_opening=True):
            return


def light_ceiling(scene: Scene, strength: float = 1.0) -> None:
    """Add one ceiling lamp to a small room, two to a long one.

    Args:
        scene: The room.
        strength: Factor of the radiance.
    """
    width, depth, _ = scene.size
    warm = np.array([1.0, 0.94, 0.84]) * strength
    if max(width, depth) > 4.3:
        along_x = width > depth
        for share in (0.27, 0.73):
            x, y = (share * width, depth / 2) if along_x else (width / 2, share * depth)
            scene.ceiling_light(x, y, 0.66, 9.0 * warm)
    else:
        scene.ceiling_light(width / 2, depth / 2, 0.8, 11.0 * warm)


def hang_somewhere(
    scene: Scene, builder: Builder, numbers: list[int], bottom: float, *args: float
) -> bool:
    """Hang an object on the first of some walls that has room.

    Args:
        scene: The room.
        builder: Of the object.
        numbers: Of the walls, in this order.
        bottom: Height of its underside, m.
        *args: Passed to `builder`.

    Returns:
        Whether a wall had room.
    """
    obj = scene.build(builder, *args)
    half = float(obj.box_in_world[1, 0])
    for number in numbers:
        length = scene.sides[number].length
        if length < 2 * half + 0.4:
            continue
        middle = length / 2
        positions = np.arange(half + 0.15, length - half - 0.15, 0.15)
        for along in positions[np.argsort(np.abs(positions - middle), kind="stable")]:
            if scene.hang(obj, number, float(along), bottom, margin=GAP_M):
                return True
    return False
