"""Scans of ScanNet, exported and as one file, and renderings of Replica."""

import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from recorded_frames import frames_of_robot
from reprojection import assert_frames_agree
from scan_recordings import write_replica, write_scannet, write_sens

from gslts.datasets import open_dataset


def check(path: Path, depths: list[np.ndarray] | None = None, atol: float = 0.00051) -> None:
    """Open a scan of the robot's frames, and compare it with them."""
    dataset = open_dataset(path)
    assert dataset.left_out == ()
    frames = frames_of_robot()
    read = [frame.read() for frame in dataset.frames]
    depths = depths or [frame.depth for frame in frames]
    for found, expected, depth in zip(read, frames, depths, strict=True):
        np.testing.assert_allclose(
            found.camera.world_from_camera, expected.camera.world_from_camera, atol=1e-6
        )
        for name in ("fx", "fy", "cx", "cy"):
            assert getattr(found.camera, name) == pytest.approx(getattr(expected.camera, name))
        np.testing.assert_allclose(found.depth, depth, atol=atol)
        assert np.median(np.abs(found.rgb.astype(int) - expected.rgb)) <= 3
    assert_frames_agree(read)


def test_scannet(tmp_path: Path) -> None:
    folder = write_scannet(tmp_path / "scene0000_00")
    check(folder, [frame.depth for frame in frames_of_robot(32, 24)])
    assert [frame.name for frame in open_dataset(folder).frames] == ["0", "5", "10"]
    (folder / "color/5.jpg").unlink()
    dataset = open_dataset(folder)
    assert dataset.missing == ("color/5.jpg: there is no such image",)
    assert dataset.skipped == ()


def test_scannet_where_tracking_was_lost(tmp_path: Path) -> None:
    folder = write_scannet(tmp_path / "scene0000_00")
    np.savetxt(folder / "pose/5.txt", np.full((4, 4), -np.inf))
    (reason,) = open_dataset(folder).skipped
    assert reason == "5: the pose must be 4 x 4 finite numbers"


@pytest.mark.parametrize("packed", [0, 1])
def test_sens(tmp_path: Path, packed: int) -> None:
    path = write_sens(tmp_path / "scene0000_00.sens", packed=packed)
    check(path)
    dataset = open_dataset(path)
    assert dataset.name == "scene0000_00"
    assert dataset.frames[1].read().time_s == pytest.approx(1.033333)


def test_damaged_sens(tmp_path: Path) -> None:
    path = write_sens(tmp_path / "a.sens")
    content = path.read_bytes()
    for length, message in (
        (len(content) - 1, "cut off in frame 2 of 3"),
        (len(content) // 2, "cut off"),
        (7, "cut off at byte 7"),
        (0, "cut off at byte 0"),
    ):
        path.write_bytes(content[:length])
        with pytest.raises(ValueError, match=message):
            open_dataset(path)
    path.write_bytes(content[:4] + struct.pack("<Q", 1 << 60) + content[12:])
    with pytest.raises(ValueError, match="the name of the sensor has 1152921504606846976 bytes"):
        open_dataset(path)
    with pytest.raises(ValueError, match="version 3, expected 4"):
        open_dataset(write_sens(path, version=3))
    with pytest.raises(ValueError, match="compression 0 of colour, 1 of depth: not supported"):
        open_dataset(write_sens(path, color=0))
    with pytest.raises(ValueError, match="compression 2 of colour, 2 of depth: not supported"):
        open_dataset(write_sens(path, packed=2))
    frame = open_dataset(write_sens(path, bomb=5)).frames[0]
    with pytest.raises(ValueError, match=r"a\.sens: frame 0: depth: 5 bytes, expected 6144"):
        frame.read()
    content = write_sens(path).read_bytes()
    at = content.index(zlib.compress(np.rint(1000 * frames_of_robot()[0].depth).astype("<u2")))
    path.write_bytes(content[:at] + b"no zlib" + content[at + 7 :])
    with pytest.raises(ValueError, match=r"a\.sens: frame 0: depth: Error -3"):
        open_dataset(path).frames[0].read()


def test_replica(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = write_replica(tmp_path / "Replica" / "room0")
    check(folder, atol=0.0001)
    monkeypatch.chdir(folder)
    assert open_dataset(".").name == "room0"
    (folder / "results/depth000001.png").unlink()
    dataset = open_dataset(folder)
    assert dataset.missing == ("results/depth000001.png: there is no such depth image",)
    rows = (folder / "traj.txt").read_text().splitlines()
    (folder / "traj.txt").write_text("\n".join([" ".join(["1"] * 16), *rows[1:]]))
    with pytest.raises(ValueError, match=r"1 usable frames, .*; frame000000: the pose is not rigi"):
        open_dataset(folder)


def test_replica_that_is_incomplete(tmp_path: Path) -> None:
    folder = write_replica(tmp_path / "Replica" / "room0")
    (folder / "traj.txt").write_text("1 0 0 0\n")
    with pytest.raises(ValueError, match=r"traj\.txt: line 1: '1 0 0 0' is not 16 values"):
        open_dataset(folder)
    camera = folder.parent / "cam_params.json"
    camera.write_text('{"camera": {"w": 64}}')
    with pytest.raises(ValueError, match=r"cam_params\.json: camera\.h: Field required"):
        open_dataset(folder)
    camera.unlink()
    with pytest.raises(ValueError, match=r"room0: there is no cam_params\.json in it or beside it"):
        open_dataset(folder)
