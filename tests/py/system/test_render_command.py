"""`gslts render`: written files and errors."""

import json
import re
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import scenes
from command import gslts as run
from orbit_cameras import around, entry
from PIL import Image
from scipy.spatial.transform import Rotation

import gslts
from gslts.io.ply import write_ply
from gslts.rendering.orbit import orbit
from gslts.store.map_folder import write_map_folder


@pytest.fixture(scope="module")
def gaussian_map() -> gslts.GaussianMap:
    return scenes.random_map(300, dtype=np.float32)


@pytest.fixture
def folder(gaussian_map: gslts.GaussianMap, tmp_path: Path) -> Path:
    write_map_folder(tmp_path / "map", gaussian_map, {}, around(10))
    write_map_folder(tmp_path / "bare", gaussian_map, {}, {})
    return tmp_path


def read_image(path: Path) -> np.ndarray:
    with Image.open(path) as image:
        return np.asarray(image.convert("RGB"))


def expected(gaussian_map: gslts.GaussianMap, camera: gslts.Camera) -> np.ndarray:
    rgb = gslts.render(gaussian_map, camera).rgb
    return np.rint(255 * rgb.clip(0, 1)).astype(np.uint8)


@pytest.mark.smoke
def test_one_view(folder: Path, gaussian_map: gslts.GaussianMap) -> None:
    """By the name of a camera of the map, and from files with and without intrinsics."""
    done = run("render", "map", "--pose", "in 3", "--out", "a", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert [path.name for path in (folder / "a").iterdir()] == ["00000.png"]
    own = around(10)["in 3"]
    np.testing.assert_array_equal(read_image(folder / "a/00000.png"), expected(gaussian_map, own))
    odd = gslts.Camera(
        fx=50, fy=60, cx=20, cy=30, width=70, height=44, world_from_camera=own.world_from_camera
    )
    (folder / "odd.json").write_text(json.dumps(entry(odd)))
    write_ply(gaussian_map, folder / "room.ply")
    done = run("render", "room.ply", "--pose", "odd.json", "--out", "b", cwd=folder)
    assert done.returncode == 0, done.stderr
    np.testing.assert_array_equal(read_image(folder / "b/00000.png"), expected(gaussian_map, odd))
    (folder / "bare.json").write_text(json.dumps(entry(own, lens=False)))
    arguments = ("--width", "80", "--height", "40", "--fov-deg", "90")
    done = run("render", "map", "--pose", "bare.json", *arguments, "--out", "c", cwd=folder)
    assert done.returncode == 0, done.stderr
    wide = gslts.camera_from_fov(80, 40, np.pi / 2, own.world_from_camera)
    np.testing.assert_array_equal(read_image(folder / "c/00000.png"), expected(gaussian_map, wide))


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
        apart = read_image(folder / f"a/{k:05}.png").astype(int) - expected(gaussian_map, camera)
        assert np.abs(apart).max() <= 1
    depth = gslts.render(gaussian_map, cameras[0]).depth
    scale = re.search(r"depth from (\S+) m \(red\) to (\S+) m \(blue\)", done.stdout)
    low, high = map(float, scale.groups())
    assert depth[depth > 0].min() < low < high < depth.max()
    of_depth = read_image(folder / "a/00000_depth.png")
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
        (("bare",), "bare: the map has no cameras; give --pose FILE or --trajectory"),
        (("map/cameras.json",), "cameras.json: "),
        (("gone",), "gone"),
    ],
)
def test_errors_are_one_line(folder: Path, arguments: tuple[str, ...], message: str) -> None:
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
    assert read_image(folder / "new/00001.png").shape == (32, 24, 3)


def test_what_cannot_be_written_ends_in_one_line(folder: Path) -> None:
    (folder / "file").write_text("")
    for out in ("file/a.mp4", "file", "map"):
        done = run("render", "map", "--pose", "in 0", "--out", out, cwd=folder)
        assert done.returncode == 1
        assert done.stderr.splitlines()[-1].startswith("gslts: ")
    assert "map is not empty" in done.stderr
    assert not list(folder.glob("**/*.part*"))
