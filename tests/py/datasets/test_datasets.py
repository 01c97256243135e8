"""Data sets: 7-Scenes, names of data sets and frames, labels, and damaged images."""

import json
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from recorded_frames import frames_of_robot
from reprojection import assert_frames_agree

from gslts.core.camera import Camera
from gslts.datasets import open_dataset
from gslts.datasets.dataset import read_numbers
from gslts.datasets.image_frame import ImageFrame, with_unique_names
from gslts.datasets.posed import with_poses


def write_seven_scenes(folder: Path) -> list:
    """By the data set's own words: row-major world_from_camera in metres, depth in millimetres."""
    folder.mkdir()
    frames = frames_of_robot()
    camera = frames[0].camera
    (folder / "camera-intrinsics.txt").write_text(
        f"{camera.fx} 0 {camera.cx}\n0 {camera.fy} {camera.cy}\n0 0 1\n"
    )
    for number, frame in enumerate(frames):
        stem = folder / f"frame-{8 * number:06}"
        Image.fromarray(frame.rgb).save(f"{stem}.color.png")
        steps = np.rint(1000 * frame.depth).astype(np.uint16)
        steps[:2] = 65535
        Image.fromarray(steps).save(f"{stem}.depth.png")
        np.savetxt(f"{stem}.pose.txt", frame.camera.world_from_camera)
    return frames


def test_seven_scenes(tmp_path: Path) -> None:
    frames = write_seven_scenes(tmp_path / "chess")
    dataset = open_dataset(tmp_path / "chess")
    assert [frame.name for frame in dataset.frames] == [
        "frame-000000.color",
        "frame-000008.color",
        "frame-000016.color",
    ]
    assert_frames_agree([frame.read() for frame in dataset.frames])
    for frame, expected in zip(dataset.frames, frames, strict=True):
        read = frame.read()
        np.testing.assert_array_equal(read.rgb, expected.rgb)
        assert (read.depth[:2] == 0).all(), "65535 means no measurement"
        np.testing.assert_allclose(read.depth[2:], expected.depth[2:], atol=0.00051)
        lens = read.depth_camera
        assert lens is not None, "a Kinect's depth is not registered"
        given = expected.camera.world_from_camera
        np.testing.assert_allclose(lens.world_from_camera, given, atol=1e-9)
        assert lens.fx == pytest.approx(expected.camera.fx)
        beside = given[:3, 3] + 0.025 * given[:3, 0]
        np.testing.assert_allclose(read.camera.world_from_camera[:3, 3], beside, atol=1e-9)
        assert read.camera.fx == pytest.approx(525 * read.camera.width / 640)
        registered = read.registered()
        assert registered.depth_camera is None
        assert registered.depth.shape == read.rgb.shape[:2]


def test_the_real_room_is_read() -> None:
    folder = Path(__file__).parents[4] / "shared" / "data" / "7scenes"
    if not folder.exists():
        pytest.skip("shared/data/7scenes is not there")
    dataset = open_dataset(folder)
    assert len(dataset.frames) == 125
    assert dataset.skipped == ()
    frame = dataset.frames[60].read()
    assert frame.rgb.shape == (480, 640, 3)
    measured = frame.depth[frame.depth > 0]
    assert 0.3 < np.median(measured) < 5
    assert measured.max() < 65


@pytest.mark.parametrize("write", ["nerfstudio", "7scenes"])
def test_other_data_sets_are_named_from_inside(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest, write: str
) -> None:
    folder = tmp_path / "room"
    if write == "nerfstudio":
        request.getfixturevalue("recorded")
    else:
        write_seven_scenes(folder)
    monkeypatch.chdir(folder)
    assert open_dataset(".").name == "room"


def test_seven_scenes_without_poses(tmp_path: Path) -> None:
    write_seven_scenes(tmp_path / "chess")
    for pose in (tmp_path / "chess").glob("*.pose.txt"):
        pose.unlink()
    hint = r"it has no pose; gslts map --poses estimate finds poses by the images"
    with pytest.raises(ValueError, match=hint):
        open_dataset(tmp_path / "chess")
    dataset = open_dataset(tmp_path / "chess", posed=False)
    assert len(dataset.frames) == 3
    assert dataset.unposed == dataset.frames
    read = dataset.frames[0].read()
    assert read.depth_camera is not None
    beside = np.linalg.inv(read.camera.world_from_camera) @ read.depth_camera.world_from_camera
    np.testing.assert_allclose(beside[:3, 3], (-0.025, 0, 0), atol=1e-9)


def test_frames_at_other_poses(tmp_path: Path) -> None:
    write_seven_scenes(tmp_path / "chess")
    dataset = open_dataset(tmp_path / "chess")
    first, second = dataset.frames[:2]
    pose = np.eye(4)
    pose[:3, 3] = 1, 2, 3
    moved = with_poses(dataset, {second.name: pose})
    (frame,) = moved.frames
    assert frame.name == second.name != first.name
    np.testing.assert_array_equal(frame.camera.world_from_camera, pose)
    read, given = frame.read(), second.read()
    np.testing.assert_array_equal(read.rgb, given.rgb)
    np.testing.assert_array_equal(read.camera.world_from_camera, pose)
    assert read.depth_camera is not None
    assert given.depth_camera is not None
    np.testing.assert_allclose(
        np.linalg.inv(pose) @ read.depth_camera.world_from_camera,
        np.linalg.inv(given.camera.world_from_camera) @ given.depth_camera.world_from_camera,
        atol=1e-9,
    )


def test_seven_scenes_of_another_size_has_the_focal_lengths_of_that_size(tmp_path: Path) -> None:
    write_seven_scenes(tmp_path / "chess")
    (tmp_path / "chess" / "camera-intrinsics.txt").unlink()
    read = open_dataset(tmp_path / "chess").frames[0].read()
    assert read.depth_camera is not None
    assert read.depth_camera.fx == pytest.approx(58.5)
    assert read.depth_camera.fy == pytest.approx(58.5)
    assert read.camera.fx == pytest.approx(52.5)


def write_bundle_fusion(folder: Path, depth_width: int = 64) -> list:
    """As the tools of BundleFusion export a scan; pixel centres are whole numbers."""
    frames = frames_of_robot()
    sides = {"color": (64, 48), "depth": (depth_width, depth_width * 3 // 4)}
    small = frames_of_robot(*sides["depth"])
    lines = ["m_versionNumber = 4", "m_sensorName = Structure = Sensor", "m_depthShift = 5000"]
    folder.mkdir()
    for number, (frame, near) in enumerate(zip(frames, small, strict=True)):
        stem = folder / f"frame-{number:06}"
        Image.fromarray(frame.rgb).save(f"{stem}.color.png")
        Image.fromarray(np.rint(5000 * near.depth).astype(np.uint16)).save(f"{stem}.depth.png")
        np.savetxt(f"{stem}.pose.txt", frame.camera.world_from_camera)
    for name, camera in (("color", frames[0].camera), ("depth", small[0].camera)):
        lines += [f"m_{name}Width = {camera.width}", f"m_{name}Height = {camera.height}"]
        matrix = (
            f"{camera.fx} 0 {camera.cx - 0.5} 0 0 {camera.fy} {camera.cy - 0.5} 0 0 0 1 0 0 0 0 1"
        )
        lines.append(f"m_calibration{name.title()}Intrinsic = {matrix} ")
    (folder / "info.txt").write_text("\n".join(lines))
    return frames


@pytest.mark.parametrize("depth_width", [64, 32])
def test_bundle_fusion(tmp_path: Path, depth_width: int) -> None:
    frames = write_bundle_fusion(tmp_path / "office", depth_width)
    dataset = open_dataset(tmp_path / "office")
    assert dataset.left_out == ()
    read = [frame.read() for frame in dataset.frames]
    assert_frames_agree(read)
    for found, expected in zip(read, frames, strict=True):
        assert (found.depth_camera is None) == (depth_width == 64)
        for name in ("width", "height", "fx", "fy", "cx", "cy"):
            assert getattr(found.camera, name) == pytest.approx(getattr(expected.camera, name))
        pose = expected.camera.world_from_camera
        np.testing.assert_allclose(found.camera.world_from_camera, pose, atol=1e-9)
        if found.depth_camera is None:
            np.testing.assert_allclose(found.depth, expected.depth, atol=0.00011)
        else:
            assert found.depth_camera.fx == pytest.approx(expected.camera.fx / 2)
            np.testing.assert_allclose(found.depth_camera.world_from_camera, pose, atol=1e-9)


def test_bundle_fusion_has_images_of_another_size(tmp_path: Path) -> None:
    folder = tmp_path / "office"
    write_bundle_fusion(folder)
    for path in folder.glob("*.color.png"):
        with Image.open(path) as image:
            large = image.resize((128, 96))
        large.save(path)
    frame = open_dataset(folder).frames[0].read()
    expected = frames_of_robot()[0].camera
    assert frame.camera.fx == pytest.approx(2 * expected.fx)
    assert frame.depth_camera is not None
    assert frame.depth_camera.fx == pytest.approx(expected.fx)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("m_colorWidth", "m_width", "m_colorWidth: Field required"),
        ("m_depthShift = 5000", "m_depthShift = 0", "m_depthShift: .* greater than 0, got '0'"),
        ("m_depthShift = 5000", "m_depthShift = nan", "m_depthShift: .* finite"),
        ("m_depthHeight = 48", "m_depthHeight = tall", "m_depthHeight: .* got 'tall'"),
        ("m_depthHeight = 48", "m_depthHeight = 0", "m_depthHeight: .* greater than or"),
        ("Intrinsic = ", "Intrinsic = 1 ", "m_calibrationColorIntrinsic: .* at most 16 items"),
        ("Intrinsic = ", "Intrinsic = x", r"m_calibrationColorIntrinsic\.0: .* number"),
        ("m_sensorName = ", "m_sensorName = " + "x" * 10_000, "larger than 10,000 bytes"),
    ],
)
def test_bad_facts_of_bundle_fusion_are_named(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    write_bundle_fusion(tmp_path / "office")
    path = tmp_path / "office" / "info.txt"
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    with pytest.raises(ValueError, match=rf"info\.txt: .*{message}") as caught:
        open_dataset(tmp_path / "office")
    assert len(str(caught.value)) < len(str(path)) + 200
    path.write_text(text.replace("ColorIntrinsic = ", "ColorIntrinsic = 99"))
    with pytest.raises(ValueError, match=r"a focal length of .* does not fit"):
        open_dataset(tmp_path / "office")


def test_numbers_beyond_the_limit_are_not_read(tmp_path: Path) -> None:
    path = tmp_path / "camera-intrinsics.txt"
    path.write_text("5 0 3\n0 5 2\n0 0 1\n" + " " * 10_000 + "7")
    with pytest.raises(ValueError, match=r"camera-intrinsics\.txt: larger than 10,000 bytes"):
        read_numbers(path, (3, 3))
    with path.open("wb") as file:
        file.truncate(1 << 26)
    tracemalloc.start()
    with pytest.raises(ValueError, match="larger than 10,000 bytes"):
        read_numbers(path, (3, 3))
    most_bytes = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most_bytes < 1 << 20
    path.write_text("x" * 9000)
    with pytest.raises(ValueError, match="could not convert") as caught:
        read_numbers(path, (3, 3))
    assert len(str(caught.value)) < len(str(path)) + 100


def test_what_is_no_data_set_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="nowhere: there is no such file or folder"):
        open_dataset(tmp_path / "nowhere")
    with pytest.raises(
        ValueError,
        match=r"no data set of a known format \(nerfstudio, 7scenes, tum, colmap, rosbag, ",
    ):
        open_dataset(tmp_path)
    (tmp_path / "transforms.json").write_text("{")
    with pytest.raises(ValueError, match=r"transforms\.json: Invalid JSON"):
        open_dataset(tmp_path)


def test_frames_are_read_without_labels_that_were_left_behind(recorded: Path) -> None:
    (recorded / "instances" / "00001.png").unlink()
    frames = [frame.read() for frame in open_dataset(recorded).frames]
    assert [frame.labels is None for frame in frames] == [False, True, False]
    (recorded / "objects.json").unlink()
    assert all(frame.read().labels is None for frame in open_dataset(recorded).frames)


@pytest.mark.parametrize("content", ["{", "[3]", '[{"objectType": 3}]', "{}"])
def test_bad_lists_of_objects_are_named(recorded: Path, content: str) -> None:
    (recorded / "objects.json").write_text(content)
    with pytest.raises(ValueError, match=r"objects\.json: "):
        open_dataset(recorded)


def test_labels_of_objects_that_there_are_not_are_named(recorded: Path) -> None:
    (recorded / "objects.json").write_text('[{"objectType": "Floor"}]')
    with pytest.raises(ValueError, match=r"instances/00001\.png: Labels: instances: must be in"):
        open_dataset(recorded).frames[1].read()


@pytest.mark.parametrize(
    ("kind", "harm"),
    [("images", "truncated"), ("images", "garbage"), ("images", "small"), ("depth", "truncated")],
)
def test_damaged_images_are_named(recorded: Path, kind: str, harm: str) -> None:
    path = recorded / kind / "00001.png"
    if harm == "truncated":
        path.write_bytes(path.read_bytes()[:-200])
    elif harm == "garbage":
        path.write_bytes(b"no image")
    else:
        with Image.open(path) as image:
            small = image.resize((32, 24))
        small.save(path)
    frame = open_dataset(recorded).frames[1]
    with pytest.raises(ValueError, match=f"{kind}/00001.png"):
        frame.read()


def test_depth_that_is_no_image_is_named(recorded: Path) -> None:
    (recorded / "depth" / "00001.png").write_bytes(b"no image")
    dataset = open_dataset(recorded)
    assert len(dataset.frames) == 2
    (reason,) = dataset.skipped
    assert reason.endswith("depth/00001.png: not an image in JPEG, PNG, TIFF, BMP, WEBP or PPM")


def test_images_of_one_name_get_unique_names(recorded: Path) -> None:
    usual = [frame.name for frame in open_dataset(recorded).frames]
    content = json.loads((recorded / "transforms.json").read_text())
    for entry, folder in zip(content["frames"], ("left", "right"), strict=False):
        (recorded / folder).mkdir()
        for key, name in (("file_path", "1.png"), ("depth_file_path", "1.depth.png")):
            (recorded / entry[key]).rename(recorded / folder / name)
            entry[key] = f"{folder}/{name}"
    (recorded / "transforms.json").write_text(json.dumps(content))
    frames = open_dataset(recorded).frames
    assert [frame.name for frame in frames] == ["left/1", "right/1", *usual[2:]]
    for entry, frame in zip(content["frames"], frames, strict=True):
        assert frame.rgb == recorded / entry["file_path"]


def test_names_differ_in_their_ending_only_where_nothing_else_does() -> None:
    camera = Camera(fx=50, fy=50, cx=32, cy=24, width=64, height=48, world_from_camera=np.eye(4))
    paths = ["a/1.png", "a/1.jpg", "b/1.png", "2.png", "../c/3.png", "3.png", "b/4.png", "b/4.png"]
    frames = with_unique_names(
        (ImageFrame(Path("set") / path, camera) for path in paths), Path("set")
    )
    names = ["a/1.png", "a/1.jpg", "b/1", "2", "../c/3", "3", "b/4.png", "b/4.png"]
    assert [frame.name for frame in frames] == names
    assert [frame.rgb for frame in frames] == [Path("set") / path for path in paths]
