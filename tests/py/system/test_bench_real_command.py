"""The command `gslts bench real` on a room whose later visits are simulated."""

import json
import shutil
from pathlib import Path

import change_room
import pytest
from change_room import VIEWPOINTS
from command import gslts
from PIL import Image
from shared import viewpoints_all_around

from gslts_bench.real.boxes import marked_rooms
from gslts_sim.capture import capture
from gslts_sim.controller import Controller


@pytest.fixture(scope="module")
def rooms(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Record visits of a simulated room under the names of the real one."""
    folder = tmp_path_factory.mktemp("rooms")
    viewpoints = [*viewpoints_all_around("change_room", change_room.home(), 48)[:16], *VIEWPOINTS]
    added = change_room.thing("Box|3", 2.6, 1.8, change_room.YELLOW, "Block|1")
    capture(
        Controller(change_room.home(), **change_room.SIZE), viewpoints, folder / "Office/scene1"
    )
    for visit, images in marked_rooms()["Office"].visits.items():
        recorded = folder / "Office" / visit
        home = change_room.home().with_object(added)
        capture(Controller(home, **change_room.SIZE), [VIEWPOINTS[0]] * len(images), recorded)
        text = (recorded / "transforms.json").read_text()
        header = json.loads(text)
        for frame, file in zip(header["frames"], images, strict=True):
            (recorded / frame["file_path"]).rename(recorded / Path(file).name)
            frame["file_path"] = Path(file).name
        (recorded / "transforms.json").write_text(json.dumps(header))
    return folder


def test_each_marked_frame_is_judged(rooms: Path, tmp_path: Path) -> None:
    settings = ("--set", "iterations=300", "--set", "rough_epochs=0", "--work", "work")
    process = gslts(
        "bench", "real", rooms, *settings, "--images", "images", "--json", "all.json", cwd=tmp_path
    )
    assert process.returncode == 0, process.stderr
    result = json.loads((tmp_path / "all.json").read_text())
    numbers = result["summary"]["frame"]["Office"]
    marked = [m for v in marked_rooms()["Office"].visits.values() for o in v.values() for m in o]
    assert numbers["records"] == numbers["frames"] == 20
    assert numbers["unreliable"] == 0
    assert numbers["new"][1] == sum(m.kind == "new" for m in marked)
    assert numbers["others"] > 0, "the simulated box is where the marked objects are not"
    visits = result["summary"]["visit"]["Office"]
    assert (visits["records"], visits["frames"], visits["unreliable"]) == (5, 20, 0)
    assert 0 < visits["others"] < numbers["others"], "frames of a visit report together"
    assert "| Office | 20 |" in process.stdout
    assert "| Office | 5 |" in process.stdout
    images = sorted((tmp_path / "images").iterdir())
    assert len(images) == 20
    with Image.open(images[0]) as image:
        assert image.width > 480


def test_the_map_is_updated_visit_after_visit(rooms: Path, tmp_path: Path) -> None:
    settings = ("--set", "iterations=300", "--set", "rough_epochs=0", "--work", "work")
    given = ("--updates", "--images", "images", "--json", "all.json")
    process = gslts("bench", "real", rooms, *settings, *given, cwd=tmp_path)
    assert process.returncode == 0, process.stderr
    result = json.loads((tmp_path / "all.json").read_text())
    numbers = result["summary"]["rooms"]["Office"]
    assert numbers["visits"] == 5
    assert [record["id"] for record in result["records"]] == [f"scene{k}" for k in range(2, 7)]
    first = result["records"][0]
    assert first["status"] == "updated"
    assert first["true"] + first["untrue"] >= 1
    updated = [record for record in result["records"] if record["status"] == "updated"]
    assert numbers["versions"] == len(updated)
    assert numbers["true"] + numbers["untrue"] == sum(r["true"] + r["untrue"] for r in updated)
    assert len(list((tmp_path / "images").iterdir())) == 5
    assert "### Updates visit after visit" in process.stdout


def test_updates_need_visits(tmp_path: Path) -> None:
    process = gslts("bench", "real", "--dataset", "room", "--updates", cwd=tmp_path)
    assert process.returncode == 1
    assert "--updates needs a FOLDER of visits" in process.stderr
    assert "Traceback" not in process.stderr


def test_a_missing_frame_is_named(rooms: Path, tmp_path: Path) -> None:
    shutil.copytree(rooms / "Office", tmp_path / "Office")
    header = tmp_path / "Office/scene3/transforms.json"
    content = json.loads(header.read_text())
    del content["frames"][2]
    header.write_text(json.dumps(content))
    process = gslts("bench", "real", tmp_path, "--work", "work", cwd=tmp_path)
    assert process.returncode == 1
    assert "scene3: there is no frame 002_0; expected images/002_0.jpg" in process.stderr
    assert "Traceback" not in process.stderr


def test_a_folder_without_rooms_is_an_error(tmp_path: Path) -> None:
    process = gslts("bench", "real", tmp_path, cwd=tmp_path)
    assert process.returncode == 1
    assert "it has none of the folders Kitchen, Office, SmallRoom" in process.stderr
    assert "Traceback" not in process.stderr


def test_a_room_without_changes_is_compared_with_its_maps(rooms: Path, tmp_path: Path) -> None:
    settings = ("--set", "iterations=300", "--set", "rough_epochs=0", "--work", "work")
    dataset = ("--dataset", rooms / "Office/scene1")
    process = gslts("bench", "real", *dataset, *settings, "--json", "all.json", cwd=tmp_path)
    assert process.returncode == 0, process.stderr
    summary = json.loads((tmp_path / "all.json").read_text())["summary"]
    assert {name: own["frames"] for name, own in summary["frame"].items()} == {
        "objects": 19,
        "located": 19,
        "gs_lts": 19,
    }
    for sequence in summary["sequence"].values():
        assert (sequence["records"], sequence["frames"]) == (2, 19)
    assert list(summary["changes"]) == ["addition", "removal", "relocation", "all"]
    assert summary["frame"]["objects"]["unreliable"] < 19
    assert "### Unchanged frames" in process.stdout


@pytest.mark.parametrize("arguments", [(), ("visits", "--dataset", "room")])
def test_visits_and_a_data_set_exclude_each_other(
    arguments: tuple[str, ...], tmp_path: Path
) -> None:
    process = gslts("bench", "real", *arguments, cwd=tmp_path)
    assert process.returncode == 1
    assert "expected a FOLDER of visits or --dataset, one of them" in process.stderr
    assert "Traceback" not in process.stderr
