"""`gslts map --poses`: maps of recordings without poses, or with poses that drift."""

import json
from pathlib import Path

import numpy as np
import pytest
import turn
from command import gslts as run

from gslts.core.se3 import pose_distance, relative
from gslts.datasets import open_dataset
from gslts.store.camera_files import cameras_of_map

pytest.importorskip("open3d")

QUICK = ("--iterations", "30", "--preset", "fast")


@pytest.fixture(scope="module")
def posed(tmp_path_factory) -> Path:
    return turn.recording(tmp_path_factory.mktemp("posed") / "room")


@pytest.fixture(scope="module")
def unposed(posed, tmp_path_factory) -> Path:
    """The recording without poses."""
    source, folder = posed, tmp_path_factory.mktemp("unposed") / "room"
    content = json.loads((source / "transforms.json").read_text())
    for frame in content["frames"]:
        del frame["transform_matrix"]
    folder.mkdir()
    (folder / "transforms.json").write_text(json.dumps(content))
    for name in ("images", "depth", "instances"):
        (folder / name).symlink_to(source / name)
    return folder


@pytest.mark.smoke
def test_a_recording_without_poses(posed, unposed, tmp_path):
    done = run("map", unposed, "--out", "map", *QUICK, cwd=tmp_path)
    assert done.returncode == 1
    assert "it has no pose; gslts map --poses estimate finds poses" in done.stderr
    done = run("map", unposed, "--out", "map", "--poses", "estimate", *QUICK, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "loop closures" in done.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["map"]
    cameras = cameras_of_map(tmp_path / "map")
    true = {frame.name: frame.camera for frame in open_dataset(posed).frames}
    assert len(cameras) > 0.7 * len(true)
    first = next(iter(cameras))
    errors = [
        pose_distance(
            relative(cameras[first].world_from_camera, camera.world_from_camera),
            relative(true[first].world_from_camera, true[name].world_from_camera),
        )
        for name, camera in cameras.items()
    ]
    metres, turns_rad = np.median(errors, axis=0)
    assert metres < 0.02
    assert turns_rad < np.deg2rad(0.5)
    manifest = json.loads((tmp_path / "map" / "manifest.json").read_text())
    done = run("eval", "map", unposed, "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    quality = json.loads(done.stdout)
    for poses in ("given", "by_neighbours", "refined"):
        assert quality[poses] == pytest.approx(manifest["test"][poses], rel=1e-5)


def test_a_recording_whose_world_is_not_upright(posed, tmp_path):
    """A warning names it, navigation rejects the map, and the option makes another one."""
    content = json.loads((posed / "transforms.json").read_text())
    turned = np.eye(4)[[0, 2, 1, 3]]  # Its z axis becomes y.
    turned[2] *= -1
    for frame in content["frames"]:
        frame["transform_matrix"] = (turned @ frame["transform_matrix"]).tolist()
    folder = tmp_path / "room"
    folder.mkdir()
    (folder / "transforms.json").write_text(json.dumps(content))
    for name in ("images", "depth", "instances"):
        (folder / name).symlink_to(posed / name)
    tilt = "z is not up here: up is (0.0, 1.0, 0.0); navigation needs z up: "
    done = run("map", "room", "--out", "map", *QUICK, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert f"warning: room: {tilt}--poses upright turns it\n" in done.stderr
    done = run("semantic-map", "map", "--out", "plan", cwd=tmp_path)
    assert done.returncode == 1
    assert done.stderr == f"gslts: map: {tilt}make the map with gslts map --poses upright\n"
    done = run("map", "room", "--poses", "upright", "--out", "turned", *QUICK, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "z is not up" not in done.stderr
    done = run("semantic-map", "turned", "--out", "plan", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    manifest = json.loads((tmp_path / "turned" / "manifest.json").read_text())
    done = run("eval", "turned", "room", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["refined"] == pytest.approx(manifest["test"]["refined"], 1e-5)


def test_a_recording_with_poses_that_drift(posed, tmp_path):
    options = ("--out", "map", "--poses", "correct", *QUICK)
    done = run("map", posed, *options, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    true = {frame.name: frame.camera for frame in open_dataset(posed).frames}
    errors = [
        pose_distance(camera.world_from_camera, true[name].world_from_camera)
        for name, camera in cameras_of_map(tmp_path / "map").items()
    ]
    assert np.median(errors, axis=0)[0] < 0.03, "the world is that of the recording"


def test_images_without_overlap_stop_the_command(unposed, tmp_path):
    done = run("map", unposed, "--out", "map", "--poses", "estimate", "--every", "9", cwd=tmp_path)
    assert done.returncode == 1
    assert "room: no two frames show the same place" in done.stderr.splitlines()[-1]
    assert list(tmp_path.iterdir()) == []
