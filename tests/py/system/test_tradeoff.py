"""The trade-off between speed and accuracy: figures, files and the command."""

import csv
import json
import math
from pathlib import Path

import numpy as np
import pytest
import scenes
from PIL import Image
from typer.testing import CliRunner

import gslts
from gslts.cli import app
from gslts.io.ply import write_ply
from gslts.store.map_folder import write_map_folder
from gslts_bench.synthetic_rooms import SIZES, make_room
from gslts_bench.tradeoff import rendering as tradeoff


@pytest.fixture(scope="module")
def points() -> list[tradeoff.Point]:
    gaussian_map = scenes.random_map(400, sh_degree=3, dtype=np.float32)
    return tradeoff.measure(gaussian_map, scenes.orbit_camera(64, 48), rounds=2)


def find(points: list[tradeoff.Point], knob: str, value: str) -> tradeoff.Point:
    return next(p for p in points if (p.knob, p.value) == (knob, value))


def test_errors_fall_as_a_knob_is_turned_up(points: list[tradeoff.Point]) -> None:
    for knob in ("alpha cut-off", "transmittance stop"):
        of_knob = [p for p in points if p.knob == knob]
        psnr = [p.psnr_db for p in of_knob]
        assert psnr == sorted(psnr), knob
        assert of_knob[0].gradient_error > of_knob[-1].gradient_error
        assert of_knob[0].max_error >= of_knob[-1].max_error
    assert find(points, "SH degree", "2").psnr_db < points[0].psnr_db
    assert find(points, "resolution", "1/4").psnr_db < find(points, "resolution", "1/2").psnr_db


def test_the_default_is_between_its_neighbours(points: list[tradeoff.Point]) -> None:
    default = points[0]
    assert default.knob == "default"
    assert find(points, "alpha cut-off", "1/255").psnr_db < default.psnr_db
    assert default.psnr_db < find(points, "alpha cut-off", "1/1024").psnr_db


def test_without_cut_offs_float_is_near_exact(points: list[tradeoff.Point]) -> None:
    exact = find(points, "no cut-off", "float32")
    assert exact.psnr_db > 100
    assert exact.gradient_error < 1e-3


def test_errors_are_those_of_the_images() -> None:
    """Against a comparison by hand, with a coarse setting."""
    gaussian_map, camera = scenes.random_map(100, dtype=np.float32), scenes.orbit_camera()
    coarse = tradeoff.Setting("alpha cut-off", "1/4", {"alpha_min": 0.25})
    _, point = tradeoff.measure(
        gaussian_map, camera, rounds=1, settings=(tradeoff.SETTINGS[0], coarse)
    )
    exact = gslts.render(
        gaussian_map.astype(np.float64),
        camera,
        gslts.RenderOptions(alpha_min=1e-30, transmittance_min=0),
    ).rgb
    rgb = gslts.render(gaussian_map, camera, gslts.RenderOptions(alpha_min=0.25)).rgb
    assert point.psnr_db == pytest.approx(-10 * math.log10(np.mean((rgb - exact) ** 2)), abs=1e-6)
    assert point.max_error == pytest.approx(np.abs(rgb - exact).max())


def test_the_front_holds_points_that_none_dominates() -> None:
    ms = np.array([10.0, 5.0, 12.0, 10.1, 20.0])
    psnr = np.array([60.0, 40.0, 59.0, 60.05, 80.0])
    # The fourth differs from the first by less than the resolutions of time and PSNR.
    assert tradeoff.pareto_front(ms, psnr).tolist() == [True, True, False, True, True]
    assert tradeoff.pareto_front(np.array([1.0, 1.0]), np.array([50.0, 51.0])).tolist() == [
        False,
        True,
    ]


def test_the_command_writes_table_and_plot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(SIZES, "S", type(SIZES["S"])(2000, 64, 48))
    result = CliRunner().invoke(
        app, ["tradeoff", "--scene", "S", "--rounds", "1", "--out", str(tmp_path / "new")]
    )
    assert result.exit_code == 0, result.output
    assert "default:" in result.output
    with (tmp_path / "new" / "tradeoff_S.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["knob"] for row in rows] == [setting.knob for setting in tradeoff.SETTINGS]
    assert all(float(row["psnr_db"]) > 10 for row in rows if row["knob"] == "alpha cut-off")
    with Image.open(tmp_path / "new" / "tradeoff_S.png") as image:
        assert image.width > 1000
        assert len(image.convert("RGB").getcolors(1 << 24)) > 50


def test_errors_name_what_is_wrong() -> None:
    gaussian_map, camera = scenes.random_map(5, dtype=np.float32), scenes.orbit_camera()
    with pytest.raises(ValueError, match="rounds must be at least 1, got 0"):
        tradeoff.measure(gaussian_map, camera, rounds=0)
    with pytest.raises(ValueError, match="at least 4 px"):
        tradeoff.measure(gaussian_map, scenes.orbit_camera(3, 30))
    with pytest.raises(ValueError, match="sees nothing"):
        tradeoff.measure(gaussian_map, scenes.orbit_camera(target=(-90, 0, 0)))
    with pytest.raises(ValueError, match="one of S, M, L, got 'XL'"):
        make_room("XL")


def test_the_command_takes_maps(tmp_path: Path) -> None:
    """A folder is seen from its first camera, a plain file from a pose."""
    gaussian_map = scenes.random_map(300, dtype=np.float32)
    cameras = {"first": scenes.orbit_camera(48, 32), "second": scenes.orbit_camera(2, 2)}
    write_map_folder(tmp_path / "$map$", gaussian_map, {}, cameras)
    folder, out, ply = tmp_path / "$map$", tmp_path / "out", tmp_path / "map.ply"
    write_ply(gaussian_map, ply)
    common = ("--rounds", "1", "--out", str(out))
    result = CliRunner().invoke(app, ["tradeoff", "--map", str(folder), *common])
    assert result.exit_code == 0, result.output
    assert (out / "tradeoff_$map$.png").exists()
    pose = {"world_from_camera": cameras["first"].world_from_camera.tolist()}
    (tmp_path / "pose.json").write_text(json.dumps(pose))
    arguments = ("--map", str(ply), "--pose", str(tmp_path / "pose.json"))
    result = CliRunner().invoke(app, ["tradeoff", *arguments, *common])
    assert result.exit_code == 0, result.output
    with (out / "tradeoff_map.csv").open() as file:
        knobs = [row["knob"] for row in csv.DictReader(file)]
    assert knobs == [setting.knob for setting in tradeoff.SETTINGS]
    for wrong in (("--map", str(ply)), ("--pose", "first")):
        result = CliRunner().invoke(app, ["tradeoff", *wrong, *common])
        assert isinstance(result.exception, ValueError)
