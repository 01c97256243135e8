"""Views that are asked for: orbits, poses and files of cameras."""

import json
from pathlib import Path

import numpy as np
import pytest
import scenes
from orbit_cameras import around, entry
from scipy.spatial.transform import Rotation

from gslts.core.se3 import rotation_of_quat
from gslts.io.images import depth_image
from gslts.rendering.orbit import orbit
from gslts.store.camera_files import read_camera_path, read_cameras


@pytest.mark.parametrize("roll_rad", [0.0, np.pi])
def test_orbits_are_smooth_and_face_inside(roll_rad: float) -> None:
    cameras = orbit(list(around(12, roll_rad=roll_rad).values()), 240)
    poses = np.stack([camera.world_from_camera for camera in cameras])
    eyes, forward = poses[:, :3, 3], poses[:, :3, 2]
    np.testing.assert_allclose(np.linalg.norm(eyes[:, :2], axis=1), 2.5, rtol=0.03)
    inward = -eyes / np.linalg.norm(eyes, axis=1, keepdims=True)
    assert ((forward * inward).sum(axis=1) > 0.99).all()
    steps_m = np.linalg.norm(np.diff(eyes, axis=0, append=eyes[:1]), axis=1)
    assert steps_m.max() < 1.3 * steps_m.min(), "an even pace, also from the end to the start"
    np.testing.assert_allclose(poses[:, 2, 0], 0, atol=1e-9, err_msg="the horizon is level")
    up = 1 if roll_rad == 0 else -1
    assert (up * poses[:, 2, 1] < 0).all(), "y is down in an image unless the camera hangs"
    assert {(camera.width, camera.fx) for camera in cameras} == {(64, cameras[0].fx)}


def test_orbits_of_few_cameras() -> None:
    (camera,) = [scenes.orbit_camera()]
    for view in orbit([camera], 3):
        np.testing.assert_allclose(view.world_from_camera, camera.world_from_camera, atol=1e-9)
    two = [scenes.orbit_camera(angle_rad=angle) for angle in (0.0, np.pi)]
    way = orbit(two, 8)
    np.testing.assert_allclose(way[0].world_from_camera, two[0].world_from_camera, atol=1e-9)
    np.testing.assert_allclose(way[4].world_from_camera, two[1].world_from_camera, atol=1e-9)
    with pytest.raises(ValueError, match="there is no camera"):
        orbit([], 3)


def test_quaternions_turn_as_those_of_scipy() -> None:
    quats = np.random.default_rng(0).normal(size=(20, 4))
    for quat in quats:
        turn = Rotation.from_quat(quat, scalar_first=True).as_matrix()
        np.testing.assert_allclose(rotation_of_quat(quat), turn, atol=1e-12)


def test_depth_is_red_where_near_and_grey_where_there_is_none() -> None:
    depth = np.array([[1.0, 3.0, 0.0, np.nan, 0.2, 9.0]])
    colors = depth_image(depth, (1.0, 3.0))[0].astype(int)
    assert colors[0, 0] > 100 > colors[0, 2]
    assert colors[1, 2] > colors[1, 0]
    assert (colors[2:4] == 40).all()
    np.testing.assert_array_equal(colors[4:], colors[:2], "beyond the range as at its ends")


def test_poses_of_few_digits_become_rigid(tmp_path: Path) -> None:
    pose = np.round(around(3)["in 1"].world_from_camera, 3)
    (tmp_path / "a.json").write_text(json.dumps({"a": {"world_from_camera": pose.tolist()}}))
    lens = scenes.orbit_camera()
    read = read_cameras(tmp_path / "a.json", lens)["a"]
    np.testing.assert_allclose(read.world_from_camera, pose, atol=2e-3)
    assert (read.fx, read.width) == (lens.fx, lens.width)


GOOD = entry(scenes.orbit_camera())
BAD = {**GOOD, "world_from_camera": (2 * np.eye(4)).tolist()}
NO_LENS = entry(scenes.orbit_camera(), lens=False)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{", "bad.json: Expecting"),
        ("[" * 100_000, "bad.json: "),
        ("[]", "bad.json: expected a JSON object"),
        ("{}", "bad.json: it holds no camera"),
        (json.dumps({"a": 3}), "'a': Input should be a valid dictionary"),
        (json.dumps({"a": BAD}), "'a': the pose is not rigid"),
        (json.dumps({"a": NO_LENS}), "'a': fx: Field required"),
        (json.dumps({"a": {**NO_LENS, "fx": 3}}), "'a': fy: Field required"),
        (json.dumps({"a": {**GOOD, "width": 10**30}}), "'a': width: Input should be less than"),
        (json.dumps({"a": {**GOOD, "fx": 0}}), "'a': Camera: camera.fx must be"),
        (json.dumps({"a": {**GOOD, "width": 65536, "height": 65536}}), "65536 px are more than"),
        ('{"a": {"world_from_camera": [[NaN, 0, 0, 0]]}}', "'a': world_from_camera"),
    ],
)
def test_files_without_cameras_are_named(tmp_path: Path, content: str, message: str) -> None:
    path = tmp_path / "bad.json"
    path.write_text(content)
    with pytest.raises(ValueError, match="bad") as error:
        read_camera_path(path)
    assert message in str(error.value)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("0 1 2 3 0 0 0", "line 1: '0 1 2 3 0 0 0' is not 8 values"),
        ("0 1 2 nan 0 0 0 1", "is not 8 values"),
        ("0 1 2 3 0 0 0 9", "pose 0: the quaternion has length 9.000"),
        ("# nothing", "it holds no camera"),
    ],
)
def test_trajectories_without_poses_are_named(tmp_path: Path, line: str, message: str) -> None:
    (tmp_path / "path.txt").write_text(line)
    with pytest.raises(ValueError, match=r"path\.txt") as error:
        read_camera_path(tmp_path / "path.txt", scenes.orbit_camera())
    assert message in str(error.value)
