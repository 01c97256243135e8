"""Tests of the commands of `gslts sim`: output files and error messages."""

import json
from pathlib import Path

import numpy as np
import pytest
from command import gslts
from PIL import Image

from gslts.datasets import open_dataset
from gslts_sim import make_home, write_glb
from gslts_sim.task import read_task


def test_home_lists_objects(tmp_path: Path) -> None:
    done = gslts("sim", "home", "kitchen", "3", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    objects = make_home("kitchen", 3, detail=0.05).objects
    lines = done.stdout.splitlines()
    assert [line.split()[0] for line in lines] == [obj.id for obj in objects]
    movable = [line.endswith(" movable") for line in lines]
    assert movable == [obj.movable for obj in objects]


def test_homes_files_tasks_and_images(tmp_path: Path) -> None:
    """Make tasks from the file of a home, and an image of one task."""
    write_glb(make_home("bedroom", 1, detail=0.1), tmp_path / "flat.glb")
    done = gslts("sim", "tasks", "flat.glb", "--count", "3", "--out", "tasks", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    scripts = sorted((tmp_path / "tasks").iterdir())
    assert [path.name.split("_")[1] for path in scripts] == ["addition", "removal", "relocation"]
    assert {read_task(path).home.file for path in scripts} == {"../flat.glb"}
    done = gslts("sim", "show", scripts[2], "--out", "images", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    with Image.open(tmp_path / "images" / f"{scripts[2].stem}.png") as image:
        assert image.size[0] > 1000
    done = gslts("sim", "show", "flat.glb", "--out", "images", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "images" / "flat.png").exists()


@pytest.mark.smoke
def test_captures_are_data_sets(tmp_path: Path) -> None:
    arguments = ("kitchen", "2", "--frames", "4", "--width", "64", "--height", "48")
    done = gslts("sim", "capture", *arguments, "--out", "set", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "wrote 4 frames to set" in done.stdout
    header = json.loads((tmp_path / "set" / "transforms.json").read_text())
    assert (header["w"], header["h"], len(header["frames"])) == (64, 48, 4)
    again = gslts("sim", "capture", *arguments, "--out", "set", cwd=tmp_path)
    assert again.returncode == 1
    assert again.stderr.splitlines()[-1] == "gslts: set is not empty"


def rejected(tmp_path: Path, *arguments: str) -> str:
    """Return the error line of a command; assert that it writes no file."""
    before = sorted(tmp_path.rglob("*"))
    done = gslts("sim", *arguments, cwd=tmp_path)
    assert done.returncode == 1, done.stdout + done.stderr
    assert done.stdout == ""
    assert sorted(tmp_path.rglob("*")) == before
    lines = [line for line in done.stderr.splitlines() if not line.startswith("\r")]
    assert lines[-1].startswith("gslts: ")
    assert "Traceback" not in done.stderr
    return lines[-1]


def test_a_replayed_task_shows_its_change_first(tmp_path: Path) -> None:
    gslts("sim", "tasks", "bedroom", "--count", "1", "--out", "tasks", cwd=tmp_path)
    [script] = (tmp_path / "tasks").iterdir()
    task = read_task(script)
    states = {}
    for name, options in {"before": (), "after": ("--changed",)}.items():
        options = (*options, "--frames", "2", "--out", name)
        done = gslts("sim", "replay", script, *options, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        states[name] = open_dataset(tmp_path / name).frames
        assert len(states[name]) == 2
    robot = task.start(task.home.load(script.parent), changed=True)
    seen, expected = states["after"][0].read().rgb, robot.observe().rgb
    assert np.abs(seen.astype(float) - expected).mean() < 5
    assert np.abs(states["before"][0].read().rgb.astype(float) - expected).mean() > 20


@pytest.mark.parametrize("command", ["home", "show", "capture"])
def test_unknown_rooms_are_named(tmp_path: Path, command: str) -> None:
    line = rejected(tmp_path, command, "attic", *(() if command == "home" else ("--out", "o")))
    assert "expected one of kitchen, living_room, bedroom, flat or a .glb or .gltf file" in line
    assert "'attic'" in line


def test_invalid_seeds_are_named(tmp_path: Path) -> None:
    done = gslts("sim", "home", "kitchen", "--", "-1", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1].startswith("Error: Invalid value for 'seed': ")
    assert str(2**63) in rejected(tmp_path, "home", "kitchen", str(2**63))


def test_files_without_a_home_are_named(tmp_path: Path) -> None:
    (tmp_path / "bad.glb").write_bytes(b"glTF nonsense")
    for command in ("home", "show", "capture", "tasks"):
        out = () if command == "home" else ("--out", "o")
        assert "bad.glb" in rejected(tmp_path, command, "bad.glb", *out)
    assert "gone.glb" in rejected(tmp_path, "home", "gone.glb")
    (tmp_path / "bad.json").write_text('{"schema_version": 7}')
    line = rejected(tmp_path, "show", "bad.json", "--out", "o")
    assert line == "gslts: bad.json: schema_version is 7, this gslts reads 1"


def test_unknown_noise_is_named(tmp_path: Path) -> None:
    for arguments in (("capture", "kitchen"), ("tasks", "kitchen")):
        line = rejected(tmp_path, *arguments, "--noise", "loud", "--out", "o")
        assert "noise must be one of none, kinect, got 'loud'" in line


def test_tasks_name_impossible_changes_and_why(tmp_path: Path) -> None:
    arguments = ("tasks", "kitchen", "--first-seed", "4", "--out", "o")
    line = rejected(tmp_path, *arguments, "--object", "Fridge|1")
    assert line == "gslts: kitchen 4: Fridge|1 is not movable"
    line = rejected(tmp_path, *arguments, "--object", "Mug|1", "--on", "Wall|1")
    assert line == "gslts: kitchen 4: there is no receptacle Wall|1"
    done = gslts(
        "sim", *arguments, "--object", "Chair|1", "--on", "DiningTable|1", "--count", "3",
        cwd=tmp_path,
    )  # fmt: skip
    assert done.returncode == 1
    assert "Chair belongs on the floor" in done.stderr.splitlines()[-1]
