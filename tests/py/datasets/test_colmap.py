"""Models of COLMAP, written and judged by COLMAP itself."""

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from recorded_frames import frames_of_robot

from gslts.core.camera import Camera
from gslts.datasets import Dataset, open_dataset
from gslts.datasets.undistort import undistort_rgb

pycolmap = pytest.importorskip("pycolmap")

PARAMETERS = {
    "SIMPLE_PINHOLE": (50.0, 31.0, 25.0),
    "PINHOLE": (50.0, 52.0, 31.0, 25.0),
    "SIMPLE_RADIAL": (50.0, 31.0, 25.0, 0.05),
    "RADIAL": (50.0, 31.0, 25.0, 0.05, -0.02),
    "OPENCV": (50.0, 52.0, 31.0, 25.0, -0.1, 0.02, 0.003, -0.002),
    "OPENCV_FISHEYE": (50.0, 52.0, 31.0, 25.0, -0.03, 0.01, -0.002, 0.001),
    "FULL_OPENCV": (50.0, 52.0, 31.0, 25.0, 0.3, 0.1, 0.001, 0.002, 0.02, 0.15, 0.05, 0.01),
}
POINTS = np.random.default_rng(3).uniform(-2, 2, (40, 3))
COLORS = np.random.default_rng(4).integers(0, 256, (40, 3)).astype(np.uint8)


def write_model(
    folder: Path, model: str = "OPENCV", sparse: str = "sparse/0", text: bool = False
) -> Any:
    """The frames of a simulated robot as COLMAP would write them; the images in wrong order."""
    model_of = pycolmap.Reconstruction()
    camera = pycolmap.Camera.create_from_model_name(7, model, 1.0, 64, 48)
    camera.params = PARAMETERS[model]
    model_of.add_camera_with_trivial_rig(camera)
    (folder / "images" / "left").mkdir(parents=True)
    for number, frame in reversed(list(enumerate(frames_of_robot()))):
        name = f"left/a b_{number}.png"
        Image.fromarray(frame.rgb).save(folder / "images" / name)
        camera_from_world = np.linalg.inv(frame.camera.world_from_camera)
        image = pycolmap.Image(
            name=name,
            keypoints=np.array([[1.5, 2.5], [3.0, 4.0]])[: 2 - number],
            camera_id=7,
            image_id=20 - number,
        )
        model_of.add_image_with_trivial_frame(image, pycolmap.Rigid3d(camera_from_world[:3]))
    for place, color in zip(POINTS, COLORS, strict=True):
        model_of.add_point3D(place, pycolmap.Track(), color)
    model_of.add_observation(1, pycolmap.TrackElement(20, 1))  # A track that is not empty.
    (folder / sparse).mkdir(parents=True, exist_ok=True)
    (model_of.write_text if text else model_of.write_binary)(folder / sparse)
    return model_of


@pytest.mark.parametrize("text", [False, True], ids=["bin", "txt"])
@pytest.mark.parametrize("sparse", ["sparse/0", "sparse", "."])
def test_models_are_read_wherever_they_lie(tmp_path: Path, sparse: str, text: bool) -> None:
    write_model(tmp_path, sparse=sparse, text=text)
    assert (tmp_path / sparse / f"cameras.{'txt' if text else 'bin'}").exists()
    dataset = open_dataset(tmp_path)
    assert dataset.skipped == ()
    assert [frame.name for frame in dataset.frames] == ["a b_0", "a b_1", "a b_2"]
    for frame, expected in zip(dataset.frames, frames_of_robot(), strict=True):
        np.testing.assert_allclose(
            frame.camera.world_from_camera, expected.camera.world_from_camera, atol=1e-9
        )
        camera = frame.camera
        assert (camera.fx, camera.fy, camera.cx, camera.cy) == (50, 52, 31, 25)
        read = frame.read()
        assert frame.lens is not None
        flat, mask = undistort_rgb(expected.rgb, camera, frame.lens)
        np.testing.assert_array_equal(read.rgb, flat)
        np.testing.assert_array_equal(read.mask, mask)
        assert (read.depth == 0).all()
    assert dataset.points is not None
    np.testing.assert_allclose(dataset.points.points, POINTS, atol=1e-9)
    np.testing.assert_array_equal(dataset.points.colors, COLORS)


def test_models_are_named_from_inside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_model(tmp_path / "room")
    monkeypatch.chdir(tmp_path / "room")
    assert open_dataset(".").name == "room"


def dot_at(camera: Camera, point: np.ndarray) -> np.ndarray:
    """(2,) px: where a pinhole sees a point of the world."""
    pose = camera.world_from_camera
    x, y, z = pose[:3, :3].T @ (point - pose[:3, 3])
    return np.array([camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy])


@pytest.mark.parametrize("model", PARAMETERS)
def test_points_are_seen_where_colmap_sees_them(tmp_path: Path, model: str) -> None:
    """A blob drawn where COLMAP projects a point is found where the undistorted camera has it."""
    theirs = write_model(tmp_path, model)
    names = {image.name: image for image in theirs.images.values()}
    rows, columns = np.mgrid[:48, :64] + 0.5
    tried = 0
    for number, frame in enumerate(open_dataset(tmp_path).frames):
        image = names[f"left/a b_{number}.png"]
        pose = frame.camera.world_from_camera
        for place in [(-0.5, 0.3, 1.5), (0.5, -0.4, 1.4), (0.2, 0.3, 0.9), (-0.3, -0.3, 1.2)]:
            point = pose[:3, :3] @ place + pose[:3, 3]
            x, y = image.project_point(point)
            blob = 250 * np.exp(-((columns - x) ** 2 + (rows - y) ** 2) / (2 * 2.5**2))
            rgb = np.repeat(np.rint(blob)[..., None], 3, axis=2).astype(np.uint8)
            Image.fromarray(rgb).save(tmp_path / "images" / image.name)
            read = frame.read()
            weight = read.rgb[..., 0].astype(float)
            weight[weight < 60] = 0
            found = np.array([(weight * columns).sum(), (weight * rows).sum()]) / weight.sum()
            expected = dot_at(frame.camera, point)
            assert np.abs(found - expected).max() < 0.15, (found, expected, (x, y))
            tried += 1
    assert tried == 12


def reasons(folder: Path) -> tuple[str, ...]:
    dataset: Dataset = open_dataset(folder)
    return dataset.left_out


def test_frames_that_cannot_be_used_are_named(tmp_path: Path) -> None:
    write_model(tmp_path, "PINHOLE", text=True)
    images = tmp_path / "sparse/0/images.txt"
    cameras = tmp_path / "sparse/0/cameras.txt"
    good = images.read_text()
    lines = good.splitlines()
    first = next(k for k, line in enumerate(lines) if line.endswith("a b_0.png"))
    words = lines[first].split(maxsplit=9)

    def write(changed: dict[int, str]) -> None:
        words_now = [changed.get(k, word) for k, word in enumerate(words)]
        images.write_text("\n".join([*lines[:first], " ".join(words_now), *lines[first + 1 :]]))

    write({1: "nan"})
    assert reasons(tmp_path) == ("left/a b_0.png: the quaternion has length nan, expected 1",)
    write({1: "7"})
    assert "the quaternion has length 7" in reasons(tmp_path)[0]
    write({1: "1e300"})  # Whose square is infinite.
    assert "the quaternion has length" in reasons(tmp_path)[0]
    write({5: "inf"})
    assert "the position is not finite: [inf, " in reasons(tmp_path)[0]
    write({8: "9"})
    assert reasons(tmp_path) == ("left/a b_0.png: there is no camera 9",)
    write({9: "gone.png"})
    assert reasons(tmp_path) == ("gone.png: there is no such image",)
    write({8: "seven"})
    with pytest.raises(ValueError, match=r"images\.txt: line \d+: .*'seven'"):
        open_dataset(tmp_path)
    images.write_text(good)
    for camera, message in (
        ("7 FOV 64 48 50 52 31 25 0.1", "the camera model FOV is not supported"),
        ("7 PINHOLE 64 48 -50 52 31 25", "a focal length of -50 px"),
        ("7 PINHOLE 64 48 50 52 65 25", r"the principal point \(65, 25\) is outside the image"),
        ("7 PINHOLE 64 48 50 52 nan 25", r"the principal point \(nan, 25\)"),
        ("7 PINHOLE 99999999999999 48 50 52 1 25", "an image cannot have 99999999999999 x 48"),
        ("7 PINHOLE 64 48 50 52 31", r"cameras\.txt: line 1: .* PINHOLE has 4 parameters"),
        ("7 PINHOLE 64", r"cameras\.txt: line 1: "),
    ):
        cameras.write_text(camera + "\n")
        with pytest.raises(ValueError, match=message):
            open_dataset(tmp_path)
    cameras.write_text("7 PINHOLE 128 96 100 104 62 50\n")
    with pytest.raises(ValueError, match=r"a b_0\.png: 64 x 48 px, expected 128 x 96"):
        open_dataset(tmp_path).frames[0].read()


@pytest.mark.parametrize("part", ["cameras", "images", "points3D"])
def test_binary_files_that_are_cut_off_are_named(tmp_path: Path, part: str) -> None:
    write_model(tmp_path)
    path = tmp_path / "sparse" / "0" / f"{part}.bin"
    whole = path.read_bytes()
    for size in (0, 5, 8, 20, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:size])
        with pytest.raises(ValueError, match=rf"{part}\.bin: "):
            open_dataset(tmp_path)
    path.write_bytes(struct.pack("<Q", 1 << 60) + whole[8:])  # Rejected before memory is taken.
    with pytest.raises(ValueError, match=rf"{part}\.bin: \d+ bytes are missing at byte 8 of"):
        open_dataset(tmp_path)


def test_binary_files_of_other_kinds_are_named(tmp_path: Path) -> None:
    write_model(tmp_path)
    cameras = tmp_path / "sparse/0/cameras.bin"
    cameras.write_bytes(struct.pack("<QiiQQ8d", 1, 7, 99, 64, 48, *PARAMETERS["OPENCV"]))
    with pytest.raises(ValueError, match=r"cameras\.bin: camera 7 has the unknown model 99"):
        open_dataset(tmp_path)
    points = tmp_path / "sparse/0/points3D.bin"
    cameras.write_bytes(struct.pack("<QiiQQ4d", 1, 7, 1, 64, 48, *PARAMETERS["PINHOLE"]))
    points.write_bytes(struct.pack("<QQdddBBBdQ", 1, 5, 1, float("nan"), 2, 3, 4, 5, 0.1, 0))
    with pytest.raises(ValueError, match=r"points3D\.bin: a point is not finite"):
        open_dataset(tmp_path)
    points.unlink()
    assert open_dataset(tmp_path).points is None
