"""The command `gslts bench queries` on one small home."""

import json
from pathlib import Path

import pytest
from bench_settings import SETTINGS
from command import gslts
from PIL import Image

from gslts_bench.queries.run import CATEGORIES, OURS, TRADE

pytestmark = pytest.mark.long

SMALL = ("--room", "bedroom", "--seeds", "3:4", "--size", "240x180", "--frames", "32")
RUN = ("bench", "queries", *SMALL, *SETTINGS, "--set", "voxel_m=0.05")


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
    result = json.loads((done / "all.json").read_text())
    assert {record["variant"] for record in result["records"]} == {OURS, *TRADE}
    things = json.loads(next((done / "work/recordings").glob("*/objects.json")).read_text())
    expected = sorted(thing["objectId"] for thing in things if thing["objectType"] in CATEGORIES)
    assert expected
    for record in result["records"]:
        assert sorted(found["object_id"] for found in record["found"]) == expected
        assert len(record["query_s"]) == len(CATEGORIES)
        assert record["absent"][1] == len(CATEGORIES) - len(
            {name.split("|")[0] for name in expected}
        )
    bytes_of = {record["variant"]: record["feature_bytes"] for record in result["records"]}
    assert bytes_of["d = 64"] == 8 * bytes_of["d = 8"]


def test_a_bed_is_found_even_in_a_rough_map(done: Path) -> None:
    found = json.loads((done / "all.json").read_text())["summary"][OURS]["categories"]
    assert found["Bed"]["mIoU"] > 0.5


def test_tables_and_plot(done: Path) -> None:
    text = (done / "stdout").read_text()
    assert "| GS-LTS (GT), as printed |" in text
    assert text.count("\n| d = ") == 4
    with Image.open(done / "trade.png") as image:
        assert image.size[0] > 900


def test_an_interrupted_run_goes_on(done: Path) -> None:
    before = json.loads((done / "all.json").read_text())
    process = gslts(*RUN, "--json", "again.json", "--trade", "t.png", "--work", "work", cwd=done)
    assert process.returncode == 0, process.stderr
    assert json.loads((done / "again.json").read_text())["records"] == before["records"]
