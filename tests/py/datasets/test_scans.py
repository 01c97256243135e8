"""Scans of ScanNet, exported and as one file, and renderings of Replica."""

import io
import json
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from recorded_frames import frames_of_robot
from reprojection import assert_frames_agree

from gslts.core.frame import RgbdFrame
from gslts.datasets import open_dataset


def intrinsics(frame: RgbdFrame) -> np.ndarray:
    """The middle of the first pixel is (0, 0)."""
    matrix, camera = np.eye(4), frame.camera
    matrix[0, 0], matrix[1, 1] = camera.fx, camera.fy
    matrix[:2, 2] = camera.cx - 0.5, camera.cy - 0.5
    return matrix


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


def write_scannet(folder: Path) -> Path:
    """By the words of SensReader: text matrices, camera to world, depth in millimetres."""
    small = frames_of_robot(32, 24)
    for name in ("color", "depth", "pose", "intrinsic"):
        (folder / name).mkdir(parents=True)
    for number, (frame, depth) in enumerate(zip(frames_of_robot(), small, strict=True)):
        at = 5 * number
        Image.fromarray(frame.rgb).save(folder / f"color/{at}.jpg", quality=95)
        steps = np.rint(1000 * depth.depth).astype(np.uint16)
        Image.fromarray(steps).save(folder / f"depth/{at}.png")
        np.savetxt(folder / f"pose/{at}.txt", frame.camera.world_from_camera, fmt="%f")
    np.savetxt(folder / "intrinsic/intrinsic_color.txt", intrinsics(frame), fmt="%f")
    np.savetxt(folder / "intrinsic/intrinsic_depth.txt", intrinsics(depth), fmt="%f")
    return folder


def test_scannet(tmp_path: Path) -> None:
    folder = write_scannet(tmp_path / "scene0000_00")
    check(folder, [frame.depth for frame in frames_of_robot(32, 24)])
    assert [frame.name for frame in open_dataset(folder).frames] == ["0", "5", "10"]
    (folder / "color/5.jpg").unlink()
    dataset = open_dataset(folder)
    assert dataset.missing == ("color/5.*: there is no such image",)
    assert dataset.skipped == ()


def test_scannet_where_tracking_was_lost(tmp_path: Path) -> None:
    folder = write_scannet(tmp_path / "scene0000_00")
    np.savetxt(folder / "pose/5.txt", np.full((4, 4), -np.inf))
    (reason,) = open_dataset(folder).skipped
    assert reason == "5: the pose must be 4 x 4 finite numbers"


def write_sens(path: Path, color: int = 2, packed: int = 1, **changed: int) -> Path:
    """By the words of `SensReader/README.md` and the order of its Python reader."""
    frames = frames_of_robot()
    camera = frames[0].camera
    name = b"StructureSensor"
    content = [struct.pack("<IQ", changed.get("version", 4), len(name)), name]
    for matrix in (intrinsics(frames[0]), np.eye(4)) * 2:
        content.append(matrix.astype("<f4").tobytes())
    sizes = (camera.width, camera.height) * 2
    content.append(struct.pack("<2i4IfQ", color, packed, *sizes, 1000.0, len(frames)))
    for number, frame in enumerate(frames):
        file = io.BytesIO()
        Image.fromarray(frame.rgb).save(file, "JPEG", quality=95)
        depth = np.rint(1000 * frame.depth).astype("<u2").tobytes()
        depth = zlib.compress(bytes(changed.get("bomb", 0)) or depth) if packed == 1 else depth
        content.append(frame.camera.world_from_camera.astype("<f4").tobytes())
        stamp = 1_000_000 + 33_333 * number
        content.append(struct.pack("<4Q", stamp, stamp, file.tell(), len(depth)))
        content += [file.getvalue(), depth]
    path.write_bytes(b"".join(content))
    return path


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


def write_replica(folder: Path) -> Path:
    """By the words of NICE-SLAM: a row of `traj.txt` is a pose, camera to world."""
    (folder / "results").mkdir(parents=True)
    rows = []
    for number, frame in enumerate(frames_of_robot()):
        Image.fromarray(frame.rgb).save(folder / f"results/frame{number:06}.jpg", quality=95)
        steps = np.rint(6553.5 * frame.depth).astype(np.uint16)
        Image.fromarray(steps).save(folder / f"results/depth{number:06}.png")
        rows.append(" ".join(f"{v:.18e}" for v in frame.camera.world_from_camera.ravel()))
    (folder / "traj.txt").write_text("\n".join(rows) + "\n")
    matrix = intrinsics(frame)
    camera = {"fx": matrix[0, 0], "fy": matrix[1, 1], "scale": 6553.5}
    camera |= {"cx": matrix[0, 2], "cy": matrix[1, 2]}
    camera |= {"w": frame.camera.width, "h": frame.camera.height}
    (folder.parent / "cam_params.json").write_text(json.dumps({"camera": camera}))
    return folder


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
