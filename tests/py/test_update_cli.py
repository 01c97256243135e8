"""The command `gslts update`, as a user meets it."""

import json
from pathlib import Path

import change_room
import numpy as np
import pytest
import update_room
from PIL import Image
from test_cli_sim import gslts

from gslts.camera_files import read_cameras
from gslts.map_folder import read_map_folder
from gslts.sim.capture import capture
from gslts.sim.robot_body import Look


def looks_at_the_change() -> list[Look]:
    """First some at once, so that the change is believed, then all around."""
    found = update_room.collected("removal")
    looks = []
    for view in (*found.views[:1] * 4, *found.views):
        pose = view.camera.world_from_camera
        x, y, z = pose[:3, 2]
        looks.append(
            Look(
                np.round(pose[:2, 3] / 0.25) * 0.25,
                float(np.rad2deg(np.arctan2(y, x))),
                float(np.rad2deg(np.arcsin(-z))),
            )
        )
    return looks


@pytest.fixture(scope="module")
def workplace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A map, a visit after the red box was taken away, and one in which nothing changed."""
    folder = tmp_path_factory.mktemp("update")
    change_room.write_room_map(folder / "map")
    for name, home in (
        ("visit", update_room.changed_home("removal")),
        ("same", change_room.home()),
    ):
        capture(update_room.robot_in(home), looks_at_the_change(), folder / name)
    return folder


def test_recorded_frames_update_a_map(workplace: Path) -> None:
    given = ("--iterations", "40", "--threads", "1")
    done = gslts("update", "map", "--frames", "visit", "--out", "map_2", *given, cwd=workplace)
    assert done.returncode == 0, done.stderr
    first, *_, last = done.stdout.splitlines()
    assert first.startswith("removal at (2.")
    assert last.startswith("wrote map_2: ")
    old, _ = read_map_folder(workplace / "map")
    new, manifest = read_map_folder(workplace / "map_2")
    record = json.loads((workplace / "map_2" / "update.json").read_text())
    assert record["refused"] is None
    assert record["kinds"] == ["removal"]
    assert new.size == old.size - record["removed"] + record["added"]
    assert record["psnr_after_db"] > record["psnr_before_db"]
    assert manifest["updated_from"] == "map"
    assert update_room.opaque_in(new, update_room.REMOVED, 0.04) == 0
    cameras = read_cameras(workplace / "map_2" / "cameras.json")
    assert len(cameras) == len(read_cameras(workplace / "map" / "cameras.json")) + sum(
        record["views"]
    )
    with Image.open(workplace / "map_2" / "update.png") as picture:
        assert picture.size == (3 * 160, 3 * 120)


def test_where_nothing_changed_there_is_no_new_map(workplace: Path) -> None:
    done = gslts("update", "map", "--frames", "same", "--out", "map_3", cwd=workplace)
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1] == (
        "gslts: map stays as it is: there is no change whose place is known; see map_3.refused.json"
    )
    record = json.loads((workplace / "map_3.refused.json").read_text())
    assert record["refused"] == "there is no change whose place is known"
    assert not (workplace / "map_3").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("map",), "give either --robot or --frames"),
        (("map", "--frames", "visit", "--robot", "x.json"), "give either --robot or --frames"),
        (("nowhere", "--frames", "visit"), "nowhere"),
        (("map", "--frames", "nowhere"), "nowhere"),
        (("map", "--robot", "nowhere.json"), "nowhere.json"),
        (("map", "--frames", "visit", "--out", "map"), "map is there already"),
    ],
)
def test_bad_input_is_named_in_one_line(
    workplace: Path, arguments: tuple[str, ...], message: str
) -> None:
    out = () if "--out" in arguments else ("--out", "never")
    done = gslts("update", *arguments, *out, cwd=workplace)
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    assert message in done.stderr.splitlines()[-1]
    assert not (workplace / "never").exists()
