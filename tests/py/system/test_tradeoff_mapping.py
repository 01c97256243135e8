"""Accuracy against time and number of Gaussians: figures of a small room, files and the command."""

import csv
import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from bench_units import Bar
from clocks import make_mapping_tick
from command import gslts as run
from PIL import Image
from sim_scenes import textured_home
from typer.testing import CliRunner, Result

from gslts.cli import app
from gslts.datasets import Dataset, open_dataset
from gslts.fleet.jobs import read_results, run_units
from gslts.io.ply import write_ply
from gslts.mapping.config import PRESETS
from gslts.mapping.evaluation.held_out import TrainingRecord
from gslts.store.manifest import read_manifest
from gslts.store.map_folder import read_map
from gslts_bench.tradeoff import mapping as tradeoff_mapping
from gslts_bench.tradeoff.mapping import COUNTS, seconds_of, split_of
from gslts_bench.tradeoff.rendering import SETTINGS
from gslts_bench.tradeoff.units import point_of, units_of
from gslts_sim.capture import capture
from gslts_sim.controller import Controller
from gslts_sim.explore import explore

STEPS = 100
"""More than two for each frame."""


@dataclass(frozen=True)
class Paths:
    """A recorded visit, a map of it, and what the command wrote and printed about both."""

    visit: Path
    map: Path
    out: Path
    printed: str


@pytest.fixture(scope="module")
def paths(tmp_path_factory: pytest.TempPathFactory) -> Paths:
    folder = tmp_path_factory.mktemp("tradeoff")
    home = textured_home()
    viewpoints, _ = explore(home, 40)
    visit, made, out = folder / "visit", folder / "map", folder / "out"
    capture(Controller(home, width=96, height=72, noise="kinect"), viewpoints, visit)
    preset = ("--preset", "fast")
    call("map", visit, "--iterations", 200, *preset, "--out", made)
    arguments = (made, visit, "--seconds", "2,1", "--rounds", 1, *preset, "--out", out)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tradeoff_mapping, "MIN_STEPS", STEPS)
        make_mapping_tick(patch, 0.02)
        return Paths(visit, made, out, call("tradeoff", *arguments).output)


def call(*arguments: str | Path | float) -> Result:
    """Outputs of the command, which succeeds."""
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert result.exit_code == 0, (result.output, result.exception)
    return result


def rows_of(out: Path) -> list[dict[str, str]]:
    with (out / "tradeoff_mapping.csv").open() as file:
        return list(csv.DictReader(file))


def test_there_is_a_row_for_each_map(paths: Paths) -> None:
    rows = rows_of(paths.out)
    assert [row["name"] for row in rows] == ["the map", *COUNTS, "1 s", "2 s"]
    assert [row["kind"] for row in rows] == ["map", *["gaussians"] * 5, *["time"] * 2]
    result = json.loads((paths.out / "tradeoff_mapping.json").read_text())
    for row, point in zip(rows, result["points"], strict=True):
        texts = {name: "" if value is None else str(value) for name, value in point.items()}
        assert row == texts
    for row in rows:
        assert f"{row['name']}: {row['gaussians']} Gaussians" in paths.printed


def test_the_map_itself_is_judged_as_when_it_was_made(paths: Paths) -> None:
    row, manifest = rows_of(paths.out)[0], read_manifest(paths.map)
    for way in ("given", "by_neighbours", "refined"):
        wanted = manifest["test"][way]["psnr_db"]
        assert float(row[f"{way}_psnr_db"]) == pytest.approx(wanted, abs=1e-5)
    assert int(row["gaussians"]) == manifest["gaussians"]
    spent = {stage: s for stage, s in manifest["seconds"].items() if stage != "evaluation"}
    assert float(row["seconds"]) == pytest.approx(sum(spent.values()))


def test_counts_are_those_asked_for_and_few_show_less(paths: Paths) -> None:
    itself, *sized = rows_of(paths.out)[:6]
    for row, share in zip(sized, COUNTS.values(), strict=True):
        wanted = share * int(itself["gaussians"])
        assert wanted * 0.9 < int(row["gaussians"]) <= wanted + 1
        assert (row["seconds"], row["steps"]) == ("", str(STEPS))
    psnr_db = [float(row["refined_psnr_db"]) for row in sized]
    assert psnr_db[0] < psnr_db[2] < psnr_db[3]


def test_more_time_is_used_for_more_steps(paths: Paths) -> None:
    short, long = rows_of(paths.out)[-2:]
    assert float(short["seconds"]) < float(long["seconds"])
    assert 0.9 < float(short["seconds"]) < 1.2
    assert 1.9 < float(long["seconds"]) < 2.2
    assert int(short["steps"]) < int(long["steps"])


def test_plots_and_the_table_of_the_renderer(paths: Paths) -> None:
    assert sorted(path.name for path in paths.out.iterdir()) == [
        "tradeoff_mapping.csv",
        "tradeoff_mapping.json",
        "tradeoff_mapping.png",
        "tradeoff_renderer.csv",
        "tradeoff_renderer.png",
    ]
    with Image.open(paths.out / "tradeoff_mapping.png") as image:
        assert image.width > 1000
        assert len(image.convert("RGB").getcolors(1 << 24)) > 50
    with (paths.out / "tradeoff_renderer.csv").open() as file:
        assert {row["knob"] for row in csv.DictReader(file)} == {
            setting.knob for setting in SETTINGS
        }


def test_a_plain_file_is_judged_without_neighbours(
    paths: Paths, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    make_mapping_tick(monkeypatch, 0.02)
    monkeypatch.setattr(tradeoff_mapping, "MIN_STEPS", 5)
    monkeypatch.setattr(tradeoff_mapping, "MIN_VISITS", 0)
    write_ply(read_map(paths.map), tmp_path / "any.ply")
    common = ("--seconds", 1, "--rounds", 1, "--preset", "fast", "--out", tmp_path / "out")
    call("tradeoff", tmp_path / "any.ply", paths.visit, *common)
    rows = rows_of(tmp_path / "out")
    assert [row["by_neighbours_psnr_db"] == "" for row in rows] == [True] * 6 + [False]
    assert (rows[0]["seconds"], rows[1]["steps"]) == ("", "5")
    assert (tmp_path / "out" / "tradeoff_mapping.png").exists()


def test_workers_measure_the_same(paths: Paths, tmp_path: Path) -> None:
    config = PRESETS["fast"].model_copy(update={"threads": 1})
    units = units_of(paths.map, paths.visit, config, [1.0], tmp_path)
    names = [unit.name for unit in units]
    assert names == ["the map", *COUNTS, "1 s"]
    again = units_of(paths.map, paths.visit, config, [1.0], tmp_path)
    assert again == units, "the files of results must be the same"
    chosen = [unit for unit in units if unit.name in ("the map", "an eighth")]
    found = run_units(chosen, 2, Bar())
    for unit in chosen:
        alone: list[dict] = []
        unit.run(frozenset(), alone.append)
        assert found[unit.name] == alone
        assert point_of(alone[0]).name == unit.name
        assert read_results(unit.results) == alone


class Torn:
    """A frame that cannot be read."""

    def __init__(self, like: object) -> None:
        self.name, self.camera = "torn", like.camera

    def read(self) -> None:
        raise ValueError("torn.png: it is torn")


def test_frames_are_chosen_as_when_the_map_was_made(paths: Paths) -> None:
    dataset = open_dataset(paths.visit)
    torn = Torn(dataset.frames[0])
    worse = replace(dataset, frames=(dataset.frames[0], torn, *dataset.frames))
    names = [frame.name for frame in dataset.frames]
    for record, test in (
        (TrainingRecord.read(paths.map), names[::16]),
        (TrainingRecord(), names[::8]),
    ):
        split = split_of(worse, record)
        assert list(split.test.observations) == test
        assert [*split.test.observations, *split.validation.observations] == [
            *test,
            *(name for name in names[::8] if name not in test),
        ]
        assert list(split.training)[6:8] == [names[7], names[9]]
    corrected = split_of(worse, TrainingRecord.read(paths.map))
    assert [len(near) for near in corrected.test.neighbours] == [1, 2, 2]
    assert all(
        np.abs(observation.correction - np.eye(4)).max() > 1e-5
        for observation in corrected.training.values()
    )
    everything = {frame.name: frame.camera for frame in dataset.frames}
    with pytest.raises(ValueError, match="the map was made from all of its frames"):
        split_of(dataset, TrainingRecord(everything))


def test_unusable_frames_say_why(paths: Paths) -> None:
    frames = open_dataset(paths.visit).frames
    few = Dataset("few", (*frames[:3], Torn(frames[0])))
    with pytest.raises(ValueError, match="few: 1 of 4 frames cannot be used, such as torn"):
        split_of(few, TrainingRecord())


def test_a_map_tells_how_long_it_was_made() -> None:
    assert seconds_of({"seconds": {"reading": 1, "optimization": 2.5, "evaluation": 9.0}}) == 3.5
    for other in ({}, {"seconds": 3}, {"seconds": {}}, {"seconds": {"reading": "1"}}):
        assert seconds_of(other) is None
    assert seconds_of({"seconds": {"reading": float("nan")}}) is None


def elsewhere(paths: Paths, folder: Path) -> list[str | Path]:
    gaussian_map = read_map(paths.map)
    write_ply(replace(gaussian_map, origin=np.array([900.0, 0, 0])), folder / "far.ply")
    return [folder / "far.ply", paths.visit]


def into_a_full_folder(paths: Paths, _: Path) -> list[str | Path]:
    return [paths.map, paths.visit, "--out", paths.out]


def into_a_file(paths: Paths, folder: Path) -> list[str | Path]:
    (folder / "file").write_text("")
    return [paths.map, paths.visit, "--out", folder / "file"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        *(
            (lambda p, _, s=seconds: [p.map, p.visit, "--seconds", s], "--seconds: expected numb")
            for seconds in ("", "ten", "10,0.5", "nan", "5,inf", "10;20")
        ),
        (lambda p, _: [p.map], "give MAP and DATASET, or --map alone"),
        (lambda p, _: ["--map", p.map, "--jobs", "2"], "are for maps of a data set"),
        (lambda p, _: [p.map, p.visit, "--map", p.map], "give MAP and DATASET, or --map alone"),
        (lambda p, f: [f / "none", p.visit], "none"),
        (lambda p, f: [p.map, f / "none"], "there is no such file or folder"),
        (lambda p, f: [p.map, f], "no data set of a known format"),
        (lambda p, _: [p.visit, p.visit], "manifest.json"),
        (into_a_full_folder, "is not empty"),
        (into_a_file, "File exists"),
        (elsewhere, "far.ply: it fills 1 % of the frames of visit; give the data set"),
    ],
)
def test_rejections(
    paths: Paths,
    tmp_path: Path,
    arguments: Callable[[Paths, Path], list[str | Path]],
    message: str,
) -> None:
    given = arguments(paths, tmp_path)
    out = () if "--out" in given else ("--out", tmp_path / "out")
    result = CliRunner().invoke(app, ["tradeoff", *map(str, (*given, *out))])
    assert isinstance(result.exception, OSError | ValueError), result.output
    assert message in str(result.exception)


def test_an_error_is_one_line(paths: Paths, tmp_path: Path) -> None:
    done = run("tradeoff", paths.map, paths.visit, "--seconds", "x", "--out", "o", cwd=tmp_path)
    assert done.returncode == 1
    assert done.stderr == (
        "gslts: --seconds: expected numbers of at least 1, separated by commas, got 'x'\n"
    )
    assert list(tmp_path.iterdir()) == []
