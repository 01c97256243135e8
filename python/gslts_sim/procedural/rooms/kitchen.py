"""Furnishing of a kitchen: fitted units, a table with chairs, dishes and food."""

from __future__ import annotations

import numpy as np

from gslts_sim.home import HomeObject
from gslts_sim.procedural.catalog import (
    decoration,
    electronics,
    food,
    kitchen,
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

SINK_M, STOVE_M, FRIDGE_M = 0.8, 0.6, 0.64
WALL_UNITS_FROM_M = 1.46


def draw_size(rng: np.random.Generator) -> tuple[float, float, float]:
    """Sample width, depth and height, m.

    Args:
        rng: Random stream.
    """
    width, depth, height = rng.uniform(3.0, 4.6), rng.uniform(3.0, 4.8), rng.uniform(2.45, 2.8)
    return round(float(width), 2), round(float(depth), 2), round(float(height), 2)


def furnish(scene: Scene) -> None:
    """Furnish an empty room.

    Args:
        scene: The room.
    """
    rng = scene.rng
    main = int(rng.integers(4))
    length = scene.sides[main].length
    order, edges = _planned_run(rng, length)
    sink_at = _middle(order, edges, "sink")
    windows = [
        WindowPlan(main, min(max(sink_at, 0.75), length - 0.75), 1.05, 1.25, 2.15),
    ]
    other = (main + int(rng.choice([1, 3]))) % 4
    door_side = (main + 2) % 4
    door_length = scene.sides[door_side].length
    door_at = float(rng.choice([0.75, door_length - 0.75]))
    if rng.random() < 0.6:
        across = scene.sides[other].length
        # Away from the units, whichever end of that wall they are at.
        from_units = max(0.6 * across, 1.4)
        at = from_units if other == (main + 1) % 4 else across - from_units
        windows.append(WindowPlan(other, at, 1.2, 0.95, 2.1))
    raise_shell(scene, door_side, door_at, windows, accent=int(rng.choice([-1, other, door_side])))
    units = _fit_units(scene, main, order, edges, windows[0])
    units += _turn_corner(scene, main, order, other if len(windows) > 1 else None)
    table = _dine(scene, main)
    scene.stand_somewhere(scene.build(storage.garbage_can), [other, door_side], front=0.0)
    if rng.random() < 0.5:
        scene.stand_somewhere(scene.build(storage.sideboard, 0.9), [other, (other + 2) % 4])
    scene.stand_somewhere(
        scene.build(decoration.house_plant, float(rng.uniform(0.8, 1.2))),
        [door_side, other], 0.08, 0.0,
    )  # fmt: skip
    for plan in windows[1:]:
        hang_curtains(scene, plan)
    free_walls = [(main + 2) % 4, (main + 1) % 4, (main + 3) % 4]
    shelf_walls = [int(n) for n in rng.permutation(free_walls)]
    for height in (1.35, 1.75):
        hang_somewhere(scene, storage.wall_shelf, shelf_walls, height, 0.8)
    hang_somewhere(scene, decoration.painting, shelf_walls[::-1], 1.35)
    hang_somewhere(scene, decoration.wall_clock, shelf_walls, 1.9)
    light_ceiling(scene)
    _lay_out_small_things(scene, units, table)


def _planned_run(rng: np.random.Generator, length: float) -> tuple[list[str], list[float]]:
    """Sample the units from left to right along the main wall, and their edges, m."""
    rest = length - 0.03 - SINK_M - STOVE_M - FRIDGE_M
    order = ["counter", "sink", "counter", "stove", "counter"]
    if rng.random() < 0.5:
        order = order[::-1]
    shares = rng.dirichlet([6, 6, 6]) if rest > 1.1 else np.array([0.34, 0.33, 0.33])
    widths = {"sink": SINK_M, "stove": STOVE_M}
    counters = iter(np.maximum(shares * rest, 0.0))
    sizes = [widths.get(unit) or float(next(counters)) for unit in order]
    if rng.random() < 0.5:
        order, sizes = ["fridge", *order], [FRIDGE_M, *sizes]
    else:
        order, sizes = [*order, "fridge"], [*sizes, FRIDGE_M]
    return order, [float(edge) for edge in np.round(0.015 + np.cumsum([0.0, *sizes]), 3)]


def _middle(order: list[str], edges: list[float], unit: str) -> float:
    position = order.index(unit)
    return (edges[position] + edges[position + 1]) / 2


def _fit_units(
    scene: Scene, main: int, order: list[str], edges: list[float], window: WindowPlan
) -> list[HomeObject]:
    """Place base units, the wall units above them, and tiles between; return the base units."""
    units = []
    builders: dict[str, Builder] = {"stove": kitchen.stove, "fridge": kitchen.fridge}
    hole = window.opening
    for unit, left, right in zip(order, edges[:-1], edges[1:], strict=True):
        width, middle = right - left, (left + right) / 2
        if width < 0.12:
            continue
        if unit in builders:
            obj = scene.build(builders[unit])
        else:
            obj = scene.build(kitchen.sink if unit == "sink" else kitchen.counter_top, width)
        placed = scene.stand(obj, main, middle, front=0.75)
        if placed is None:
            continue
        units.append(placed)
        if unit == "fridge":
            continue
        for start, end in _outside(left, right, hole.left, hole.right):
            tiles = scene.build(kitchen.splash_back, end - start)
            scene.hang(tiles, main, (start + end) / 2, kitchen.HEIGHT_M + 0.002)
            if unit != "stove" and end - start > 0.28:
                cabinet = scene.build(kitchen.wall_cabinet, end - start)
                scene.hang(cabinet, main, (start + end) / 2, WALL_UNITS_FROM_M)
        if unit == "stove":
            scene.hang(scene.build(kitchen.hood), main, middle, 1.6)
            for x in (-0.14, 0.14):
                for y in (-0.13, 0.13):
                    _fixed(scene, kitchen.stove_burner, placed, x, y)
        if unit == "sink":
            _fixed(scene, kitchen.faucet, placed, 0.0, 0.18)
    return units


def _turn_corner(
    scene: Scene, main: int, order: list[str], window_side: int | None
) -> list[HomeObject]:
    """Place a second run around the free corner, if that wall has no window."""
    rng = scene.rng
    at_left = order[-1] == "fridge"
    number = (main + (3 if at_left else 1)) % 4
    width = float(rng.uniform(0.8, 1.5))
    if number == window_side or rng.random() < 0.4:
        return []
    start = kitchen.DEPTH_M + 0.026
    along = start + width / 2
    if at_left:
        along = scene.sides[number].length - along
    run = scene.stand(scene.build(kitchen.counter_top, width), number, along, front=0.7)
    if run is None:
        return []
    tiles = scene.build(kitchen.splash_back, width)
    scene.hang(tiles, number, along, kitchen.HEIGHT_M + 0.002)
    scene.hang(scene.build(kitchen.wall_cabinet, width), number, along, WALL_UNITS_FROM_M)
    return [run]


def _outside(left: float, right: float, low: float, high: float) -> list[tuple[float, float]]:
    """Return the parts of a span outside of another, with a margin for the window's frame."""
    parts = [(left, min(right, low - 0.02)), (max(left, high + 0.02), right)]
    return [(start, end) for start, end in parts if end - start > 0.05]


def _fixed(scene: Scene, builder: Builder, parent: HomeObject, x: float, y: float) -> None:
    """Put an object at a given position on its parent, m from the parent's middle."""
    obj = scene.build(builder)
    at = parent.world_from_object.copy()
    local = np.array([x, y, parent.boxes[:, 1, 2].max(), 1.0])
    at[:3, 3] = np.round((parent.world_from_object @ local)[:3], 6)
    scene.add(obj, at, parent.id)


def _dine(scene: Scene, main: int) -> HomeObject | None:
    """Place a table with chairs around it, in the part of the room that the units leave."""
    rng = scene.rng
    inward = scene.sides[main].inward
    width, depth, _ = scene.size
    yaw = scene.sides[main].yaw_rad
    for long, deep in ((1.5, 0.85), (1.25, 0.8), (1.0, 0.75), (0.8, 0.7)):
        round_top = deep > 0.72 and rng.random() < 0.3
        table = (
            scene.build(tables.round_table, long * 0.38)
            if round_top
            else scene.build(tables.dining_table, long, deep)
        )
        for _ in range(30):
            middle = np.array([width, depth]) / 2 + inward * rng.uniform(0.2, 1.1)
            x, y = middle + rng.uniform(-0.9, 0.9, 2) * np.abs(scene.sides[main].along)
            turned = yaw + (np.pi / 2 if rng.random() < 0.5 else 0.0)
            placed = scene.stand_at(table, float(x), float(y), turned)
            if placed is None:
                continue
            chairs = _seat(scene, placed)
            if chairs >= 2:
                return placed
            scene.undo(chairs + 1)
    return None


def _seat(scene: Scene, table: HomeObject) -> int:
    """Place chairs around a table, pushed in a little; return their number."""
    rng = scene.rng
    half = table.boxes[:, 1, :2].max(axis=0)
    count = 0
    long_sides = [(x * half[0], side) for side in (-1, 1) for x in _seats_along(half[0])]
    positions = [(x, side * half[1], 0.0 if side > 0 else np.pi) for x, side in long_sides]
    if half[0] > 0.55 or len(positions) < 4:
        positions += [(half[0], 0.0, -np.pi / 2), (-half[0], 0.0, np.pi / 2)]
    table_yaw = float(np.arctan2(table.world_from_object[1, 0], table.world_from_object[0, 0]))
    for x, y, yaw in positions[: int(rng.integers(3, 7))]:
        chair = scene.build(seating.chair)
        away = np.array([x, y]) + 0.13 * np.array([np.sign(x) * (y == 0), np.sign(y)])
        local = np.array([away[0], away[1], 0.0, 1.0])
        at = table.world_from_object @ local
        turn = table_yaw + yaw + float(rng.uniform(-0.12, 0.12))
        if scene.stand_at(chair, float(at[0]), float(at[1]), turn, in_the_way=True):
            count += 1
    return count


def _seats_along(half_width: float) -> list[float]:
    return [-0.5, 0.5] if half_width > 0.58 else [0.0]


def _lay_out_small_things(scene: Scene, units: list[HomeObject], table: HomeObject | None) -> None:
    """Put devices at the back of the worktop, food and dishes where they are used."""
    rng = scene.rng
    counters = [unit for unit in units if unit.type == "CounterTop"]
    counters.sort(key=lambda unit: -float(np.ptp(unit.boxes[:, :, 0])))
    devices: list[Builder] = [
        electronics.coffee_machine, electronics.toaster, electronics.microwave,
        tableware.paper_towel,
    ]  # fmt: skip
    for k, builder in enumerate(devices):
        for counter in counters[k % len(counters) :] + counters:
            turn = (-0.1, 0.1)
            if scene.put(scene.build(builder), counter, y=(0.4, 1), turn=turn):
                break
    for unit in units:
        if unit.type == "Stove":
            burners = [obj for obj in scene.objects if obj.type == "StoveBurner"]
            cookware: list[Builder] = [tableware.pan, tableware.pot, electronics.kettle]
            for k, builder in zip(rng.permutation(len(burners)), cookware, strict=False):
                scene.put(scene.build(builder), burners[k], turn=(-2.6, -0.6))
        if unit.type == "Sink":
            for soap in (tableware.soap_bottle, tableware.sponge):
                scene.put(scene.build(soap), unit, y=(0.85, 1))
    boards: list[Builder] = [tableware.cutting_board, food.bread, tableware.knife]
    for counter in counters:
        board = scene.put(scene.build(boards[0]), counter, y=(-0.8, 0.2), turn=(-0.2, 0.2))
        if board:
            scene.put(scene.build(food.bread), board, turn=(-0.3, 0.3))
            break
    pantry: list[Builder] = [
        tableware.mug, tableware.bottle, food.jar, food.cereal_box, tableware.bowl, tableware.plate,
        food.apple, food.tomato, food.potato, tableware.wine_bottle, food.lettuce, tableware.spoon,
        tableware.salt_shaker, tableware.pepper_shaker, tableware.knife, decoration.house_plant,
    ]  # fmt: skip
    for index in rng.permutation(len(pantry))[: int(rng.integers(9, 14))]:
        counter = counters[int(rng.integers(len(counters)))]
        scene.put(scene.build(pantry[int(index)]), counter, turn=(-0.5, 0.5))
    if table:
        _set_table(scene, table)
    shelved: list[Builder] = [
        food.jar, tableware.mug, tableware.bowl, stationery.book_row, decoration.vase, food.jar,
        tableware.bottle, decoration.house_plant, tableware.cup, food.cereal_box,
    ]  # fmt: skip
    for shelf in [obj for obj in scene.objects if obj.type == "Shelf"]:
        for index in rng.permutation(len(shelved))[:4]:
            scene.put(scene.build(shelved[int(index)]), shelf, turn=(-0.2, 0.2))
    for pane in [obj for obj in scene.objects if obj.type == "Window"]:
        scene.put(scene.build(decoration.house_plant), pane, y=(-1, -0.9), near_z=0.0)


def _set_table(scene: Scene, table: HomeObject) -> None:
    """Put fruit in the middle of the table, plates and cups before the seats."""
    rng = scene.rng
    bowl = scene.put(scene.build(tableware.bowl), table, (-0.3, 0.3), (-0.3, 0.3))
    if bowl:
        for _ in range(3):
            scene.put(scene.build(food.apple), bowl, near_z=0.0)
    seats = [(-0.7, -0.8), (0.7, 0.8), (0.7, -0.8), (-0.7, 0.8)]
    for x, y in seats[: int(rng.integers(1, 5))]:
        near = ((x - 0.15, x + 0.15), (y - 0.15, y + 0.15))
        scene.put(scene.build(tableware.plate), table, *near)
        cup: Builder = tableware.mug if rng.random() < 0.5 else tableware.cup
        scene.put(scene.build(cup), table, (x - 0.4, x + 0.4), near[1], (-3, 3))
    extras: list[Builder] = [
        decoration.vase, tableware.salt_shaker, stationery.newspaper, decoration.candle,
        tableware.wine_bottle, electronics.cell_phone, stationery.key_chain,
    ]  # fmt: skip
    for index in rng.permutation(len(extras))[:4]:
        scene.put(scene.build(extras[int(index)]), table)
