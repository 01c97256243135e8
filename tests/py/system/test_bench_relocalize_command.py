"""The command `gslts bench relocalize` on one small home."""

import json
from pathlib import Path
from typing import Any

import pytest
from bench_settings import SETTINGS
from command import gslts
from PIL import Image

from gslts.store.manifest import MANIFEST
from gslts_bench.relocalization.room import FOLDS
from gslts_bench.relocalization.variants import ABLATION, OURS, TRADE

pytestmark = pytest.mark.long

SMALL = ("--room", "bedroom", "--seeds", "3:4", "--size", "240x180", "--frames", "32")
MAPPED = (*SETTINGS, "--set", "voxel_m=0.05", "--work", "work")
RUN = ("bench", "relocalize", *SMALL, *MAPPED, "--views", "4", "--ablation", "--trade", "t.png")


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder in which the benchmark ran."""
    folder = tmp_path_factory.mktemp("bench")
    process = gslts(*RUN, "--json", "all.json", cwd=folder)
    assert process.returncode == 0, process.stderr
    (folder / "stdout").write_text(process.stdout)
    return folder


def records(path: Path) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = json.loads(path.read_text())["records"]
    return found


def test_each_frame_is_localized_with_each_variant(done: Path) -> None:
    asked: dict[tuple[str, str], set[str]] = {}
    for record in records(done / "all.json"):
        asked.setdefault((record["part"], record["frame"]), set()).add(record["variant"])
    expected = {
        "held-out": {OURS, *ABLATION},
        "as mapped": {OURS, *ABLATION, *TRADE},
        "three changes": {OURS, *ABLATION},
        "another home": {OURS},
    }
    for (part, _), variants in asked.items():
        assert variants == expected[part]
    names = {part: sorted(name for own, name in asked if own == part) for part in expected}
    assert names["held-out"] == [f"bedroom_3/kept_{k:05}" for k in range(0, 32, 16)]
    assert names["as mapped"] == [f"bedroom_3/visit_{k:02}" for k in range(4)]
    assert names["three changes"] == [f"bedroom_3/changed_{k:02}" for k in range(4)]
    assert names["another home"] == [f"{home}/visit_0{k}" for home in STRANGERS for k in range(2)]


STRANGERS = ("bedroom_2", "kitchen_3")


def test_only_frames_of_the_home_are_judged_by_a_true_pose(done: Path) -> None:
    for record in records(done / "all.json"):
        located, own = record["located"], record["part"] != "another home"
        assert located["s"] > 0
        assert (located["off"] is not None) == (own and located["status"] != "lost")
        assert (record["tracked"] is not None) == (own and record["variant"] == OURS)
        if not own:
            assert located["status"] != "ok"


def test_frames_are_found_even_in_a_rough_map(done: Path) -> None:
    ours = json.loads((done / "all.json").read_text())["summary"]["variants"][OURS]["own home"]
    assert ours["located"]["far"] >= 4
    assert ours["tracked"]["far"] >= 4


def test_tables_and_plot(done: Path) -> None:
    text = (done / "stdout").read_text()
    assert (
        "2 held-out frames, 4 of homes as mapped, 4 after three changes, 4 of other homes" in text
    )
    assert text.count("\n| bedroom | 2 |") == 2
    assert text.count("\n| bedroom | 4 |") == 5
    assert text.count("\n| without depth | 10 |") == 1
    with Image.open(done / "t.png") as image:
        assert image.size[0] > 900


def test_an_interrupted_run_goes_on(done: Path) -> None:
    (path,) = (done / "work" / "relocalize").glob("bedroom_3_*.jsonl")
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(lines[:-2]) + lines[-2][:40])
    maps = sorted((done / "work" / "maps").iterdir())
    process = gslts(*RUN, "--json", "again.json", cwd=done)
    assert process.returncode == 0, process.stderr
    before, after = records(done / "all.json"), records(done / "again.json")
    assert before[:-2] == after[:-2]
    for first, other in zip(before[-2:], after[-2:], strict=True):
        assert timeless(first) == timeless(other), "the same but for the times"
    assert sorted((done / "work" / "maps").iterdir()) == maps


def test_held_out_frames_are_the_test_frames_of_the_map(done: Path) -> None:
    (map_folder,) = (done / "work" / "maps").glob("bedroom_3_*")
    kept = {
        record["frame"] for record in records(done / "all.json") if record["part"] == "held-out"
    }
    manifest = json.loads((map_folder / MANIFEST).read_text())
    assert {name.partition("kept_")[2] for name in kept} == set(manifest["test_frames"])


def timeless(record: dict[str, Any]) -> dict[str, Any]:
    located = {**record["located"], "s": 0, "cpu_s": 0}
    tracked = record["tracked"] and {**record["tracked"], "s": 0, "cpu_s": 0}
    return {**record, "located": located, "tracked": tracked}


def test_a_recorded_room(done: Path) -> None:
    """The recording of the home is a data set like any other."""
    (recording,) = (done / "work" / "recordings").glob("bedroom_3_*")
    run = ("bench", "relocalize", "--real", recording, "--fold", "1", *MAPPED)
    process = gslts(*run, "--json", "room.json", cwd=done)
    assert process.returncode == 0, process.stderr
    found = records(done / "room.json")
    assert [record["id"] for record in found] == [f"{k:05}" for k in range(1, 32, FOLDS)]
    content = json.loads((done / "room.json").read_text())
    assert content["errors"] == {}
    assert content["summary"]["corrected"]["far"] >= 2
    assert content["summary"]["given"]["far"] >= 2
    (made_of,) = (done / "work" / "maps").glob("*_without_1_*/cameras.json")
    assert not set(json.loads(made_of.read_text())) & {record["id"] for record in found}
    assert "| by the given poses | 4 |" in process.stdout
    again = gslts(*run, cwd=done)
    assert again.stdout.splitlines()[-5:] == process.stdout.splitlines()[-5:], "the same table"
