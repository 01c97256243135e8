"""Data sets of other projects' formats: what is read, in which frame, and what is refused."""

import json
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
import sim_scenes
from PIL import Image
from recorded_frames import LOOKS, frames_of_robot

from gslts.core.camera import Camera
from gslts.datasets import open_dataset
from gslts.datasets.dataset import ImageFrame, read_image, read_numbers, with_unique_names
from gslts.datasets.tum import read_trajectory
from gslts.datasets.undistort import Lens
from gslts_sim.capture import capture
from gslts_sim.controller import Controller


@pytest.fixture
def recorded(tmp_path: Path) -> Path:
    """Three frames of a small room, in nerfstudio's layout."""
    robot = Controller(sim_scenes.simple_home(), width=64, height=48)
    capture(robot, LOOKS, tmp_path / "room")
    return tmp_path / "room"


def test_nerfstudio_comes_back_as_it_was_seen(recorded: Path) -> None:
    dataset = open_dataset(recorded)
    assert dataset.name == "room"
    assert dataset.skipped == ()
    for frame, expected in zip(dataset.frames, frames_of_robot(), strict=True):
        read = frame.read()
        np.testing.assert_array_equal(read.rgb, expected.rgb)
        np.testing.assert_allclose(read.depth, expected.depth, atol=0.00051)
        assert read.labels is not None
        assert expected.labels is not None
        np.testing.assert_array_equal(read.labels.instances, expected.labels.instances)
        assert read.labels.types == expected.labels.types
        assert set(read.labels.types) == {"Block", "Wall"}
        pose, true_pose = (f.camera.world_from_camera for f in (read, expected))
        np.testing.assert_allclose(pose, true_pose, atol=1e-12)
        for name in ("fx", "fy", "cx", "cy", "width", "height"):
            assert getattr(read.camera, name) == pytest.approx(getattr(expected.camera, name))


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


def write_tum(folder: Path) -> list:
    """By the data set's own words: quaternions x y z w, depth in 1/5000 m, three clocks."""
    from scipy.spatial.transform import Rotation

    for name in ("rgb", "depth"):
        (folder / name).mkdir(parents=True)
    frames = frames_of_robot(640, 480)
    lists = {"rgb": ["# timestamp filename"], "depth": ["# depth maps"], "groundtruth": ["#"]}
    for number, frame in enumerate(frames):
        time = 1305031102.0 + number
        Image.fromarray(frame.rgb).save(folder / f"rgb/{time:.6f}.png")
        steps = np.rint(5000 * frame.depth).astype(np.uint16)
        Image.fromarray(steps).save(folder / f"depth/{time + 0.012:.6f}.png")
        lists["rgb"].append(f"{time:.6f} rgb/{time:.6f}.png")
        lists["depth"].append(f"{time + 0.012:.6f} depth/{time + 0.012:.6f}.png")
        pose = frame.camera.world_from_camera
        numbers = [*pose[:3, 3], *Rotation.from_matrix(pose[:3, :3]).as_quat()]
        for wrong, shift in ((5.0, -0.3), (0.0, 0.004), (9.0, 0.4)):
            moved = [numbers[0] + wrong, *numbers[1:]]
            lists["groundtruth"].append(" ".join(f"{v:.6f}" for v in [time + shift, *moved]))
    for name, lines in lists.items():
        (folder / f"{name}.txt").write_text("\n".join(lines) + "\n")
    return frames


def test_tum(tmp_path: Path) -> None:
    folder = tmp_path / "rgbd_dataset_freiburg3_room"
    frames = write_tum(folder)
    dataset = open_dataset(folder)
    assert dataset.skipped == ()
    for frame, expected in zip(dataset.frames, frames, strict=True):
        read = frame.read()
        np.testing.assert_array_equal(read.rgb, expected.rgb)
        np.testing.assert_allclose(read.depth, expected.depth, atol=0.00011)
        np.testing.assert_allclose(
            read.camera.world_from_camera, expected.camera.world_from_camera, atol=2e-6
        )
        assert (read.camera.fx, read.camera.cx) == (535.4, 320.6)


def test_tum_without_partners(tmp_path: Path) -> None:
    folder = tmp_path / "room"
    write_tum(folder)
    lines = (folder / "depth.txt").read_text().splitlines()
    (folder / "depth.txt").write_text("\n".join(lines[:2] + lines[3:]))
    dataset = open_dataset(folder)
    assert len(dataset.frames) == 2
    assert "there is no depth image within 0.02 s" in dataset.skipped[0]
    assert dataset.frames[0].camera.fx == 525
    (folder / "groundtruth.txt").unlink()
    with pytest.raises(ValueError, match="0 usable frames, at least 2 are needed"):
        open_dataset(folder)
    blind = open_dataset(folder, posed=False)
    assert [frame.name for frame in blind.frames] == [frame.name for frame in dataset.frames]
    np.testing.assert_array_equal(blind.frames[0].camera.world_from_camera, np.eye(4))


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


def resize_tum(folder: Path, number: int, size: tuple[int, int]) -> None:
    for path in (
        f"rgb/{1305031102 + number}.000000.png",
        f"depth/{1305031102 + number}.012000.png",
    ):
        with Image.open(folder / path) as picture:
            small = picture.resize(size, Image.Resampling.NEAREST)
        small.save(folder / path)


def test_tum_of_another_size_has_the_intrinsics_of_that_size(tmp_path: Path) -> None:
    folder = tmp_path / "rgbd_dataset_freiburg3_room"
    write_tum(folder)
    resize_tum(folder, 0, (160, 120))
    resize_tum(folder, 1, (1280, 960))
    dataset = open_dataset(folder)
    assert dataset.skipped == ()
    for frame, scale in zip(dataset.frames, (1 / 4, 2, 1), strict=True):
        read = frame.read()
        assert read.rgb.shape == (480 * scale, 640 * scale, 3)
        numbers = (read.camera.fx, read.camera.fy, read.camera.cx, read.camera.cy)
        expected = scale * np.array((535.4, 539.2, 320.6, 248.1))
        np.testing.assert_allclose(numbers, expected, rtol=1e-12)


def test_tum_of_another_shape_is_skipped(tmp_path: Path) -> None:
    folder = tmp_path / "room"
    write_tum(folder)
    resize_tum(folder, 1, (640, 360))
    dataset = open_dataset(folder)
    assert len(dataset.frames) == 2
    assert dataset.skipped == (
        "rgb/1305031103.000000.png: 640 x 360 px: intrinsics are known for 4:3 images only",
    )


@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("groundtruth", "1305031103.5 2 3 4 5 6 7 nan"),
        ("groundtruth", "1305031103.5 2 3"),
        ("groundtruth", "1305031103.5 2 3 4 5 6 seven 8"),
        ("depth", "inf depth/1305031103.012000.png"),
        ("depth", "1305031103.012"),
        ("rgb", "never rgb/1305031103.000000.png"),
    ],
)
def test_bad_lines_of_tum_are_left_out_and_named(tmp_path: Path, name: str, line: str) -> None:
    folder = tmp_path / "room"
    write_tum(folder)
    path = folder / f"{name}.txt"
    good = path.read_text().splitlines()
    path.write_text("\n".join([*good[:2], line, *good[2:]]))
    dataset = open_dataset(folder)
    assert len(dataset.frames) == 3
    columns = 8 if name == "groundtruth" else 2
    assert dataset.skipped == (f"{name}.txt: line 3: {line!r} is not {columns} values",)
    path.write_text("\n".join([*good[:2], line, *good[2:], *["?"] * 50]))
    skipped = open_dataset(folder).skipped
    assert skipped[0].startswith(f"{name}.txt: line 3: ")
    # Lines of pictures are frames; of poses there are far more.
    assert len(skipped) == (51 if name == "rgb" else 1)
    assert name == "rgb" or skipped[0].endswith(", and 50 lines more")
    path.write_text("\n".join(["# All others are bad.", line, "nan"]))
    with pytest.raises(ValueError, match=rf"{name}\.txt: no line can be used; line 2: .* values"):
        open_dataset(folder)


def test_a_trajectory_with_a_bad_line_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "way.txt"
    path.write_text("0 1 2 3 0 0 0 1\n1 1 2 3 0 0 0 nan\n")
    with pytest.raises(ValueError, match=r"way\.txt: line 2: .* is not 8 values"):
        read_trajectory(path)


@pytest.mark.parametrize("where", [".", "..", "rgb/.."])
def test_data_sets_are_named_from_inside(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, where: str
) -> None:
    folder = tmp_path / "rgbd_dataset_freiburg3_room"
    write_tum(folder)
    monkeypatch.chdir(folder / "rgb" if where == ".." else folder)
    dataset = open_dataset(where)
    assert dataset.name == "rgbd_dataset_freiburg3_room"
    assert dataset.frames[0].camera.fx == 535.4


def test_a_link_to_a_sequence_of_tum(tmp_path: Path) -> None:
    write_tum(tmp_path / "rgbd_dataset_freiburg3_room")
    (tmp_path / "room").symlink_to("rgbd_dataset_freiburg3_room")
    dataset = open_dataset(tmp_path / "room")
    assert dataset.name == "room"
    assert dataset.frames[0].camera.fx == 535.4


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


def test_seven_scenes_of_another_size_has_the_focal_lengths_of_that_size(tmp_path: Path) -> None:
    write_seven_scenes(tmp_path / "chess")
    (tmp_path / "chess" / "camera-intrinsics.txt").unlink()
    read = open_dataset(tmp_path / "chess").frames[0].read()
    assert read.depth_camera is not None
    assert read.depth_camera.fx == pytest.approx(58.5)
    assert read.depth_camera.fy == pytest.approx(58.5)
    assert read.camera.fx == pytest.approx(52.5)


def test_numbers_beyond_the_limit_are_not_read(tmp_path: Path) -> None:
    path = tmp_path / "camera-intrinsics.txt"
    path.write_text("5 0 3\n0 5 2\n0 0 1\n" + " " * 10_000 + "7")
    with pytest.raises(
        ValueError, match=r"camera-intrinsics\.txt: over 10000 bytes, too long for a matrix"
    ):
        read_numbers(path, (3, 3))
    with path.open("wb") as file:
        file.truncate(1 << 26)
    tracemalloc.start()
    with pytest.raises(ValueError, match="over 10000 bytes"):
        read_numbers(path, (3, 3))
    most_bytes = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most_bytes < 1 << 20
    path.write_text("x" * 9000)
    with pytest.raises(ValueError, match="could not convert") as caught:
        read_numbers(path, (3, 3))
    assert len(str(caught.value)) < len(str(path)) + 100


def edited(folder: Path, edit: object) -> Path:
    content = json.loads((folder / "transforms.json").read_text())
    edit(content)
    (folder / "transforms.json").write_text(json.dumps(content))
    return folder


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (lambda c: c["frames"][1].pop("file_path"), r"frames\[1\]: file_path: Field required"),
        (lambda c: c["frames"].__setitem__(1, 7), r"frames\[1\]: expected an object, got 7"),
        (
            lambda c: c["frames"][1]["transform_matrix"][0].__setitem__(0, float("nan")),
            r"frames\[1\]: transform_matrix\.0\.0: .*finite",
        ),
        (
            lambda c: c["frames"][1]["transform_matrix"][0].__setitem__(0, 9.0),
            r"frames\[1\]: the pose is not rigid",
        ),
        (lambda c: c["frames"][1].update(k4=0.1), r"frames\[1\]: k4: 0\.1 is for fisheyes only"),
        (lambda c: c["frames"][1].update(fl_x=-3), r"frames\[1\]: .*f"),
        (
            lambda c: c["frames"][1].update(fl_x=0.9),
            r"frames\[1\]: a focal length of 0\.9 px does not fit an image of 64 x 48 px",
        ),
        (
            lambda c: c["frames"][1].update(cx=64.5),
            r"frames\[1\]: the principal point \(64\.5, 24\) is outside the image of 64 x 48 px",
        ),
    ],
)
def test_bad_frames_are_skipped_and_named(recorded: Path, edit: object, message: str) -> None:
    import re

    dataset = open_dataset(edited(recorded, edit))
    assert len(dataset.frames) == 2
    (reason,) = dataset.skipped
    assert re.search(message, reason), reason
    assert "\n" not in reason


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (lambda c: c.pop("frames"), r"transforms\.json: frames: Field required"),
        (lambda c: c.update(frames=c["frames"][:1]), "1 usable frames, at least 2 are needed"),
        (lambda c: c.update(camera_model="EQUIRECTANGULAR"), "EQUIRECTANGULAR is not supported"),
        (lambda c: c.update(fl_x="wide"), r"transforms\.json: fl_x: "),
    ],
)
def test_bad_data_sets_are_refused(recorded: Path, edit: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        open_dataset(edited(recorded, edit))


BAD_ANGLES = [0, float("nan"), -1.5, 3.2, "wide", "0.9", True, 1e300, 10**400, 1e-323]


def without_focal_length(content: dict) -> None:
    for part in (content, *content["frames"]):
        for name in ("fl_x", "fl_y"):
            part.pop(name, None)


def test_nerfstudio_with_the_angle_of_view(recorded: Path) -> None:
    def edit(content: dict) -> None:
        without_focal_length(content)
        content["camera_angle_x"] = 1.2

    camera = open_dataset(edited(recorded, edit)).frames[0].camera
    assert camera.fx == camera.fy == pytest.approx(32 / np.tan(0.6))


@pytest.mark.parametrize("angle", BAD_ANGLES, ids=lambda angle: repr(angle)[:8])
def test_angles_of_view_that_are_none_are_refused(recorded: Path, angle: object) -> None:
    def edit(content: dict) -> None:
        without_focal_length(content)
        content["camera_angle_x"] = angle

    edited(recorded, edit)
    with pytest.raises(ValueError, match=r"transforms\.json: camera_angle_x: .*, got ") as caught:
        open_dataset(recorded)
    assert str(caught.value).endswith(f", got {angle!r:.40}")


@pytest.mark.parametrize("angle", BAD_ANGLES, ids=lambda angle: repr(angle)[:8])
def test_an_angle_of_view_that_is_none_is_skipped(recorded: Path, angle: object) -> None:
    edited(recorded, lambda c: c["frames"][1].update(camera_angle_x=angle))
    (reason,) = open_dataset(recorded).skipped
    assert reason.startswith("frames[1]: camera_angle_x: Input should be ")


@pytest.mark.parametrize("name", ["w", "h"])
def test_sides_that_are_no_floats_are_refused(recorded: Path, name: str) -> None:
    def edit(content: dict) -> None:
        for part in (content, *content["frames"]):
            part.pop("cx", None)
            part.pop("cy", None)
        content["frames"][1].update({"w": 64, "h": 48, name: 10**400})

    (reason,) = open_dataset(edited(recorded, edit)).skipped
    assert reason.startswith(f"frames[1]: {name}: Input should be less than or equal to 65536, got")
    assert len(reason) < 120


@pytest.mark.parametrize("unit", [0, -0.001])
def test_units_of_depth_that_are_none_are_refused(recorded: Path, unit: float) -> None:
    edited(recorded, lambda c: c.update(depth_unit_scale_factor=unit))
    with pytest.raises(ValueError, match=r"json: depth_unit_scale_factor: .*greater than 0, got"):
        open_dataset(recorded)


def test_paths_that_name_no_file_are_skipped(recorded: Path) -> None:
    def edit(content: dict) -> None:
        for entry in content["frames"][1:]:
            entry.update(file_path="/", w=64, h=48)
        content["frames"].append(content["frames"][0])

    dataset = open_dataset(edited(recorded, edit))
    assert dataset.skipped == tuple(f"frames[{k}]: file_path: '/' is not a file" for k in (1, 2))


def test_nerfstudio_has_lenses(recorded: Path) -> None:
    edited(recorded, lambda c: c.update(k1=-0.1, k2=0.02, p1=0.001, p2=0.002, k3=0.003))
    assert open_dataset(recorded).frames[0].lens == Lens((-0.1, 0.02, 0.001, 0.002, 0.003))
    edited(recorded, lambda c: c.update(camera_model="OPENCV_FISHEYE", k4=0.004))
    frame = open_dataset(recorded).frames[0]
    assert frame.lens == Lens((-0.1, 0.02, 0.003, 0.004), fisheye=True)
    assert frame.read().mask is not None


def test_what_is_no_data_set_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="nowhere: there is no such file or folder"):
        open_dataset(tmp_path / "nowhere")
    with pytest.raises(
        ValueError,
        match=r"no data set of a known format \(nerfstudio, 7scenes, tum, colmap, rosbag\)",
    ):
        open_dataset(tmp_path)
    (tmp_path / "transforms.json").write_text("{")
    with pytest.raises(ValueError, match=r"transforms\.json: file: Invalid JSON"):
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


@pytest.mark.parametrize("kind", ["images", "depth"])
@pytest.mark.parametrize("harm", ["truncated", "garbage", "gone", "small"])
def test_damaged_pictures_are_named(recorded: Path, kind: str, harm: str) -> None:
    path = recorded / kind / "00001.png"
    if harm == "truncated":
        path.write_bytes(path.read_bytes()[:-200])
    elif harm == "garbage":
        path.write_bytes(b"no picture")
    elif harm == "gone":
        path.unlink()
    else:
        with Image.open(path) as image:
            small = image.resize((32, 24))
        small.save(path)
    frame = open_dataset(recorded).frames[1]
    with pytest.raises((OSError, ValueError), match=f"{kind}/00001.png"):
        frame.read()


def test_pictures_are_damaged_in_many_ways(tmp_path: Path) -> None:
    path = tmp_path / "a.tif"
    Image.new("P", (8, 8)).save(path)
    content = bytearray(path.read_bytes())
    content[72] = 7  # Makes offsets bytes, for which Pillow raises a TypeError.
    path.write_bytes(content)
    with pytest.raises(ValueError, match=r"a\.tif: "):
        read_image(path, "RGB", (8, 8))


def test_pictures_of_one_name_are_with_unique_names(recorded: Path) -> None:
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
