"""Tests of generated homes: types, sizes, textures and reproducibility."""

import functools

import home_checks
import numpy as np
import pytest

from gslts_sim import ROOM_TYPES, make_home
from gslts_sim.home import Home

PAPERS_TYPES = {
    *("AlarmClock", "ArmChair", "Bed", "Bread", "Chair", "CoffeeMachine", "DeskLamp"),
    *("DiningTable", "Dresser", "Dumbbell", "RemoteControl", "Sofa"),
}


@functools.cache
def coarse_home(room_type: str, seed: int) -> Home:
    return make_home(room_type, seed, detail=home_checks.DETAIL)


def test_types():
    homes = [coarse_home(room_type, seed) for room_type in ROOM_TYPES for seed in range(8)]
    types = {obj.type for home in homes for obj in home.objects}
    movable = {obj.type for home in homes for obj in home.objects if obj.movable}
    assert len(types) >= 60
    assert len(movable) >= 30
    assert types >= PAPERS_TYPES


@pytest.mark.parametrize("room_type", ROOM_TYPES)
def test_each_room_has_its_typical_objects(room_type):
    expected = {
        "kitchen": {"CounterTop", "Sink", "Stove", "Fridge", "DiningTable", "Chair", "Cabinet"},
        "living_room": {"Sofa", "TVStand", "Television", "CoffeeTable", "RemoteControl"},
        "bedroom": {"Bed", "Pillow", "Wardrobe", "SideTable"},
    }[room_type]
    for seed in range(8):
        home = coarse_home(room_type, seed)
        types = {obj.type for obj in home.objects}
        assert types >= expected | {"Floor", "Wall", "Ceiling", "Window", "Door"}, home.name
        surfaces = sum(obj.receptacle for obj in home.objects)
        assert surfaces >= 6, home.name


def test_sizes_are_those_of_homes():
    for room_type in ROOM_TYPES:
        for seed in range(8):
            home = coarse_home(room_type, seed)
            width, depth, height = home.rooms[0].box[1] - home.rooms[0].box[0]
            assert 3 <= width <= 6
            assert 3 <= depth <= 6
            assert 2.4 <= height <= 2.8
            assert home.all_lights


@pytest.mark.parametrize("room_type", ROOM_TYPES)
def test_textures_have_detail(room_type):
    home = make_home(room_type, 4)
    for obj in home.objects:
        for surface in obj.surfaces:
            assert surface.texture.astype(float).std(axis=(0, 1)).max() > 1.5, obj.id
            assert 32 <= max(surface.texture.shape[:2]) <= 1024


def test_shapes_do_not_depend_on_the_resolution_of_textures():
    fine, coarse = (make_home("kitchen", 3, detail=detail) for detail in (1.0, 0.06))
    for first, second in zip(fine.objects, coarse.objects, strict=True):
        assert first.id == second.id
        np.testing.assert_array_equal(first.world_from_object, second.world_from_object)
        for a, b in zip(first.surfaces, second.surfaces, strict=True):
            np.testing.assert_array_equal(a.vertices, b.vertices)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("garage", 1), r"room_type: .* kitchen, living_room, bedroom, flat, got 'garage'"),
        ((None, 1), r"room_type: .* got None"),
        ((["kitchen"], 1), r"room_type: .* got \['kitchen'\]"),
        (("kitchen", -1), r"seed: expected an int from 0 to 2\^63 - 1, got -1"),
        (("kitchen", 2**63), r"seed: .* got 9223372036854775808"),
        (("kitchen", 1.0), r"seed: .* got 1\.0"),
        (("kitchen", True), r"seed: .* got True"),
        (("kitchen", "1"), r"seed: .* got '1'"),
    ],
)
def test_bad_input(arguments, message):
    with pytest.raises(ValueError, match=message) as error:
        make_home(*arguments)
    assert "\n" not in str(error.value)
