"""`gslts map`: written files, checks by other commands, warnings and errors."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from command import gslts as run
from map_recordings import record_room

from gslts.datasets import open_dataset
from gslts.localization.landmark_files import read_landmarks
from gslts.store.camera_files import cameras_of_map
from gslts.store.map_folder import read_map
from gslts.store.measurement_files import read_measurements


@pytest.fixture(scope="module")
def recorded() -> dict[str, Path]:
    return record_room()


@pytest.mark.smoke
def test_the_commands(recorded: dict[str, Path], tmp_path: Path) -> None:
    arguments = ("map", recorded["kinect"], "--iterations", "30", "--preset", "fast")
    done = run(*arguments, "--out", "map", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "4 test frames" in done.stdout
    page = (tmp_path / "map" / "report.html").read_text()
    assert "poses corrected by neighbours" in page
    manifest = json.loads((tmp_path / "map" / "manifest.json").read_text())
    landmarks, cameras = read_landmarks(tmp_path / "map"), cameras_of_map(tmp_path / "map")
    assert landmarks is not None
    assert landmarks.size > 300
    measurements = read_measurements(tmp_path / "map")
    np.testing.assert_array_equal(measurements.ids, np.sort(read_map(tmp_path / "map").ids))
    assert measurements.is_measured.mean() > 0.8
    assert 0.002 < np.nanmedian(measurements.errors[:, 0]) < 0.1
    poses = [camera.world_from_camera for camera in cameras.values()]
    for pose in landmarks.world_from_keyframe:
        assert any(np.allclose(pose, known) for known in poses), "of a held-out frame"
    assert run("verify", "map", cwd=tmp_path).stdout == "1 version is intact\n"
    done = run("eval", "map", recorded["kinect"], "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    again = json.loads(done.stdout)
    for poses in ("given", "by_neighbours", "refined"):
        assert again[poses] == pytest.approx(manifest["test"][poses], rel=1e-5)
    assert done.stderr == ""
    done = run("eval", "map", recorded["none"], "--json", cwd=tmp_path)
    assert json.loads(done.stdout)["refined"]["ssim"] > again["refined"]["ssim"], "without noise"
    assert "none: the map has no record of it" in done.stderr, "though the frames have its names"
    assert run("export", "map", "room.ply", cwd=tmp_path).returncode == 0
    done = run("eval", "room.ply", recorded["none"], "--every", "20", "--json", cwd=tmp_path)
    plain = json.loads(done.stdout)
    assert plain["given"]["frames"] == 3
    assert plain["by_neighbours"] is None
    done = run(*arguments, "--out", "map", cwd=tmp_path)
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1] == "gslts: map is there already"
    few = ["map", recorded["kinect"], "--out", "few", "--every", "3", "--iterations", "10"]
    done = run(*few, "--budget-s", "inf", cwd=tmp_path)
    assert done.returncode == 1
    assert done.stderr == "gslts: budget_s=inf: Input should be a finite number\n"
    assert run(*few, cwd=tmp_path).returncode == 0
    names = [frame.name for frame in open_dataset(recorded["kinect"]).frames[::3]]
    assert set(cameras_of_map(tmp_path / "few")) == set(names) - set(names[::8])
    done = run("map", tmp_path, "--out", "other", cwd=tmp_path)
    assert done.returncode == 1
    assert "no data set of a known format" in done.stderr.splitlines()[-1]
    assert not (tmp_path / "other").exists()


def test_several_data_sets_are_mapped_as_alone(recorded: dict[str, Path], tmp_path: Path) -> None:
    for name in ("a", "b"):
        shutil.copytree(recorded["kinect"], tmp_path / name)
    (tmp_path / "c").mkdir()
    options = ("--every", "4", "--iterations", "5", "--preset", "fast")
    assert run("map", "a", *options, "--out", "alone", cwd=tmp_path).returncode == 0
    shutil.copytree(tmp_path / "alone", tmp_path / "maps" / "a")
    before = sorted(path.stat().st_mtime_ns for path in (tmp_path / "maps/a").rglob("*"))
    arguments = ("map", "a", "b", "c", *options, "--out", "maps", "--jobs", "2")
    done = run(*arguments, cwd=tmp_path)
    assert done.returncode == 1, "c is no data set"
    assert done.stdout.startswith("maps/a is there already\n")
    assert "wrote maps/b: " in done.stdout
    errors = done.stderr.splitlines()
    assert "maps/c: ValueError: " in errors[-2]
    assert errors[-1] == "gslts: 1 results failed, named above"
    after = sorted(path.stat().st_mtime_ns for path in (tmp_path / "maps/a").rglob("*"))
    assert after == before
    alone, made = read_map(tmp_path / "alone"), read_map(tmp_path / "maps/b")
    for name in ("means", "quats", "log_scales", "logit_opacities", "sh"):
        np.testing.assert_array_equal(getattr(made, name), getattr(alone, name))
    assert {path.name for path in (tmp_path / "maps").iterdir()} == {"a", "b"}
    twice = run("map", "a", "a", "--out", "twice", cwd=tmp_path)
    assert twice.stderr == "gslts: data sets need different names, got a, a\n"


def test_a_map_of_frames_at_wrong_poses_gives_a_warning(
    recorded: dict[str, Path], tmp_path: Path
) -> None:
    shutil.copytree(recorded["kinect"], tmp_path / "mixed")
    transforms = tmp_path / "mixed" / "transforms.json"
    content = json.loads(transforms.read_text())
    poses = [frame["transform_matrix"] for frame in content["frames"]]
    for frame, pose in zip(content["frames"], poses[30:] + poses[:30], strict=True):
        frame["transform_matrix"] = pose
    transforms.write_text(json.dumps(content))
    (tmp_path / "maps").mkdir()
    settings = ("--iterations", "200", "--preset", "fast")
    for dataset, warns in ((tmp_path / "mixed", True), (recorded["kinect"], False)):
        done = run("map", dataset, "--out", dataset.name, *settings, cwd=tmp_path / "maps")
        assert done.returncode == 0, done.stderr
        warnings = [line for line in done.stderr.splitlines() if line.startswith("warning: ")]
        assert len(warnings) == warns, done.stderr
        manifest = json.loads((tmp_path / "maps" / dataset.name / "manifest.json").read_text())
        trained = cameras_of_map(tmp_path / "maps" / dataset.name)
        assert set(manifest["training_psnrs_db"]) == set(trained)
        assert (manifest["warning"] is not None) == warns
        page = (tmp_path / "maps" / dataset.name / "report.html").read_text()
        assert ("does not show" in page) == warns
