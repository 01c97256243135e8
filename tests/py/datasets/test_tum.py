"""Data sets in the format of TUM: poses, intrinsics by size, and bad lines."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from recorded_frames import frames_of_robot

from gslts.datasets import open_dataset
from gslts.datasets.tum import read_trajectory


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


def resize_tum(folder: Path, number: int, size: tuple[int, int]) -> None:
    for path in (
        f"rgb/{1305031102 + number}.000000.png",
        f"depth/{1305031102 + number}.012000.png",
    ):
        with Image.open(folder / path) as image:
            small = image.resize(size, Image.Resampling.NEAREST)
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
    # Each image is a frame; there are far more poses.
    assert len(skipped) == (51 if name == "rgb" else 1)
    assert name == "rgb" or skipped[0].endswith(", and 50 lines more")
    path.write_text("\n".join(["# All others are bad.", line, "nan"]))
    with pytest.raises(ValueError, match=rf"{name}\.txt: no line can be used; line 2: .* values"):
        open_dataset(folder)


def test_a_trajectory_with_a_bad_line_is_rejected(tmp_path: Path) -> None:
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
