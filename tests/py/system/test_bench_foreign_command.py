"""The command `gslts bench detect --home` on a small flat in a glTF file."""

import json
from pathlib import Path

import pytest
from command import gslts
from gltf_files import flat

SETTINGS = ("--set", "iterations=40", "--set", "rough_epochs=0", "--set", "voxel_m=0.1")
SMALL = ("--seeds", "0:1", "--tasks", "2", "--size", "160x120", "--frames", "16", *SETTINGS)


def test_a_foreign_home_is_measured_and_named(tmp_path: Path) -> None:
    flat().write(tmp_path / "flat.glb")
    run = ("bench", "detect", "--home", "flat.glb", *SMALL, "--json", "flat.json")
    done = gslts(*run, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "Foreign home `flat.glb`, not of a split of ours; tasks with seed 0." in done.stdout
    result = json.loads((tmp_path / "flat.json").read_text())
    assert result["foreign"] == ["flat.glb"]
    assert "split" not in result
    (made_of,) = (subject["made_of"] for subject in result["subjects"].values())
    assert made_of["recording"]["home"] == "flat.glb_0"
    assert len(made_of["recording"]["sha256"]) == 64
    singles = [record for record in result["records"] if record["part"] == "single"]
    assert {truth["change"]["object_type"] for record in singles for truth in record["truths"]} == {
        "Cup"
    }


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--home", "none.glb"), "none.glb: there is no such file"),
        (("--home", "text.glb"), "text.glb: "),
        (("--home", "flat.glb", "--room", "kitchen"), "--home and --room exclude each other"),
    ],
)
def test_a_bad_home_is_one_line(tmp_path: Path, arguments: tuple[str, ...], message: str) -> None:
    (tmp_path / "text.glb").write_text("text")
    rejected = gslts("bench", "detect", *arguments, *SMALL, cwd=tmp_path)
    assert rejected.returncode == 1
    assert message in rejected.stderr
    assert len(rejected.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()
