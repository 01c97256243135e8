"""Files of buildings: what is read, and what is not."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gslts.fleet.building import Building
from gslts.fleet.building_file import MAX_FILE_BYTES, locate_map

TURNED = [[0, -1, 0, 7.5], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
TILTED = [[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]]
SCALED = [[2, 0, 0, 0], [0, 2, 0, 0], [0, 0, 2, 0], [0, 0, 0, 1]]


def building(**changed: Any) -> dict[str, Any]:
    """Return the content of a file, with some of it changed."""
    rooms = {"kitchen": {"map": "maps/kitchen"}, "living room": {"map": "s3://maps/living"}}
    door = {"rooms": ["kitchen", "living room"], "position_m": [1, 2.5, 0]}
    return {"rooms": rooms, "doors": [door], **changed}


def write(folder: Path, content: Any) -> Path:
    path = folder / "building.json"
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return path


def room(**changed: Any) -> dict[str, Any]:
    """Return the content of a file of one room."""
    return {"rooms": {"kitchen": {"map": "kitchen", **changed}}}


def test_rooms_and_doors_are_read(tmp_path: Path) -> None:
    path = write(tmp_path, building())
    read = Building.read(path)
    assert list(read.rooms) == ["kitchen", "living room"]
    assert (read.rooms["kitchen"].pose == np.eye(4)).all()
    (door,) = read.doors
    assert str(door) == "door between kitchen and living room at (1.00, 2.50) m"
    assert read.map_path("kitchen") == tmp_path / "maps" / "kitchen"
    np.testing.assert_allclose(
        Building.read(write(tmp_path, room(building_from_map=TURNED))).rooms["kitchen"].pose, TURNED
    )


def test_a_file_behind_a_url_names_maps_beside_it(tmp_path: Path) -> None:
    write(tmp_path, building())
    url = f"file://{tmp_path}/building.json"
    read = Building.read(url)
    assert read == Building(url, read.content)
    assert locate_map("kitchen", read.rooms["kitchen"], url) == f"file://{tmp_path}/maps/kitchen"
    assert locate_map("living room", read.rooms["living room"], url) == "s3://maps/living"
    with pytest.raises(FileNotFoundError, match=r"^file:///\S+/none.json: there is no such file$"):
        Building.read(f"file://{tmp_path}/none.json")
    write(tmp_path, room(map="/maps/kitchen"))
    assert Building.read(tmp_path / "building.json").map_path("kitchen") == Path("/maps/kitchen")
    with pytest.raises(ValueError, match="/maps/kitchen is a path of one machine"):
        Building.read(url)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "Expecting value"),
        ("[" * 100_000, "recursion"),
        (" " * (MAX_FILE_BYTES + 1), f"larger than {MAX_FILE_BYTES:,} bytes"),
        ('{"rooms": {"a": {"map": "a"}, "a": {"map": "b"}}}', "a occurs twice"),
        ([], "Input should be an object"),
        ({}, "rooms: Field required"),
        (building(schema_version=2), "schema_version: Input should be 1"),
        (building(floors=2), "floors: Extra inputs are not permitted"),
        (room(color="red"), "rooms.kitchen.color: Extra inputs are not permitted"),
        (room(map=""), "rooms.kitchen.map: String should match pattern"),
        (room(map="a\x1b[2J"), "rooms.kitchen.map: String should match pattern"),
        (room(map="../kitchen"), "rooms.kitchen.map: ../kitchen is outside of the folder"),
        (room(map="a/../../b"), "outside of the folder of this file; give the whole path or a URL"),
        (room(map="http://maps/kitchen"), "kitchen.map: http://maps/kitchen: not a URL; expected"),
        (room(building_from_map=SCALED), "rooms.kitchen.building_from_map: .*is not rigid"),
        (room(building_from_map=TILTED), "rooms.kitchen.building_from_map: .*tilts the map by 90°"),
        (room(building_from_map=TURNED[:3]), "rooms.kitchen.building_from_map"),
        (room(building_from_map=[*TURNED[:3], [0, 0, 0, "1"]]), "building_from_map.3.3"),
        ({"rooms": {"kit\nchen": {"map": "kitchen"}}}, "rooms.kit"),
        (
            building(doors=[{"rooms": ["kitchen", "attic"], "position_m": [0, 0, 0]}]),
            "doors.0: there is no room attic; rooms: kitchen, living room",
        ),
        (
            building(doors=[{"rooms": ["kitchen", "kitchen"], "position_m": [0, 0, 0]}]),
            "doors.0: both sides are kitchen",
        ),
        (
            building(doors=[{"rooms": ["kitchen", "living room"], "position_m": [0, 0]}]),
            "doors.0.position_m",
        ),
    ],
)
def test_a_wrong_file_is_rejected(tmp_path: Path, content: Any, message: str) -> None:
    path = write(tmp_path, content)
    for location in (path, f"file://{path}"):
        with pytest.raises(ValueError, match=message) as caught:
            Building.read(location)
        assert str(caught.value).startswith(str(location)) or "larger" in message
        assert len(str(caught.value)) < 400


def test_unknown_rooms_are_named(tmp_path: Path) -> None:
    read = Building.read(write(tmp_path, building()))
    with pytest.raises(ValueError, match="there is no room attic; rooms: kitchen, living room"):
        read.map_path("attic")
