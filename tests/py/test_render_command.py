"""`gslts render`: which views it takes, what it writes, and how it refuses."""

import json
import re
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import scenes
from command import gslts as run
from PIL import Image
from scipy.spatial.transform import Rotation

import gslts
from gslts.camera import rotation_of_quat
from gslts.camera_files import read_cameras, read_path
from gslts.map_folder import write_map_folder
from gslts.orbit import orbit
from gslts.pictures import depth_picture
from gslts.ply import write_ply

SIZE = {"width": 64, "height": 48}


def around(count: int, *, roll_rad: float = 0.0) -> dict[str, gslts.Camera]:
    """Cameras on a circle, each with a name, and with a camera that looks away beside it."""
    cameras = {}
    for k in range(count):
        camera = scenes.orbit_camera(**SIZE, angle_rad=0.2 + 2 * np.pi * k / count)
        turn = np.eye(4)
        turn[:3, :3] = Rotation.from_rotvec([0, np.pi, 0]).as_matrix()
        away = camera.world_from_camera @ turn
        turn[:3, :3] = Rotation.from_rotvec([0, 0, roll_rad]).as_matrix()
        pose = camera.world_from_camera @ turn
        cameras[f"away {k}"] = gslts.camera_from_fov(*SIZE.values(), 0.9, away)
        cameras[f"in {k}"] = gslts.camera_from_fov(*SIZE.values(), 0.9, pose)
    return cameras


@pytest.fixture(scope="module")
def gaussian_map() -> gslts.GaussianMap:
    return scenes.random_map(300, dtype=np.float32)


@pytest.fixture
def folder(gaussian_map: gslts.GaussianMap, tmp_path: Path) -> Path:
    write_map_folder(tmp_path / "map", gaussian_map, {}, around(10))
    write_map_folder(tmp_path / "bare", gaussian_map, {}, {})
    return tmp_path


def picture(path: Path) -> np.ndarray:
    with Image.open(path) as image:
        return np.asarray(image.convert("RGB"))


def expected(gaussian_map: gslts.GaussianMap, camera: gslts.Camera) -> np.ndarray:
    rgb = gslts.render(gaussian_map, camera).rgb
    return np.rint(255 * rgb.clip(0, 1)).astype(np.uint8)


def entry(camera: gslts.Camera, *, lens: bool = True) -> dict[str, Any]:
    names = ("fx", "fy", "cx", "cy", "width", "height") if lens else ()
    values = {name: getattr(camera, name) for name in names}
    return {**values, "world_from_camera": camera.world_from_camera.tolist()}


def test_one_view(folder: Path, gaussian_map: gslts.GaussianMap) -> None:
    """By the name of a camera of the map, and from files with and without intrinsics."""
    done = run("render", "map", "--pose", "in 3", "--out", "a", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert [path.name for path in (folder / "a").iterdir()] == ["00000.png"]
    own = around(10)["in 3"]
    np.testing.assert_array_equal(picture(folder / "a/00000.png"), expected(gaussian_map, own))
    odd = gslts.Camera(
        fx=50, fy=60, cx=20, cy=30, width=70, height=44, world_from_camera=own.world_from_camera
    )
    (folder / "odd.json").write_text(json.dumps(entry(odd)))
    write_ply(gaussian_map, folder / "room.ply")
    done = run("render", "room.ply", "--pose", "odd.json", "--out", "b", cwd=folder)
    assert done.returncode == 0, done.stderr
    np.testing.assert_array_equal(picture(folder / "b/00000.png"), expected(gaussian_map, odd))
    (folder / "bare.json").write_text(json.dumps(entry(own, lens=False)))
    arguments = ("--width", "80", "--height", "40", "--fov-deg", "90")
    done = run("render", "map", "--pose", "bare.json", *arguments, "--out", "c", cwd=folder)
    assert done.returncode == 0, done.stderr
    wide = gslts.camera_from_fov(80, 40, np.pi / 2, own.world_from_camera)
    np.testing.assert_array_equal(picture(folder / "c/00000.png"), expected(gaussian_map, wide))


def test_a_trajectory_in_the_format_of_tum(folder: Path, gaussian_map: gslts.GaussianMap) -> None:
    """Written by scipy, whose quaternions are xyzw as well."""
    cameras = [camera for name, camera in around(10).items() if name.startswith("in")][:3]
    lines = ["# timestamp tx ty tz qx qy qz qw"]
    for k, camera in enumerate(cameras):
        pose = camera.world_from_camera
        quat = Rotation.from_matrix(pose[:3, :3]).as_quat()
        lines.append(" ".join(f"{value:.9f}" for value in (0.1 * k, *pose[:3, 3], *quat)))
    (folder / "path.txt").write_text("\n".join(lines))
    done = run("render", "map", "--trajectory", "path.txt", "--depth", "--out", "a", cwd=folder)
    assert done.returncode == 0, done.stderr
    names = [f"{k:05}{end}.png" for k in range(3) for end in ("", "_depth")]
    assert sorted(path.name for path in (folder / "a").iterdir()) == sorted(names)
    for k, camera in enumerate(cameras):  # The lens is that of the map's first camera.
        apart = picture(folder / f"a/{k:05}.png").astype(int) - expected(gaussian_map, camera)
        assert np.abs(apart).max() <= 1
    depth = gslts.render(gaussian_map, cameras[0]).depth
    scale = re.search(r"depth from (\S+) m, red, to (\S+) m, blue", done.stdout)
    low, high = map(float, scale.groups())
    assert depth[depth > 0].min() < low < high < depth.max()
    of_depth = picture(folder / "a/00000_depth.png")
    assert (of_depth[depth == 0] == 40).all()
    near, far = of_depth[(depth > 0) & (depth < low)], of_depth[depth > high]
    assert len(near) > 0
    assert (near[:, 0] > near[:, 2]).all()
    assert len(far) > 0
    assert (far[:, 2] > far[:, 0]).all()


def test_videos_come_back(folder: Path, gaussian_map: gslts.GaussianMap) -> None:
    """Read by OpenCV; odd sides lose a pixel, and red stays red."""
    arguments = ("--width", "161", "--height", "121", "--frames", "12", "--depth")
    done = run("render", "map", *arguments, "--out", "new/a.mp4", cwd=folder)
    assert done.returncode == 0, done.stderr
    files = sorted((folder / "new").iterdir())
    assert [path.name for path in files] == ["a.mp4", "a_depth.mp4"]
    cameras = orbit(list(around(10).values()), 12)
    wanted = [
        gslts.camera_from_fov(161, 121, np.deg2rad(70), camera.world_from_camera)
        for camera in cameras
    ]
    for path in files:
        frames = list(frames_of(path))
        assert len(frames) == 12
        assert frames[0].shape == (120, 160, 3)
        if path.name == "a.mp4":
            for frame, camera in zip(frames, wanted, strict=True):
                shown = expected(gaussian_map, camera)[:120, :160]
                error, swapped = (np.abs(frame[..., ::k] - shown.astype(int)) for k in (1, -1))
                assert error.mean() < 8
                assert error.mean() < 0.5 * swapped.mean()
    again = run("render", "map", "--out", "new/a.mp4", cwd=folder)
    assert again.returncode == 1
    assert again.stderr == "gslts: new/a.mp4 is there already\n"


def frames_of(path: Path) -> Any:
    video = cv2.VideoCapture(str(path))
    assert video.get(cv2.CAP_PROP_FPS) == 25
    while True:
        good, frame = video.read()
        if not good:
            return
        yield frame[..., ::-1]


@pytest.mark.parametrize("roll_rad", [0.0, np.pi])
def test_orbits_are_smooth_and_look_inside(roll_rad: float) -> None:
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
    for one in orbit([camera], 3):
        np.testing.assert_allclose(one.world_from_camera, camera.world_from_camera, atol=1e-9)
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
    colors = depth_picture(depth, (1.0, 3.0))[0].astype(int)
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
        ("[]", "bad.json: expected an object of JSON"),
        ("{}", "bad.json: there is no camera in it"),
        (json.dumps({"a": 3}), "'a': it: Input should be a valid dictionary"),
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
        read_path(path)
    assert message in str(error.value)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("0 1 2 3 0 0 0", "line 1: '0 1 2 3 0 0 0' is not 8 values"),
        ("0 1 2 nan 0 0 0 1", "is not 8 values"),
        ("0 1 2 3 0 0 0 9", "pose 0: its quaternion has the length 9.000"),
        ("# nothing", "there is no camera in it"),
    ],
)
def test_trajectories_without_poses_are_named(tmp_path: Path, line: str, message: str) -> None:
    (tmp_path / "path.txt").write_text(line)
    with pytest.raises(ValueError, match=r"path\.txt") as error:
        read_path(tmp_path / "path.txt", scenes.orbit_camera())
    assert message in str(error.value)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ("map", "--pose", "nobody"),
            "there is no camera 'nobody'; there are 'away 0', 'in 0'",
        ),
        (("map", "--pose", "in 0", "--trajectory", "x"), "--pose and --trajectory exclude each"),
        (("map", "--pose", "gone.json"), "gone.json"),
        (("map", "--trajectory", "gone.txt"), "gone.txt"),
        (("bare",), "bare: it has no cameras of its own, a view must be given"),
        (("map/cameras.json",), "cameras.json: "),
        (("gone",), "gone"),
    ],
)
def test_refusals_are_one_line(folder: Path, arguments: tuple[str, ...], message: str) -> None:
    done = run("render", *arguments, "--out", "new", cwd=folder)
    assert done.returncode == 1
    assert done.stderr.startswith("gslts: ")
    assert message in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert not (folder / "new").exists()


def test_videos_need_one_size(folder: Path) -> None:
    cameras = {"a": entry(scenes.orbit_camera(32, 24)), "b": entry(scenes.orbit_camera(24, 32))}
    (folder / "two.json").write_text(json.dumps(cameras))
    done = run("render", "map", "--trajectory", "two.json", "--out", "new/a.mp4", cwd=folder)
    assert done.returncode == 1
    assert "a video needs views of one size" in done.stderr.splitlines()[-1]
    assert not (folder / "new").exists()
    done = run("render", "map", "--trajectory", "two.json", "--out", "new", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert picture(folder / "new/00001.png").shape == (32, 24, 3)


def test_what_cannot_be_written_ends_in_one_line(folder: Path) -> None:
    (folder / "file").write_text("")
    for out in ("file/a.mp4", "file", "map"):
        done = run("render", "map", "--pose", "in 0", "--out", out, cwd=folder)
        assert done.returncode == 1
        assert done.stderr.splitlines()[-1].startswith("gslts: ")
    assert "map is not empty" in done.stderr
    assert not list(folder.glob("**/*.part*"))
