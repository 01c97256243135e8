"""Tests of collision and support, with boxes by hand."""

import numpy as np
import pytest

from gslts.core.robot_body import RobotBody
from gslts_sim.home import Home, HomeObject, Room
from gslts_sim.mesh import Surface
from gslts_sim.oriented_boxes import OrientedBoxes, collides, overlap_m
from gslts_sim.physics import (
    boxes_in_world,
    collisions,
    hangs_on,
    problems,
    resting_poses,
    stands_on,
    support_below,
)
from gslts_sim.walkable import walkable_floor

TRIANGLE = Surface(
    vertices=np.array([[0.0, 0, 0], [0.1, 0, 0], [0, 0.1, 0]]),
    faces=np.array([[0, 1, 2]], np.int32),
    uvs=np.zeros((1, 3, 2), np.float32),
    texture=np.zeros((1, 1, 3), np.uint8),
)


def obj(
    name: str,
    size: tuple[float, float, float],
    at: tuple[float, float, float] = (0, 0, 0),
    yaw: float = 0.0,
    **flags: object,
) -> HomeObject:
    """Return a box that stands at a point."""
    width, depth, height = size
    matrix = np.eye(4)
    matrix[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
    matrix[:3, 3] = at
    return HomeObject(
        id=name,
        type=name.split("|")[0],
        surfaces=(TRIANGLE,),
        boxes=np.array([[[-width / 2, -depth / 2, 0], [width / 2, depth / 2, height]]]),
        world_from_object=matrix,
        **flags,
    )


def home_of(*objs: HomeObject) -> Home:
    room = Room("test", np.array([[0.0, 0, 0], [4, 3, 2.5]]))
    return Home("test", (room,), objs, (), np.ones(3))


def depth_between(first: HomeObject, second: HomeObject) -> float:
    return float(overlap_m(boxes_in_world(first), boxes_in_world(second))[0])


TABLE = obj("Table|1", (1, 1, 0.7), receptacle=True)


@pytest.mark.parametrize(
    ("gap", "stands"), [(0.0, True), (0.001, True), (-0.001, True), (0.004, False), (-0.004, False)]
)
def test_standing_within_three_millimetres(gap, stands):
    mug = obj("Mug|1", (0.1, 0.1, 0.1), (0.2, 0.2, 0.7 + gap))
    assert stands_on(mug, TABLE) == stands


@pytest.mark.parametrize(
    ("x", "stands"),
    [
        (0.0, True),
        (0.45, True),
        (0.485, True),
        (0.495, False),
        (0.505, False),
        (0.6, False),
        (-0.45, True),
    ],
)
def test_standing_at_the_edge_needs_middle_and_most_of_the_footprint(x, stands):
    mug = obj("Mug|1", (0.1, 0.1, 0.1), (x, 0, 0.7))
    assert stands_on(mug, TABLE) == stands


def test_standing_on_a_board_inside():
    boxes = np.array([[[-0.4, -0.15, z], [0.4, 0.15, z + 0.02]] for z in (0.0, 0.4, 0.8)])
    case = HomeObject("Shelf|1", "Shelf", (TRIANGLE,), boxes, np.eye(4), receptacle=True)
    vase = obj("Vase|1", (0.1, 0.1, 0.3), (0.1, 0, 0.42), 0.5)
    assert stands_on(vase, case)
    assert not collides(boxes_in_world(vase), boxes_in_world(case))
    assert collides(
        boxes_in_world(obj("Vase|2", (0.1, 0.1, 0.4), (0, 0, 0.42))), boxes_in_world(case)
    )


@pytest.mark.parametrize(
    ("shift", "overlaps"), [(1.0, False), (0.999, False), (0.995, True), (1.001, False)]
)
def test_touching_is_no_collision(shift, overlaps):
    other = obj("Table|2", (1, 1, 0.7), (shift, 0, 0))
    assert depth_between(TABLE, other) == pytest.approx(1 - shift, abs=1e-9)
    assert collides(boxes_in_world(TABLE), boxes_in_world(other)) == overlaps


def test_boxes_turned_by_45_degrees():
    # The half diagonal of the turned box is 0.7071 m, so its corner is at 1.3 - 0.7071 = 0.593 m.
    corner = obj("Table|2", (1, 1, 0.7), (1.3, 0, 0), np.pi / 4)
    assert depth_between(TABLE, corner) == pytest.approx(0.5 + np.sqrt(0.5) - 1.3)
    assert not collides(boxes_in_world(TABLE), boxes_in_world(corner))
    nearer = obj("Table|2", (1, 1, 0.7), (1.2, 0, 0), np.pi / 4)
    assert collides(boxes_in_world(TABLE), boxes_in_world(nearer))
    # Their axis-aligned boxes overlap, they do not.
    diagonal = obj("Table|2", (1, 1, 0.7), (0.9, 0.9, 0), np.pi / 4)
    assert depth_between(TABLE, diagonal) < 0


def test_crossed_edges_need_the_ninth_axes():
    # Two long bars, tilted about x and y, that pass each other edge against edge.
    first = OrientedBoxes(
        np.zeros((1, 3)), np.array([[2.0, 0.1, 0.1]]), rotation_about("x", np.pi / 4)[None]
    )
    gap = 2 * 0.1 * np.sqrt(2)
    for z, overlaps in ((gap - 0.01, True), (gap + 0.01, False)):
        second = OrientedBoxes(
            np.array([[0, 0, z]]), np.array([[0.1, 2.0, 0.1]]), rotation_about("y", np.pi / 4)[None]
        )
        assert (overlap_m(first, second)[0] > 0) == overlaps


def rotation_about(axis: str, angle: float) -> np.ndarray:
    cosine, sine = np.cos(angle), np.sin(angle)
    if axis == "x":
        return np.array([[1, 0, 0], [0, cosine, -sine], [0, sine, cosine]])
    return np.array([[cosine, 0, sine], [0, 1, 0], [-sine, 0, cosine]])


def test_overlap_agrees_with_sampled_points():
    rng = np.random.default_rng(0)
    for _ in range(60):
        boxes = [
            OrientedBoxes(
                rng.uniform(-0.7, 0.7, (1, 3)),
                rng.uniform(0.1, 0.6, (1, 3)),
                np.linalg.qr(rng.normal(size=(3, 3)))[0][None],
            )
            for _ in range(2)
        ]
        points = rng.uniform(-1, 1, (20_000, 3)) * boxes[0].halves @ boxes[0].axes[0].T
        local = (points + boxes[0].centers - boxes[1].centers) @ boxes[1].axes[0]
        touched = bool((np.abs(local) < boxes[1].halves).all(axis=1).any())
        depth = overlap_m(*boxes)[0]
        # Shallow overlaps can slip between the points; a point inside proves one.
        if touched:
            assert depth > 0
        elif depth > 0:
            assert depth < 0.12


def test_collisions_names_others_only():
    mug = obj("Mug|1", (0.1, 0.1, 0.1), (0, 0, 0.65), movable=True)
    far = obj("Mug|2", (0.1, 0.1, 0.1), (2, 0, 0))
    assert collisions(home_of(TABLE, mug, far), mug) == ["Table|1"]


def test_hanging():
    wall = obj("Wall|1", (3, 0.1, 2.5), (0, 1, 0))
    on_it = obj("Painting|1", (0.5, 0.02, 0.5), (0, 0.939, 1.2))
    off_it = obj("Painting|2", (0.5, 0.02, 0.5), (0, 0.93, 1.2))
    assert hangs_on(on_it, wall)
    assert not hangs_on(off_it, wall)


def test_problems_in_words():
    floor = obj("Floor|1", (4, 4, 0.1), (0, 0, -0.1), receptacle=True)
    table = obj("Table|1", (1, 1, 0.7), receptacle=True, parent="Floor|1")
    good = obj("Mug|1", (0.1, 0.1, 0.1), (0, 0, 0.7), movable=True, parent="Table|1")
    floating = obj("Mug|2", (0.1, 0.1, 0.1), (0.3, 0, 0.8), movable=True, parent="Table|1")
    inside = obj("Mug|3", (0.1, 0.1, 0.1), (0.02, 0, 0.7), movable=True, parent="Table|1")
    lost = obj("Mug|4", (0.1, 0.1, 0.1), (1.5, 0, 0), movable=True)
    assert problems(home_of(floor, table, good)) == []
    assert problems(home_of(floor, table, good, floating, inside, lost)) == [
        "Mug|2 does not rest on Table|1",
        "Mug|4 is movable and stands on nothing",
        "Mug|1 overlaps Mug|3",
    ]


def test_support_below_finds_the_parent():
    plate = obj("Plate|1", (0.3, 0.3, 0.01), (0, 0, 0.7))
    apple = obj("Apple|1", (0.08, 0.08, 0.08), (0, 0, 0.71))
    home = home_of(TABLE, plate)
    assert support_below(home, apple) == "Plate|1"
    assert support_below(home, plate) == "Table|1"
    assert support_below(home, TABLE) is None


def test_resting_places_are_free_and_carried():
    vase = obj("Vase|1", (0.2, 0.2, 0.3), (0, 0, 0.7))
    mug = obj("Mug|1", (0.1, 0.1, 0.1), (5, 5, 0))
    home = home_of(TABLE, vase)
    poses = resting_poses(home, mug, TABLE, yaw_rad=0.4)
    assert len(poses) > 200
    for at in poses:
        put = mug.place_at(at, "Table|1")
        assert stands_on(put, TABLE)
        assert collisions(home, put) == []
    assert len(resting_poses(home, obj("Sofa|1", (2, 1, 1)), TABLE)) == 0


def test_walkable_floor_of_an_empty_room():
    floor = walkable_floor(home_of(obj("Floor|1", (4, 3, 0.1), (2, 1.5, -0.1))), room())
    assert floor.free.all()
    assert floor.standing.sum() * floor.cell_m**2 == pytest.approx(3.6 * 2.6, rel=0.03)
    # Only the corners outside of the round body are left out.
    assert floor.reached_fraction == pytest.approx(1 - 4 * 0.2**2 * (1 - np.pi / 4) / 12, abs=0.01)


def room() -> Room:
    return Room("test", np.array([[0.0, 0, 0], [4, 3, 2.5]]))


@pytest.mark.parametrize(("gap", "share"), [(0.5, 1.0), (0.3, 0.62)])
def test_walkable_floor_behind_a_gap(gap, share):
    # A wall across the room at x = 2.5 m, with a gap that lets the robot through or not.
    length = 3 - gap
    barrier = obj("Cabinet|1", (0.1, length, 1), (2.5, length / 2, 0))
    floor = walkable_floor(home_of(barrier), room())
    assert floor.reached_fraction == pytest.approx(share, abs=0.03)


def test_rugs_and_high_objects_are_no_obstacles():
    rug = obj("Rug|1", (2, 2, 0.01), (2, 1.5, 0))
    shelf = obj("Shelf|1", (2, 0.3, 0.1), (2, 0.15, 1.3))
    assert walkable_floor(home_of(rug, shelf), room()).free.all()
    assert not walkable_floor(home_of(rug, shelf), room(), RobotBody(height_m=1.4)).free.all()


def test_a_room_without_free_floor():
    block = obj("Box|1", (4, 3, 1), (2, 1.5, 0))
    floor = walkable_floor(home_of(block), room())
    assert not floor.free.any()
    assert floor.reached_fraction == 0
