"""A flat of three rooms at a hall."""

from functools import cache

import numpy as np
import pytest

from gslts_sim import make_home
from gslts_sim.controller import Controller
from gslts_sim.explore import viewpoints_in
from gslts_sim.home import Home
from gslts_sim.physics import problems
from gslts_sim.procedural.flat import open_door
from gslts_sim.procedural.homes import ROOM_TYPES
from gslts_sim.procedural.model import Kit
from gslts_sim.robot_body import Viewpoint
from gslts_sim.walkable import walkable_floor

DETAIL = 0.05


@cache
def flat() -> Home:
    return make_home("flat", 3, detail=DETAIL)


def test_rooms_do_not_overlap_and_objects_obey_physics() -> None:
    assert [room.type for room in flat().rooms] == ["hall", *ROOM_TYPES]
    boxes = [room.box for room in flat().rooms]
    for k, first in enumerate(boxes):
        for second in boxes[:k]:
            gap = np.maximum(first[0] - second[1], second[0] - first[1])[:2]
            assert gap.max() >= 0.2
    assert problems(flat()) == []
    ids = [obj.id for obj in flat().objects]
    assert len(ids) == len(set(ids))


def test_robot_walks_through_all_doors() -> None:
    floor = walkable_floor(flat(), flat().space)
    for room in flat().rooms:
        low, high = room.box[:, :2]
        cells = floor.grid_positions(0.1)
        inside = ((cells > low) & (cells < high)).all(axis=1)
        assert inside.sum() > 20, room.type


def test_objects_of_a_room_are_those_of_its_home() -> None:
    alone = make_home("bedroom", 3, detail=DETAIL)
    number = list(ROOM_TYPES).index("bedroom")
    own = [
        obj for obj in flat().objects if obj.id.endswith(f"|{number}") and obj.id.count("|") == 2
    ]
    assert sorted(obj.id for obj in own) == sorted(
        f"{obj.id}|{number}" for obj in alone.objects if obj.type != "Door"
    )


def test_same_seed_makes_the_same_flat() -> None:
    again = make_home("flat", 3, detail=DETAIL)
    for first, other in zip(flat().objects, again.objects, strict=True):
        assert first.id == other.id
        assert np.array_equal(first.world_from_object, other.world_from_object)


def test_viewpoints_of_a_room() -> None:
    hall = flat().rooms[0].box.mean(axis=0)
    bedroom = flat().rooms[3].box.mean(axis=0)
    viewpoints = [Viewpoint(float(x), float(y), 0.0, 0.0) for x, y, _ in (hall, bedroom)]
    assert viewpoints_in(flat(), ["hall"], viewpoints) == viewpoints[:1]
    assert viewpoints_in(flat(), ["hall", "bedroom"], viewpoints) == viewpoints
    with pytest.raises(ValueError, match="no room 'cellar'; it has bedroom, hall, kitchen"):
        viewpoints_in(flat(), ["cellar"], viewpoints)


@pytest.mark.parametrize(
    ("room", "other", "seed"), [("living_room", "bedroom", 7), ("kitchen", "bedroom", 2)]
)
def test_the_door_of_a_room_opens_to_another_one(room: str, other: str, seed: int) -> None:
    before = make_home(room, seed, detail=DETAIL)
    after = open_door(before, make_home(other, seed, detail=DETAIL), Kit((seed, 4), DETAIL))
    assert [known.type for known in after.rooms] == [room, other]
    first, second = (known.box for known in after.rooms)
    assert np.maximum(first[0] - second[1], second[0] - first[1])[:2].max() >= 0.2
    assert problems(after) == []
    ids = [obj.id for obj in after.objects]
    assert len(set(ids)) == len(ids)
    kept = {obj.id: obj for obj in before.objects if obj.type != "Door"}
    assert all(obj is kept[obj.id] for obj in after.objects if obj.id in kept)
    assert kept.keys() <= set(ids)
    inside = Controller(before).reachable_positions()
    both = Controller(after).reachable_positions()
    beyond = ((both >= second[0, :2]) & (both <= second[1, :2])).all(axis=1)
    assert beyond.sum() > 20, "the robot goes through"
    assert len(both) - beyond.sum() > 0.9 * len(inside)
