"""Furnishing of a living room: sofa and armchairs around a table, a television, shelves."""

from __future__ import annotations

import numpy as np

from gslts_sim.home import HomeObject
from gslts_sim.procedural.catalog import (
    bedding,
    decoration,
    electronics,
    food,
    seating,
    stationery,
    storage,
    tables,
    tableware,
)
from gslts_sim.procedural.receptacles import tops_m
from gslts_sim.procedural.rooms.common import (
    WindowPlan,
    hang_curtains,
    hang_somewhere,
    light_ceiling,
    raise_shell,
)
from gslts_sim.procedural.scene import Builder, Scene


def draw_size(rng: np.random.Generator) -> tuple[float, float, float]:
    """Sample width, depth and height, m.

    Args:
        rng: Random stream.
    """
    width, depth, height = rng.uniform(3.7, 6.0), rng.uniform(3.7, 5.0), rng.uniform(2.45, 2.8)
    return round(float(width), 2), round(float(depth), 2), round(float(height), 2)


def furnish(scene: Scene) -> None:
    """Furnish an empty room.

    Args:
        scene: The room.
    """
    rng = scene.rng
    screen_side = int(rng.integers(4))
    sofa_side, left, right = ((screen_side + k) % 4 for k in (2, 1, 3))
    window_side, door_side = (left, right) if rng.random() < 0.5 else (right, left)
    across = scene.sides[window_side].length
    if across > 4.2:
        windows = [
            WindowPlan(window_side, share * across, 1.0, 0.85, 2.15) for share in (0.28, 0.72)
        ]
    else:
        windows = [WindowPlan(window_side, across / 2, 1.7, 0.85, 2.15)]
    door_length = scene.sides[door_side].length
    door_at = float(rng.choice([0.8, door_length - 0.8]))
    raise_shell(
        scene, door_side, door_at, windows, accent=int(rng.choice([screen_side, sofa_side]))
    )
    for plan in windows:
        hang_curtains(scene, plan)
    stand, sofa, table = _seat_before_screen(scene, screen_side, sofa_side)
    _arm_chairs(scene, table, sofa)
    _along_walls(scene, [door_side, window_side, sofa_side, screen_side])
    for number in (sofa_side, sofa_side, door_side, window_side, screen_side):
        hang_somewhere(scene, decoration.painting, [number], 1.35)
    hang_somewhere(scene, storage.wall_shelf, [screen_side, door_side], 1.55, 0.9)
    light_ceiling(scene)
    _lay_out_small_things(scene, stand, sofa, table)


def _seat_before_screen(
    scene: Scene, screen_side: int, sofa_side: int
) -> tuple[HomeObject | None, HomeObject | None, HomeObject | None]:
    """Place the television, the sofa facing it, a rug and a table between."""
    rng = scene.rng
    side = scene.sides[screen_side]
    stand = screen = None
    middle = side.length * float(rng.uniform(0.45, 0.55))
    wide = float(rng.choice([1.2, 1.5, 1.8]))
    stand = scene.stand(scene.build(tables.tv_stand, wide), screen_side, middle)
    if stand:
        screen = scene.build(electronics.television, min(wide - 0.15, 1.25))
        scene.put(screen, stand, (0, 0), (0.2, 0.3), (0, 0))
    sofa_thing = scene.build(seating.sofa)
    room_depth = scene.sides[(screen_side + 1) % 4].length
    # In a deep room the sofa stands free, with a passage behind it.
    behind = room_depth - 0.45 - 2.6 - 0.9
    gap = behind if behind > 0.85 else 0.04
    sofa = scene.stand(sofa_thing, sofa_side, side.length - middle, gap)
    if sofa is None:
        sofa = scene.stand_somewhere(sofa_thing, [sofa_side], front=0.0)
    if sofa is None:
        return stand, None, None
    depth_between = room_depth - 0.45 - (gap + 0.9)
    front = sofa.world_from_object[:2, :2] @ np.array([0.0, -1.0])
    start = sofa.world_from_object[:2, 3] + front * 0.43
    rug_depth = min(1.5, depth_between - 0.7)
    yaw = scene.sides[sofa_side].yaw_rad
    center = start + front * (0.06 + rug_depth / 2)
    rug = None
    if rug_depth > 0.9:
        rug = scene.stand_at(
            scene.build(tables.rug_like, min(2.4, side.length - 1.2), rug_depth),
            float(center[0]), float(center[1]), yaw,
        )  # fmt: skip
    at = start + front * max(0.68, 0.06 + rug_depth / 2 - 0.05)
    parent = rug.id if rug else "Floor|1"
    table = scene.stand_at(
        scene.build(tables.coffee_table, float(rng.uniform(0.8, 1.1))),
        float(at[0]), float(at[1]), yaw, parent,
    )  # fmt: skip
    side_table = scene.build(tables.side_table)
    along = side.length - middle
    reach = float(sofa.boxes[:, 1, 0].max()) + 0.26
    for sign in (-1, 1):
        beside = scene.stand(side_table, sofa_side, along + sign * reach, gap + 0.02)
        if beside:
            scene.put(scene.build(electronics.desk_lamp), beside, (-0.2, 0.2), (0, 0.4))
            scene.put(scene.build(stationery.book), beside, y=(-1, -0.3))
            break
    return stand, sofa, table


def _arm_chairs(scene: Scene, table: HomeObject | None, sofa: HomeObject | None) -> None:
    """Place armchairs at the ends of the table, turned towards it."""
    if table is None or sofa is None:
        return
    rng = scene.rng
    chair = scene.build(seating.arm_chair)
    for sign in rng.permutation([-1, 1])[: int(rng.integers(1, 3))]:
        for distance in (1.65, 1.8, 2.0, 2.3):
            local = np.array([sign * distance, rng.uniform(-0.5, -0.1), 0.0, 1.0])
            at = table.world_from_object @ local
            base = float(np.arctan2(table.world_from_object[1, 0], table.world_from_object[0, 0]))
            yaw = base - sign * (np.pi / 2 + rng.uniform(-0.1, 0.45))
            placed = scene.stand_at(chair, float(at[0]), float(at[1]), float(yaw))
            if placed:
                if rng.random() < 0.7:
                    scene.put(
                        scene.build(bedding.throw_pillow),
                        placed,
                        (-0.1, 0.1),
                        (0.0, 0.7),
                        (-0.2, 0.2),
                        0.43,
                    )
                break


def _along_walls(scene: Scene, numbers: list[int]) -> None:
    """Place bookcases, a sideboard, lamps and plants, wherever there is room."""
    rng = scene.rng
    walls = [int(n) for n in rng.permutation(numbers)]
    for _ in range(int(rng.integers(1, 3))):
        width = float(rng.choice([0.7, 0.9, 1.1]))
        case = scene.stand_somewhere(scene.build(storage.bookcase, width), walls)
        if case:
            _fill_bookcase(scene, case)
    sideboard = scene.stand_somewhere(scene.build(storage.sideboard, 1.2), walls[::-1])
    if sideboard:
        ornaments: list[Builder] = [
            decoration.vase, decoration.statue, decoration.candle, stationery.book,
            decoration.house_plant, tableware.bowl, stationery.key_chain,
        ]  # fmt: skip
        for index in rng.permutation(len(ornaments))[:4]:
            scene.put(scene.build(ornaments[int(index)]), sideboard)
    scene.stand_somewhere(scene.build(electronics.floor_lamp), walls, 0.1, 0.0)
    tall = float(rng.uniform(0.9, 1.4))
    scene.stand_somewhere(scene.build(decoration.house_plant, tall), walls[::-1], 0.1, 0.0)
    if rng.random() < 0.5:
        scene.stand_somewhere(scene.build(seating.ottoman), walls, 0.1, 0.2)


def _fill_bookcase(scene: Scene, case: HomeObject) -> None:
    """Put rows of books, and ornaments between them, on each board."""
    rng = scene.rng
    extras: list[Builder] = [
        decoration.vase, decoration.statue, stationery.book, stationery.carton, decoration.candle,
        decoration.house_plant,
    ]  # fmt: skip
    width = float(np.ptp(case.boxes[:, :, 0]))
    for z in tops_m(case)[:-1]:
        for x in ((-1, -0.9), (0.9, 1)):
            if rng.random() < 0.75:
                row = float(rng.uniform(0.22, 0.42)) * width
                obj = scene.build(stationery.book_row, row)
                scene.put(obj, case, x, (-0.4, 0), (0, 0), float(z))
        if rng.random() < 0.6:
            extra = scene.build(extras[int(rng.integers(len(extras)))])
            scene.put(extra, case, turn=(-0.2, 0.2), near_z=float(z))


def _lay_out_small_things(
    scene: Scene, stand: HomeObject | None, sofa: HomeObject | None, table: HomeObject | None
) -> None:
    """Put the remote control and more on the table, pillows on the sofa, plants on the sill."""
    rng = scene.rng
    if sofa:
        for x in ((-1, -0.85), (0.85, 1), (-0.2, 0.2))[: int(rng.integers(2, 4))]:
            scene.put(scene.build(bedding.throw_pillow), sofa, x, (0.0, 0.7), (-0.2, 0.2), 0.43)
    if table:
        scene.put(scene.build(electronics.remote_control), table, turn=(-0.8, 0.8))
        lying: list[Builder] = [
            stationery.book, tableware.mug, stationery.newspaper, electronics.laptop,
            decoration.vase, tableware.bowl, electronics.cell_phone, decoration.candle,
            tableware.cup, stationery.credit_card, decoration.tissue_box, tableware.plate,
        ]  # fmt: skip
        for index in rng.permutation(len(lying))[: int(rng.integers(5, 8))]:
            scene.put(scene.build(lying[int(index)]), table, turn=(-0.6, 0.6))
    if stand:
        beside: list[Builder] = [
            decoration.house_plant, stationery.book, decoration.candle, decoration.statue,
            decoration.watering_can, food.apple,
        ]  # fmt: skip
        for index in rng.permutation(len(beside))[:3]:
            scene.put(scene.build(beside[int(index)]), stand)
    for pane in [obj for obj in scene.objects if obj.type == "Window"]:
        scene.put(scene.build(decoration.house_plant), pane, y=(-1, -0.9), near_z=0.0)
    for shelf in [obj for obj in scene.objects if obj.type == "Shelf"]:
        for builder in (stationery.book_row, decoration.vase, decoration.candle, decoration.statue):
            scene.put(scene.build(builder), shelf, turn=(0, 0))
    if rng.random() < 0.5:
        scene.stand_somewhere(scene.build(decoration.basket_ball), [0, 1, 2, 3], 0.05, 0.0)
