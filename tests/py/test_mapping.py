"""From a data set to a map: what it reaches, that it repeats, and what stops it."""

import json
from pathlib import Path

import numpy as np
import pytest
import sim_scenes
from test_cli_sim import gslts as run

import gslts
from gslts.datasets import Dataset, open_dataset
from gslts.map_folder import read_map_folder, write_map_folder
from gslts.mapping.config import PRESETS, MappingConfig
from gslts.mapping.engine import make_map
from gslts.mapping.evaluate import evaluate
from gslts.sim.capture import capture
from gslts.sim.controller import Controller
from gslts.sim.explore import explore
from gslts.sim.home import Home

CONFIG = MappingConfig(iterations=400, voxel_m=0.1, coarse_share=0.3)


def textured_home() -> Home:
    rng = np.random.default_rng(0)
    tiles = rng.integers(40, 220, (2, 2, 3)).astype(np.uint8).repeat(16, 0).repeat(16, 1)
    return sim_scenes.simple_home(wall=tiles)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A visit of a room with the errors of a real camera, and the same without."""
    folders = {}
    home = textured_home()
    looks, _ = explore(home, 60)
    for noise in ("kinect", "none"):
        folders[noise] = tmp_path_factory.mktemp("visit") / noise
        capture(Controller(home, width=160, height=120, noise=noise), looks, folders[noise])
    return folders


def test_a_map_shows_what_was_kept_aside(recorded: dict[str, Path]) -> None:
    dataset, clean = (open_dataset(recorded[noise]) for noise in ("kinect", "none"))
    seen = []
    result = make_map(dataset, CONFIG, report=seen.append)
    assert [progress.iteration for progress in seen] == list(range(1, CONFIG.iterations + 1))
    assert result.skipped == ()
    truth = [frame.read() for frame in clean.frames[::8]]
    quality = evaluate(result.gaussian_map, truth)
    assert quality.frames == 8
    assert quality.psnr_db > 28
    assert quality.depth_l1_m < 0.04
    start = make_map(dataset, CONFIG.model_copy(update={"iterations": 1})).gaussian_map
    assert quality.psnr_db > evaluate(start, truth).psnr_db + 3
    fixed = CONFIG.model_copy(update={"refine_poses": False})
    with_given_poses = evaluate(make_map(dataset, fixed).gaussian_map, truth)
    assert quality.psnr_db > with_given_poses.psnr_db + 0.2, "corrected poses make sharper maps"


def test_the_same_for_any_number_of_threads(recorded: dict[str, Path]) -> None:
    dataset = open_dataset(recorded["kinect"])
    maps = [
        make_map(dataset, CONFIG.model_copy(update={"iterations": 60, "threads": threads}))
        for threads in (1, 2)
    ]
    for name in ("means", "quats", "log_scales", "logit_opacities", "sh"):
        first, second = (getattr(result.gaussian_map, name) for result in maps)
        assert first.tobytes() == second.tobytes(), name


def test_few_bad_frames_are_skipped_and_many_stop(recorded: dict[str, Path]) -> None:
    dataset = open_dataset(recorded["none"])

    class Bad:
        name, camera = "bad", dataset.frames[0].camera

        def read(self) -> None:
            raise ValueError("bad.png: it is torn")

    few = Dataset("few", (*dataset.frames, Bad()), ("early: no pose",))
    config = CONFIG.model_copy(update={"iterations": 2})
    assert make_map(few, config).skipped == ("early: no pose", "bad: bad.png: it is torn")
    many = Dataset("many", (*dataset.frames[:20], *[Bad()] * 10))
    with pytest.raises(ValueError, match="many: 10 of 30 frames cannot be used, such as bad: bad"):
        make_map(many, config)
    with pytest.raises(ValueError, match="short: 6 frames are too few"):
        make_map(Dataset("short", dataset.frames[:6]), config)


def test_presets_differ_in_what_they_cost() -> None:
    assert PRESETS["fast"].iterations < PRESETS["balanced"].iterations < PRESETS["best"].iterations
    with pytest.raises(ValueError, match="voxel"):
        MappingConfig(voxel_m=0)


def small_map() -> gslts.GaussianMap:
    return gslts.GaussianMap(
        means=np.zeros((2, 3)),
        quats=np.tile([1.0, 0, 0, 0], (2, 1)),
        log_scales=np.zeros((2, 3)),
        logit_opacities=np.zeros(2),
        sh=np.zeros((2, 1, 3)),
        ids=np.array([7, 9], np.uint64),
    ).astype(np.float32)


def test_map_folders_come_back(tmp_path: Path) -> None:
    camera = gslts.camera_from_fov(8, 6, 1.0, np.eye(4))
    write_map_folder(tmp_path / "map", small_map(), {"dataset": "x"}, {"a": camera})
    gaussian_map, manifest = read_map_folder(tmp_path / "map")
    np.testing.assert_array_equal(gaussian_map.ids, [7, 9])
    assert manifest["dataset"] == "x"
    cameras = json.loads((tmp_path / "map" / "cameras.json").read_text())
    assert cameras["a"]["world_from_camera"] == np.eye(4).tolist()
    assert [path.name for path in tmp_path.iterdir()] == ["map"]
    with pytest.raises(FileExistsError, match="map is there already"):
        write_map_folder(tmp_path / "map", small_map(), {}, {})


def test_nothing_half_written_looks_like_a_map(tmp_path: Path) -> None:
    with pytest.raises(TypeError):
        write_map_folder(tmp_path / "map", small_map(), {"bad": object()}, {})
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("manifest", "message"),
    [
        ("{", r"manifest\.json: Expecting"),
        ("[]", "not the manifest of a map"),
        ('{"format": "gslts-map", "version": 2}', "version is 2, this gslts reads 1"),
        ('{"format": "gslts-map", "version": 1, "gaussians": 3}', "has 2 Gaussians, the manifest"),
    ],
)
def test_folders_that_are_no_maps_are_named(tmp_path: Path, manifest: str, message: str) -> None:
    write_map_folder(tmp_path / "map", small_map(), {}, {})
    (tmp_path / "map" / "manifest.json").write_text(manifest)
    with pytest.raises(ValueError, match=message):
        read_map_folder(tmp_path / "map")


def test_the_commands(recorded: dict[str, Path], tmp_path: Path) -> None:
    arguments = ("map", recorded["kinect"], "--iterations", "30", "--preset", "fast")
    done = run(*arguments, "--out", "map", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "8 frames kept aside" in done.stdout
    done = run("eval", "map", recorded["none"], "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    quality = json.loads(done.stdout)
    assert quality["frames"] == 8
    assert quality["psnr_db"] > 15
    done = run(*arguments, "--out", "map", cwd=tmp_path)
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1] == "gslts: map is there already"
    done = run("map", tmp_path, "--out", "other", cwd=tmp_path)
    assert done.returncode == 1
    assert "no data set of a known format" in done.stderr.splitlines()[-1]
    assert not (tmp_path / "other").exists()
