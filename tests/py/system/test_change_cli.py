"""The command `gslts detect` end to end."""

import json
import shutil
from pathlib import Path

import change_room
import numpy as np
import pytest
from change_room import SIZE, VIEWPOINTS
from command import gslts
from PIL import Image

from gslts.io.ply import write_ply
from gslts.store.map_folder import read_map
from gslts_sim.capture import capture
from gslts_sim.controller import Controller

MAP_AND_VISIT = ("detect", "map", "visit", "--halvings", "0")


@pytest.fixture(scope="module")
def workplace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a map and a visit after the removal of the red box; its last frame is dark."""
    folder = tmp_path_factory.mktemp("detect")
    change_room.write_room_map(folder / "map")
    home = change_room.home().without(["Box|1"])
    capture(Controller(home, **SIZE, noise="kinect"), VIEWPOINTS, folder / "visit")
    # The rule of GS-LTS needs the depth at one pixel, which noise may take away.
    capture(Controller(home, **SIZE), VIEWPOINTS, folder / "clean")
    for visit in ("visit", "clean"):
        dark = folder / visit / "images" / "00002.png"
        Image.fromarray(np.zeros((SIZE["height"], SIZE["width"], 3), np.uint8)).save(dark)
    return folder


@pytest.mark.smoke
def test_it_prints_the_changes_of_each_frame(workplace: Path) -> None:
    done = gslts(*MAP_AND_VISIT, "--threads", "1", cwd=workplace)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert len(lines) == 3
    for name, line in zip(("00000", "00001"), lines, strict=False):
        assert line.startswith(f"{name}: removal at (2.")
        assert line.endswith(tuple(f"confidence {k / 100:.2f}" for k in range(101)))
    assert lines[2] == "00002: unreliable: the image is black"


def test_json_and_images_of_one_frame(workplace: Path, tmp_path: Path) -> None:
    arguments = ("--frame", "00001", "--json", "--out", tmp_path / "images")
    done = gslts(*MAP_AND_VISIT, *arguments, cwd=workplace)
    assert done.returncode == 0, done.stderr
    record = json.loads(done.stdout)
    assert (record["frame"], record["unreliable"]) == ("00001", None)
    (change,) = record["changes"]
    assert change["kind"] == "removal"
    np.testing.assert_allclose(change["point_m"], (2.2, 1.85, 0.9), atol=0.3)
    assert 0 < change["confidence"] <= 1
    assert change["box_after_m"] is None
    for region in record["unknown"]:
        x0, y0, x1, y1 = region["box_px"]
        assert region["reason"]
        assert 0 <= x0 < x1 <= 160
        assert 0 <= y0 < y1 <= 120
    assert np.shape(change["box_before_m"]) == (2, 3)
    assert change["pixels"][0] > 25
    assert change["pixels"][1] == 0
    x0, y0, x1, y1 = change["box_px"]
    assert 0 <= x0 < x1 <= SIZE["width"]
    assert 0 <= y0 < y1 <= SIZE["height"]
    assert (x1 - x0) * (y1 - y0) >= change["pixels"][0]
    (image_path,) = (tmp_path / "images").iterdir()
    assert image_path.name == "00000_00001.png"
    with Image.open(image_path) as image:
        assert image.size == (9 * SIZE["width"], 3 * SIZE["height"])  # Enlarged for its text.


def test_json_has_one_object_per_line(workplace: Path) -> None:
    arguments = ("--halvings", "0", "--json", "--strategy", "gs_lts")
    done = gslts("detect", "map", "clean", *arguments, cwd=workplace)
    assert done.returncode == 0, done.stderr
    records = [json.loads(line) for line in done.stdout.splitlines()]
    assert [record["frame"] for record in records] == ["00000", "00001", "00002"]
    assert [len(record["changes"]) for record in records] == [1, 1, 0]
    for record in records[:2]:
        (change,) = record["changes"]
        assert change["kind"] == "removal"
        assert np.hypot(*(np.array(change["point_m"]) - (2.2, 1.85, 0.9))[:2]) < 0.3
        assert change["box_before_m"] is change["box_after_m"] is None
    assert records[2]["unreliable"] == "the image is black"


def test_frames_come_in_the_given_order(workplace: Path) -> None:
    done = gslts(*MAP_AND_VISIT, "--frame", "00002", "--frame", "00000", cwd=workplace)
    assert done.returncode == 0, done.stderr
    assert [line.split(":")[0] for line in done.stdout.splitlines()] == ["00002", "00000"]


def test_a_ply_file_is_a_map_without_cameras(workplace: Path) -> None:
    ply = workplace / "room.ply"
    write_ply(read_map(workplace / "map"), ply)
    done = gslts("detect", ply, "visit", "--halvings", "0", "--frame", "00000", cwd=workplace)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("00000: removal")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("gone", "visit"), "gone"),
        (("map", "gone"), "gone"),
        (("map", "visit", "--frame", "00007"), "visit: there is no frame '00007'"),
        (("map", "visit", "--out", "visit"), "visit is not empty"),
        (("map", "visit", "--features", "edges"), "expected gradients, onnx:FILE or transformers"),
        (("map", "visit", "--features", "onnx:gone.onnx"), "gone.onnx"),
        (
            ("map", "visit", "--features", "onnx:map/cameras.json"),
            "cameras.json: it is no ONNX model",
        ),
        (("map", "visit", "--features", "transformers:map"), "map: there is no config.json"),
    ],
)
def test_errors_take_one_line(workplace: Path, arguments: tuple[str, ...], message: str) -> None:
    before = sorted(workplace.rglob("*"))
    done = gslts("detect", *arguments, cwd=workplace)
    assert done.returncode == 1
    assert done.stdout == ""
    (line,) = done.stderr.splitlines()
    assert line.startswith("gslts: ")
    assert message in line
    assert sorted(workplace.rglob("*")) == before


def test_a_damaged_frame_does_not_stop_the_others(workplace: Path, tmp_path: Path) -> None:
    shutil.copytree(workplace / "visit", tmp_path / "visit")
    damaged = tmp_path / "visit" / "images" / "00000.png"
    damaged.write_bytes(damaged.read_bytes()[:300])
    done = gslts(*MAP_AND_VISIT[:2], tmp_path / "visit", "--halvings", "0", cwd=workplace)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert lines[0].startswith("00000: unreliable: ")
    assert "00000.png" in lines[0]
    assert lines[1].startswith("00001: removal")


def test_damaged_cameras_are_named(workplace: Path, tmp_path: Path) -> None:
    change_room.write_room_map(tmp_path / "map")
    (tmp_path / "map" / "cameras.json").write_text('{"00000": {"fx": 1}}')
    done = gslts("detect", tmp_path / "map", "visit", cwd=workplace)
    assert done.returncode == 1
    assert "cameras.json: '00000': world_from_camera: Field required" in done.stderr


@pytest.mark.parametrize("option", [("--strategy", "guess"), ("--halvings", "3")])
def test_options_out_of_range_are_named(workplace: Path, option: tuple[str, str]) -> None:
    done = gslts("detect", "map", "visit", *option, cwd=workplace)
    assert done.returncode == 2
    assert option[0] in done.stderr.splitlines()[-1]
