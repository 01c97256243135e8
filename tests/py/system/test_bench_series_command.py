"""The command `gslts bench series` on one small home."""

import json
from pathlib import Path
from typing import Any

import pytest
from bench_settings import SETTINGS
from command import gslts
from drawn import assert_drawn

from gslts_bench.series.run import BEFORE, MAPS, REBUILT, UPDATED
from gslts_bench.series.tables import GAIN

pytestmark = pytest.mark.long

SMALL = ("--room", "kitchen", "--seeds", "4:5", "--changes", "4", "--every", "2")
RUN = ("bench", "series", *SMALL, "--size", "240x180", "--frames", "32", *SETTINGS)


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder in which the benchmark ran."""
    folder = tmp_path_factory.mktemp("series")
    given = ("--json", "all.json", "--plot", "plot.png", "--work", "work")
    process = gslts(*RUN, "--set", "voxel_m=0.05", *given, cwd=folder)
    assert process.returncode == 0, process.stderr
    (folder / "stdout").write_text(process.stdout)
    return folder


def found(folder: Path) -> dict[str, Any]:
    content: dict[str, Any] = json.loads((folder / "all.json").read_text())
    return content


def test_each_change_goes_on_from_the_map_after_the_one_before(done: Path) -> None:
    records = found(done)["records"]
    assert [record["id"] for record in records[:-1]] == [f"kitchen_4/00{k}" for k in range(1, 5)]
    steps = [record["step"] for record in records[:-1]]
    assert [step["psnr_db"] is not None for step in steps] == [False, True, False, True]
    end = found(done)["records"][-1]["end"]
    size = end["gaussians"][BEFORE]
    updated = 0
    for step in steps:
        if step["changes"] == 0 or step["rejected"] is not None:
            assert step["gaussians"] == size
        else:
            updated += 1
            assert step["seconds"] > 0
        size = step["gaussians"]
    assert size == end["gaussians"][UPDATED]
    assert updated > 0


def test_the_end_is_compared_with_a_rebuilt_map(done: Path) -> None:
    end = found(done)["records"][-1]["end"]
    assert set(end["psnr_db"]) == set(MAPS) == set(end["gaussians"])
    assert end["psnr_db"][UPDATED] > end["psnr_db"][BEFORE], "it was updated"
    assert end["gaussians"][REBUILT] != end["gaussians"][BEFORE], "another map"
    maps = sorted(path.name.rpartition("_")[0] for path in (done / "work/maps").glob("k*"))
    assert maps == ["kitchen_4", "kitchen_4_end"]


def test_the_table_and_the_plot_are_made(done: Path) -> None:
    text = (done / "stdout").read_text()
    assert "| kitchen_4, 4 changes |" in text
    assert GAIN in text
    assert_drawn(done / "plot.png")


def test_a_file_that_cannot_be_written_is_named_before_the_work(tmp_path: Path) -> None:
    process = gslts(*RUN, "--set", "voxel_m=0.05", "--work", "x/y", "--json", "/", cwd=tmp_path)
    assert process.returncode != 0
    assert process.stderr.count("\n") == 1
    assert "Traceback" not in process.stderr
