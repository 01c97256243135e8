"""The command `gslts bench navigate` on one small home."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from command import gslts

from gslts_bench.navigation.relocated import NOT_UPDATED

SETTINGS = ("--preset", "fast", "--set", "iterations=300", "--set", "rough_epochs=0")
SMALL = ("--room", "kitchen", "--seeds", "3:4", "--size", "240x180", "--frames", "40")
RUN = (
    "bench",
    "navigate",
    *SMALL,
    *SETTINGS,
    "--set",
    "voxel_m=0.05",
    "--episodes",
    "3",
    "--moved",
    "2",
)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., tuple[str, dict[str, Any]]]:
    """Runs the benchmark in one folder; gives what it printed and its JSON."""
    folder = tmp_path_factory.mktemp("bench")

    def once(images: str) -> tuple[str, dict[str, Any]]:
        outputs = ("--json", "all.json", "--images", images, "--work", "work")
        done = gslts(*RUN, *outputs, cwd=folder)
        assert done.returncode == 0, done.stderr
        found = json.loads((folder / "all.json").read_text())
        assert len(list((folder / images).glob("kitchen_3_00?_*.png"))) == 3
        return done.stdout, found

    return once


@pytest.mark.long
def test_a_run_is_kept(run: Callable[..., tuple[str, dict[str, Any]]]) -> None:
    text, found = run("one")
    ids = [record["id"] for record in found["records"]]
    assert ids[:3] == [f"kitchen_3/00{k}" for k in range(3)]
    moved = found["records"][3:]
    assert {record["id"].rpartition("/")[0] for record in moved} == {
        f"kitchen_3/moved_{k:02}" for k in range(2)
    }
    assert found["summary"]["moved"]["relocations"][1] == 2
    walked = [record for record in moved if record["status"] != NOT_UPDATED]
    assert found["summary"]["moved"]["episodes"] == len(walked)
    assert found["errors"] == {}
    assert "| kitchen |" in text
    assert found["summary"]["rooms"]["kitchen"]["episodes"] == 3
    assert sum(record["success"] for record in found["records"][:3]) >= 2
    for record in found["records"]:
        assert record["success"] == (record["spl"] > 0)
        assert record["walked_m"] == 0 or record["walked_m"] >= 0.25
    again_text, again = run("two")
    assert again["records"] == found["records"]
    assert again_text.partition("| Room")[2] == text.partition("| Room")[2]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--seeds", "3"), "--seeds: expected A:B"),
        (("--room", "bathroom"), "room types: expected some of"),
        (("--size", "8x8"), "--size: expected WxH"),
    ],
)
def test_bad_arguments_are_named(arguments: tuple[str, ...], message: str, tmp_path: Path) -> None:
    done = gslts("bench", "navigate", *arguments, "--work", tmp_path / "work", cwd=tmp_path)
    assert done.returncode == 1
    assert message in done.stderr
    assert not (tmp_path / "work").exists()
