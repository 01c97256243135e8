"""Furnishing of a bedroom: a bed with night tables, a wardrobe, a dresser, a desk."""

from __future__ import annotations

import numpy as np

from gslts_sim.home import HomeObject
from gslts_sim.procedural.catalog import (
    bedding,
    decoration,
    electronics,
    seating,
    stationery,
    storage,
    tables,
    tableware,
)
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
    width, depth, height = rng.uniform(3.2, 4.8), rng.uniform(3.2, 4.6), rng.uniform(2.4, 2.75)
    return round(float(width), 2), round(float(depth), 2), round(float(height), 2)


def furnish(scene: Scene) -> None:
    """Furnish an empty room.

    Args:
        scene: The room.
    """
    rng = scene.rng
    head = int(rng.integers(4))
    foot, left, right = ((head + k) % 4 for k in (2, 1, 3))
    window_side, door_side = (left, right) if rng.random() < 0.5 else (right, left)
    across = scene.sides[window_side].length
    windows = [WindowPlan(window_side, across * float(rng.uniform(0.45, 0.6)), 1.4, 0.9, 2.1)]
    door_length = scene.sides[door_side].length
    # The door is at the foot of the bed; which end of its wall that is depends on the side.
    door_at = 0.8 if door_side == (head + 3) % 4 else door_length - 0.8
    raise_shell(scene, door_side, door_at, windows, accent=head if rng.random() < 0.7 else -1)
    for plan in windows:
        hang_curtains(scene, plan)
    bed = _make_bed(scene, head)
    _along_walls(scene, foot, window_side, door_side)
    hang_somewhere(scene, decoration.painting, [head], 1.35)
    for number in (foot, door_side, window_side):
        hang_somewhere(scene, decoration.painting, [number], 1.35)
    hang_somewhere(scene, storage.wall_shelf, [door_side, foot, window_side], 1.5, 0.8)
    light_ceiling(scene)
    _lay_out_small_things(scene, bed)


def _make_bed(scene: Scene, head: int) -> HomeObject | None:
    """Place the bed with pillows, night tables beside it and a rug at its foot."""
    rng = scene.rng
    side = scene.sides[head]
    bed = None
    for width in (1.6, 1.4, 1.0)[int(rng.integers(3)) :]:
        half = width / 2
        free = side.length - 2 * half - 1.1
        middle = side.length / 2 + (rng.uniform(-0.3, 0.3) if free > 0.6 else 0.0)
        bed = scene.stand(scene.build(bedding.bed, width), head, float(middle))
        if bed:
            break
    if bed is None:
        return None
    for x in (-0.9, 0.9) if width > 1.2 else (0.0,):
        spot = (x - 0.05, x + 0.05)
        scene.put(scene.build(bedding.pillow), bed, spot, (0.86, 0.9), (-0.06, 0.06), near_z=0.5)
    half = float(bed.boxes[:, 1, 0].max())
    for sign in (-1, 1):
        table = scene.build(tables.side_table)
        beside = scene.stand(table, head, float(middle) + sign * (half + 0.28), 0.02)
        if beside:
            _on_night_table(scene, beside)
    rug = scene.build(tables.rug_like, 1.7, 1.1)
    at = bed.world_from_object @ np.array([0.0, -1.75, 0.0, 1.0])
    scene.stand_at(rug, float(at[0]), float(at[1]), side.yaw_rad)
    return bed


def _on_night_table(scene: Scene, table: HomeObject) -> None:
    rng = scene.rng
    scene.put(scene.build(electronics.desk_lamp), table, (-0.3, 0.3), (0.5, 1), (-0.2, 0.2))
    objs: list[Builder] = [
        electronics.alarm_clock, stationery.book, electronics.cell_phone, tableware.mug,
        decoration.tissue_box, tableware.cup,
    ]  # fmt: skip
    for index in rng.permutation(len(objs))[:3]:
        scene.put(scene.build(objs[int(index)]), table, y=(-1, 0.6))
    scene.put(scene.build(stationery.book), table, near_z=0.14)


def _along_walls(scene: Scene, foot: int, window_side: int, door_side: int) -> None:
    """Place wardrobe, dresser with a mirror, desk with a chair, hamper and plant."""
    rng = scene.rng
    walls = [door_side, foot, window_side]
    scene.stand_somewhere(scene.build(storage.wardrobe), walls, front=0.55)
    dresser = scene.stand_somewhere(scene.build(storage.dresser), [foot, door_side, window_side])
    if dresser:
        number = int(np.argmin([abs(_against(scene, k, dresser)) for k in range(4)]))
        side = scene.sides[number]
        along = float((dresser.world_from_object[:2, 3] - side.start) @ side.along)
        scene.hang(scene.build(decoration.mirror), number, along, 1.05)
        objs: list[Builder] = [
            decoration.vase, stationery.carton, decoration.candle, bedding.towel, tableware.bowl,
            decoration.house_plant, stationery.key_chain, electronics.alarm_clock, stationery.book,
            decoration.statue, stationery.credit_card,
        ]  # fmt: skip
        for index in rng.permutation(len(objs))[:5]:
            scene.put(scene.build(objs[int(index)]), dresser)
    desk = scene.stand_somewhere(
        scene.build(tables.desk), [window_side, foot, door_side], front=0.6
    )
    if desk:
        _set_desk(scene, desk)
    scene.stand_somewhere(scene.build(storage.laundry_hamper), walls, 0.04, 0.0)
    scene.stand_somewhere(
        scene.build(decoration.house_plant, float(rng.uniform(0.8, 1.3))), walls[::-1], 0.1, 0.0
    )
    if rng.random() < 0.4:
        scene.stand_somewhere(scene.build(seating.arm_chair), walls, 0.1, 0.3)


def _against(scene: Scene, number: int, obj: HomeObject) -> float:
    """Return the distance of an object's back from a wall that it could stand against, m."""
    side = scene.sides[number]
    facing = obj.world_from_object[:2, :2] @ np.array([0.0, -1.0])
    out = float((obj.world_from_object[:2, 3] - side.start) @ side.inward)
    return out if facing @ side.inward > 0.9 else np.inf


def _set_desk(scene: Scene, desk: HomeObject) -> None:
    """Put computer, lamp and papers on the desk, and the chair before it."""
    rng = scene.rng
    chair = scene.build(seating.desk_chair)
    yaw = float(np.arctan2(desk.world_from_object[1, 0], desk.world_from_object[0, 0]))
    for out in (0.42, 0.5, 0.6, 0.72):
        at = desk.world_from_object @ np.array([-0.18, -out, 0.0, 1.0])
        turn = yaw + np.pi + float(rng.uniform(-0.25, 0.25))
        if scene.stand_at(chair, float(at[0]), float(at[1]), turn, in_the_way=True):
            break
    scene.put(scene.build(electronics.laptop), desk, (-0.5, 0.1), (-0.2, 0.3), (-0.2, 0.2))
    scene.put(scene.build(electronics.desk_lamp), desk, (0.7, 1), (0.5, 1))
    objs: list[Builder] = [
        stationery.book, stationery.pencil_cup, stationery.pen, tableware.mug, stationery.newspaper,
        electronics.cell_phone, stationery.book, stationery.credit_card,
    ]  # fmt: skip
    for index in rng.permutation(len(objs))[:5]:
        scene.put(scene.build(objs[int(index)]), desk)


def _lay_out_small_things(scene: Scene, bed: HomeObject | None) -> None:
    """Put a toy on the bed, books on the shelf, weights and a ball on the floor."""
    rng = scene.rng
    if bed:
        scene.put(
            scene.build(decoration.teddy_bear), bed, (-0.7, 0.7), (-0.6, 0.1), (-0.6, 0.6), 0.525
        )
        scene.put(scene.build(bedding.towel), bed, (-0.8, 0.8), (-0.9, -0.5), near_z=0.525)
    for shelf in [obj for obj in scene.objects if obj.type == "Shelf"]:
        for builder in (stationery.book_row, decoration.house_plant, decoration.vase):
            scene.put(scene.build(builder), shelf, turn=(0, 0))
    for pane in [obj for obj in scene.objects if obj.type == "Window"]:
        scene.put(scene.build(decoration.house_plant), pane, y=(-1, -0.9), near_z=0.0)
    for builder in (decoration.dumbbell, decoration.dumbbell, decoration.basket_ball):
        if rng.random() < 0.7:
            scene.stand_somewhere(scene.build(builder), [0, 1, 2, 3], 0.05, 0.0)
    tops = [obj for obj in scene.objects if obj.type == "Wardrobe"]
    for wardrobe in tops:
        scene.put(scene.build(stationery.carton), wardrobe)
