"""The command `gslts bench update` on one small home."""

import json
from pathlib import Path
from typing import Any

import pytest
from bench_settings import SETTINGS
from command import gslts
from PIL import Image

from gslts_bench.update.methods import METHODS
from gslts_bench.update.run import MARKS

pytestmark = pytest.mark.long

VIEWS = 7
SMALL = ("--room", "kitchen", "--seeds", "3:4", "--tasks", "3", "--size", "240x180")
MAPPED = ("--frames", "64", *SETTINGS, "--set", "voxel_m=0.05")
RUN = ("bench", "update", *SMALL, *MAPPED, "--views", str(VIEWS))


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder in which the benchmark ran."""
    folder = tmp_path_factory.mktemp("bench")
    outputs = ("--json", "all.json", "--images", "images", "--curve", "curve.png")
    process = gslts(*RUN, *outputs, "--curve-tasks", "3", "--work", "work", cwd=folder)
    assert process.returncode == 0, process.stderr
    (folder / "stdout").write_text(process.stdout)
    return folder


def records(folder: Path) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = json.loads((folder / "all.json").read_text())["records"]
    return found


def test_each_detected_change_is_updated_with_each_method(done: Path) -> None:
    by_task: dict[str, set[str]] = {}
    for record in records(done):
        by_task.setdefault(record["task"], set()).add(record["method"])
    assert len(by_task) == 3
    detected = [methods for methods in by_task.values() if methods != {"not detected"}]
    assert detected
    curves = {"curve, plain fine-tuning", "curve, ours"}
    for methods in detected:
        assert methods == {*METHODS, *curves}


def test_records_hold_counts_and_times(done: Path) -> None:
    by_method: dict[str, list[dict[str, Any]]] = {}
    for record in records(done):
        by_method.setdefault(record["method"], []).append(record)
    for record in by_method["ours"]:
        before, after = record["gaussians"]
        if record["rejected"] is None:
            assert after == before - record["removed"] + record["added"]
        assert set(record["seconds"]) >= {"update", "collecting"}
        assert 0 < record["views"] <= (2 if record["kind"] == "relocation" else 1) * VIEWS
    for record in by_method["no update"]:
        assert record["gaussians"][0] == record["gaussians"][1]
    for plain, none in zip(by_method["plain fine-tuning"], by_method["no update"], strict=True):
        assert plain["scores"]["near"]["psnr_db"] > none["scores"]["near"]["psnr_db"]
        assert plain["scores"]["near"]["lpips"] is None
    updated = {record["task"] for record in by_method["ours"] if record["rejected"] is None}
    assert updated
    for record in by_method["curve, ours"]:
        within = {"50 of 250"} if record["task"] in updated else set()
        assert set(record["curve"]) == {*map(str, MARKS)} | within


def test_the_curve_starts_without_an_update(done: Path) -> None:
    found = {record["id"]: record for record in records(done)}
    for record in found.values():
        if record["method"] == "curve, plain fine-tuning":
            none = found[f"{record['task']}: no update"]["scores"]
            expected = [none[view]["psnr_db"] for view in ("near", "far")]
            assert record["curve"]["0"] == pytest.approx(expected)


def test_tables_and_images_are_made(done: Path) -> None:
    text = (done / "stdout").read_text()
    for name in METHODS:
        assert f"| {name} | near |" in text
    assert "PSNR against iterations" in text
    images = sorted((done / "images").iterdir())
    updated = {record["task"] for record in records(done) if record["method"] == "ours"}
    assert len(images) == len(updated)
    with Image.open(images[0]) as image, Image.open(done / "curve.png") as curve:
        assert image.size == (5 * 120, 4 * 90)
        assert curve.size[0] > 500


def test_finished_results_are_reused(done: Path) -> None:
    (kept,) = (done / "work" / "update").glob("*.jsonl")
    before = kept.read_bytes()
    process = gslts(*RUN, "--work", "work", "--json", "again.json", cwd=done)
    assert process.returncode == 0, process.stderr
    assert kept.read_bytes() == before
    again = json.loads((done / "again.json").read_text())
    assert {record["id"] for record in again["records"]} == {
        record["id"] for record in records(done)
    }


def test_bad_input_is_named(tmp_path: Path) -> None:
    for arguments, message in (
        (("--lpips-heads", "x.pth"), "LPIPS needs both"),
        (("--seeds", "3"), "--seeds: expected A:B"),
        (("--room", "attic"), "room types"),
    ):
        process = gslts("bench", "update", *arguments, cwd=tmp_path)
        assert process.returncode == 1
        assert "Traceback" not in process.stderr
        assert message in process.stderr
