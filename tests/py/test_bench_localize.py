"""`gslts bench localize` as a user meets it, in one small home, and how it counts."""

import json
from pathlib import Path

import numpy as np
import pytest
from bench_settings import SETTINGS
from command import gslts
from PIL import Image

from gslts.bench.localize_run import (
    CATEGORIES,
    OURS,
    TRADE,
    Found,
    Record,
    Variant,
    best_ious,
    iou_of,
)
from gslts.bench.localize_tables import printed, summary
from gslts.tasks.localize import Instance

SMALL = ("--room", "bedroom", "--seeds", "3:4", "--size", "240x180", "--frames", "32")
RUN = ("bench", "localize", *SMALL, *SETTINGS, "--set", "voxel_m=0.05")
UNIT = np.array([[0.0, 0, 0], [1, 1, 1]])


def instance(low: float, high: float) -> Instance:
    box = np.full(3, low), np.full(3, high)
    return Instance(*box, np.zeros((4, 2)), 0.7, np.arange(3))


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder in which the benchmark ran."""
    folder = tmp_path_factory.mktemp("bench")
    process = gslts(
        *RUN, "--json", "all.json", "--trade", "trade.png", "--work", "work", cwd=folder
    )
    assert process.returncode == 0, process.stderr
    (folder / "stdout").write_text(process.stdout)
    return folder


def test_every_object_of_a_category_is_asked_for(done: Path) -> None:
    told = json.loads((done / "all.json").read_text())
    assert {one["variant"] for one in told["records"]} == {OURS, *TRADE}
    things = json.loads(next((done / "work/recordings").glob("*/objects.json")).read_text())
    expected = sorted(one["objectId"] for one in things if one["objectType"] in CATEGORIES)
    assert expected
    for one in told["records"]:
        assert sorted(found["object_id"] for found in one["found"]) == expected
        assert len(one["query_s"]) == len(CATEGORIES)
        assert one["absent"][1] == len(CATEGORIES) - len({name.split("|")[0] for name in expected})
    bytes_of = {one["variant"]: one["feature_bytes"] for one in told["records"]}
    assert bytes_of["d = 64"] == 8 * bytes_of["d = 8"]


def test_a_bed_is_found_even_in_a_rough_map(done: Path) -> None:
    found = json.loads((done / "all.json").read_text())["summary"][OURS]["categories"]
    assert found["Bed"]["mIoU"] > 0.5


def test_tables_and_picture(done: Path) -> None:
    text = (done / "stdout").read_text()
    assert "| GS-LTS (GT), as printed |" in text
    assert text.count("\n| d = ") == 4
    with Image.open(done / "trade.png") as picture:
        assert picture.size[0] > 900


def test_an_interrupted_run_goes_on(done: Path) -> None:
    before = json.loads((done / "all.json").read_text())
    process = gslts(*RUN, "--json", "again.json", "--trade", "t.png", "--work", "work", cwd=done)
    assert process.returncode == 0, process.stderr
    assert json.loads((done / "again.json").read_text())["records"] == before["records"]


def test_iou_by_hand() -> None:
    assert iou_of(UNIT, UNIT) == 1
    assert iou_of(UNIT, UNIT + 0.5) == pytest.approx(0.125 / 1.875)
    assert iou_of(UNIT, UNIT + 2) == 0


def test_an_instance_serves_one_object() -> None:
    boxes, one = [UNIT, UNIT + 0.1], instance(0, 1)
    assert sorted(best_ious(boxes, [one])) == [0, 1]
    assert best_ious(boxes, []) == [0, 0]
    assert best_ious([], [one]) == []


def test_the_summary_counts_all_objects() -> None:
    def record(*ious: float) -> Record:
        found = [
            Found(object_id=f"Sofa|{k}", category="Sofa", iou=iou) for k, iou in enumerate(ious)
        ]
        return Record(id=OURS, home="x", variant=OURS, found=tuple(found), query_s=(0.1,))

    found = summary([record(0.2, 0.4), record(0.9), record()])
    assert found[OURS]["mIoU"] == pytest.approx(0.5)
    assert found[OURS]["Acc@0.5"] == pytest.approx(1 / 3)
    assert found[OURS]["Acc@0.3"] == pytest.approx(2 / 3)
    assert "| Sofa | 3 | 0.500 | 0.333 | 0.667 |" in printed(found)


def test_variants_are_recorded_as_they_want() -> None:
    from gslts.bench.homes import BenchHome, HomeSetup

    bench = BenchHome("kitchen", 3, HomeSetup(frames=50, code={}), Path())
    assert Variant(frames_share=0.6).home(bench).setup.frames == 30
    small = Variant(width=320, height=240).home(bench).setup
    assert (small.width, small.height, small.frames) == (320, 240, 50)
