"""Exports of RTAB-Map, written after `rtabmap-export`."""

from pathlib import Path

import numpy as np
import pytest
from recorded_frames import frames_of_robot
from reprojection import assert_frames_agree
from rtabmap_exports import STAMP, write_calibration, write_rtabmap

from gslts.datasets import open_dataset


@pytest.mark.parametrize(
    ("prefix", "poses", "by_id", "width"),
    [
        ("home_", "camera_poses", False, 32),
        ("", "camera_poses", True, 64),
        ("home_", "poses", True, 32),
        ("", "poses", False, 64),
        ("", "camera", False, 64),
    ],
)
def test_rtabmap(tmp_path: Path, prefix: str, poses: str, by_id: bool, width: int) -> None:
    folder = write_rtabmap(tmp_path / "export", prefix, poses, by_id, width)
    (folder / f"{prefix}scan_poses.txt").write_text("")
    (folder / f"{prefix}cloud.ply").write_text("ply")
    dataset = open_dataset(folder)
    assert dataset.left_out == ()
    assert dataset.name == "export"
    read = [frame.read() for frame in dataset.frames]
    for found, expected, small in zip(
        read, frames_of_robot(), frames_of_robot(width, width * 3 // 4), strict=True
    ):
        pose = expected.camera.world_from_camera
        np.testing.assert_allclose(found.camera.world_from_camera, pose, atol=5e-6)
        for name in ("fx", "fy", "cx", "cy"):
            assert getattr(found.camera, name) == pytest.approx(getattr(expected.camera, name))
        assert (found.depth_camera is None) == (width == 64)
        assert (found.depth[:2] == 0).all(), "no confidence"
        np.testing.assert_allclose(found.depth[2:], small.depth[2:], atol=0.00051)
        assert np.median(np.abs(found.rgb.astype(int) - expected.rgb)) <= 3
    assert read[2].time_s - read[0].time_s == pytest.approx(0.2, abs=1e-6)
    assert_frames_agree(read)


def rewrite(path: Path, old: str, new: str) -> None:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


def test_frames_that_cannot_be_used_are_named(tmp_path: Path) -> None:
    folder = write_rtabmap(tmp_path / "export", poses="poses")
    first, second, third = (STAMP.format(number) for number in range(3))
    (folder / f"home_rgb/{first}.jpg").unlink()
    dataset = open_dataset(folder)
    assert dataset.missing == (f"home_rgb/{first}.jpg: there is no such image",)
    calibrations = folder / "home_calib"
    rewrite(calibrations / f"{second}.yaml", "local_transform", "other_transform")
    (calibrations / f"{third}.yaml").write_text("%YAML:1.0\n---\n{[}")
    with pytest.raises(ValueError, match="0 usable frames") as caught:
        open_dataset(folder)
    assert "it does not say where the camera is on the robot; export the poses" in str(caught.value)
    write_calibration(calibrations / f"{second}.yaml", frames_of_robot(32, 24)[0].camera, "")
    with pytest.raises(ValueError, match=r"of images of \(32, 24\) px, this one has \(64, 48\)"):
        open_dataset(folder)
    (calibrations / f"{second}.yaml").unlink()
    with pytest.raises(ValueError, match="No such file"):
        open_dataset(folder)
    (folder / "home_poses.txt").rename(folder / "home_camera_poses.txt")
    text = "%YAML:1.0\n---\nimage_width: 64\nimage_height: 48\n"
    for matrix in ("", "camera_matrix: 3\n", "camera_matrix:\n   data: [1, 2]\n"):
        (calibrations / f"{second}.yaml").write_text(text + matrix)
        with pytest.raises(ValueError, match="there is no camera_matrix of 3 x 3 numbers"):
            open_dataset(folder)


def test_exports_that_are_incomplete(tmp_path: Path) -> None:
    (tmp_path / "kitchen.db").write_bytes(b"SQLite format 3")
    with pytest.raises(ValueError, match=r"databases are not read: export it with rtabmap-export"):
        open_dataset(tmp_path / "kitchen.db")
    folder = write_rtabmap(tmp_path / "export")
    poses = folder / "home_camera_poses.txt"
    rows = poses.read_text().splitlines()
    poses.write_text("\n".join(row.rsplit(" ", 1)[0] for row in rows))
    with pytest.raises(ValueError, match=r"is not 9 values; other formats do not say which axes"):
        open_dataset(folder)
    poses.rename(folder / "home_camera_poses_0.txt")
    (folder / "home_camera_poses_1.txt").write_text("")
    with pytest.raises(ValueError, match="poses of several cameras, which are not supported"):
        open_dataset(folder)
    for file in folder.glob("*.txt"):
        file.unlink()
    with pytest.raises(ValueError, match="there are no poses: export with rtabmap-export --images"):
        open_dataset(folder)
    write_rtabmap(folder, "office_")
    with pytest.raises(ValueError, match="several exports, such as home_rgb and office_rgb"):
        open_dataset(folder)
