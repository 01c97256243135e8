"""Recordings of phones: Polycam and Record3D, written after their documentation."""

import json
import shutil
import sys
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from phone_recordings import UNSURE, metadata, pack, small_depths, write_polycam, write_r3d
from PIL import Image
from recorded_frames import frames_of_robot
from reprojection import assert_frames_agree

from gslts.core.frame import RgbdFrame
from gslts.datasets import open_dataset


def check(folder: Path) -> list[RgbdFrame]:
    """Open a recording of the robot's frames, and compare it with them."""
    frames = frames_of_robot()
    dataset = open_dataset(folder)
    assert dataset.left_out == ()
    read = [frame.read() for frame in dataset.frames]
    for found, expected, depth in zip(read, frames, small_depths(), strict=True):
        assert found.depth_camera is not None
        assert found.depth_camera.fx == pytest.approx(expected.camera.fx / 2)
        pose = expected.camera.world_from_camera
        np.testing.assert_allclose(found.camera.world_from_camera, pose, atol=1e-6)
        np.testing.assert_allclose(found.depth_camera.world_from_camera, pose, atol=1e-6)
        assert (found.depth[UNSURE] == 0).all(), "low confidence"
        sure = np.ones(depth.shape, bool)
        sure[UNSURE] = False
        np.testing.assert_allclose(found.depth[sure], depth[sure], atol=0.00051)
        difference = np.abs(found.rgb.astype(int) - expected.rgb)
        assert np.median(difference) <= 3  # It is a JPEG.
    assert_frames_agree(read)
    return read


@pytest.mark.parametrize("corrected", [True, False])
def test_polycam(tmp_path: Path, corrected: bool) -> None:
    read = check(write_polycam(tmp_path / "room", corrected))
    assert read[1].time_s - read[0].time_s == pytest.approx(0.5, abs=1e-6)
    if not corrected:
        assert read[0].mask is None
        return
    assert read[0].mask is not None
    assert read[0].mask[15:-15, 15:-15].all()
    assert read[0].mask.sum() == (48 - 30) * (64 - 30), "the border may be black"


def test_missing_and_damaged_keyframes_are_named(tmp_path: Path) -> None:
    folder = write_polycam(tmp_path / "room", corrected=False) / "keyframes"
    names = sorted(file.stem for file in (folder / "images").iterdir())
    for stem in range(3):
        shutil.copy(folder / "cameras" / f"{names[0]}.json", folder / "cameras" / f"{stem}.json")
    (folder / "depth" / f"{names[1]}.png").unlink()
    shutil.copy(folder / "images" / f"{names[2]}.jpg", folder / "images" / "7.jpg")
    shutil.copy(folder / "depth" / f"{names[2]}.png", folder / "depth" / "7.png")
    (folder / "cameras" / "7.json").write_text('{"width": 64, "height": 48, "fx": "wide"}')
    dataset = open_dataset(tmp_path / "room")
    assert [frame.name for frame in dataset.frames] == [names[0], names[2]]
    missing = [f"keyframes/images/{stem}.jpg: there is no such image" for stem in range(3)]
    missing.append(f"keyframes/depth/{names[1]}.png: there is no such depth image")
    assert sorted(dataset.missing) == sorted(missing)
    (reason,) = dataset.skipped
    assert "7.json: fx: Input should be a valid number" in reason


@pytest.mark.parametrize("packed", [True, False])
def test_record3d(tmp_path: Path, packed: bool) -> None:
    folder = write_r3d(tmp_path / "walk", frameTimestamps=[0.0, 0.25, 0.5])
    path = pack(folder) if packed else folder
    assert open_dataset(path).name == "walk"
    read = check(path)
    assert [frame.time_s for frame in read] == [0, 0.25, 0.5]


def test_record3d_with_autofocus(tmp_path: Path) -> None:
    coefficients = [[50.0 + number, 51.0, 31.0, 23.0] for number in range(3)]
    folder = write_r3d(tmp_path / "walk", perFrameIntrinsicCoeffs=coefficients)
    with Image.open(folder / "rgbd/2.jpg") as image:
        image.resize((128, 96)).save(folder / "rgbd/2.jpg")  # Recorded in high quality.
    first, _, last = (frame.camera for frame in open_dataset(folder).frames)
    assert (first.fx, first.fy, first.cx, first.cy) == (50, 51, 31, 23)
    assert (last.fx, last.fy, last.cx, last.cy) == (104, 102, 62, 46)


def test_record3d_as_exr(tmp_path: Path) -> None:
    openexr = pytest.importorskip("OpenEXR")
    folder = tmp_path / "EXR_RGBD"
    for part in ("rgb", "depth"):
        (folder / part).mkdir(parents=True)
    (folder / "metadata.json").write_text(json.dumps(metadata()))
    for number, (frame, depth) in enumerate(zip(frames_of_robot(), small_depths(), strict=True)):
        Image.fromarray(frame.rgb).save(folder / f"rgb/{number}.jpg", quality=95)
        metres = np.where(depth > 0, depth, np.nan).astype(np.float32)
        metres[UNSURE] = 0
        header = {"compression": openexr.ZIP_COMPRESSION, "type": openexr.scanlineimage}
        openexr.File(header, {"R": metres}).write(str(folder / f"depth/{number}.exr"))
    check(folder)
    small = {"compression": openexr.ZIP_COMPRESSION, "type": openexr.scanlineimage}
    openexr.File(small, {"R": metres[:20]}).write(str(folder / "depth/0.exr"))
    (folder / "depth/1.exr").write_bytes(b"no image")
    frames = open_dataset(folder).frames
    with pytest.raises(ValueError, match=r"frame 0: 0\.exr: \(20, 32\) px, expected \(24, 32\)"):
        frames[0].read()
    with pytest.raises(ValueError, match=r"frame 1: 1\.exr: "):
        frames[1].read()


def test_record3d_without_poses(tmp_path: Path) -> None:
    folder = write_r3d(tmp_path / "face", poses=[[0, 0, 0, 1, 0, 0, 0]] * 3)
    with pytest.raises(ValueError, match="all poses are the same: Record3D has none without LiDAR"):
        open_dataset(folder)
    assert len(open_dataset(folder, posed=False).frames) == 3


def test_record3d_with_fewer_images_than_poses(tmp_path: Path) -> None:
    folder = write_r3d(tmp_path / "walk", poses=metadata()["poses"] * 2)
    (folder / "rgbd/1.depth").unlink()
    dataset = open_dataset(pack(folder))
    assert [frame.name for frame in dataset.frames] == ["0", "2"]
    images = [f"{number}.jpg: there is no such image" for number in (3, 4, 5)]
    assert dataset.missing == ("1.depth: there is no such depth image", *images)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("0.depth", b"no LZFSE", r"frame 0: 0\.depth: not LZFSE, or damaged"),
        ("0.depth", b"", r"frame 0: 0\.depth: not LZFSE, or damaged"),
        ("0.depth", bytes(100_000), r"frame 0: .*0\.depth: larger than 23,072 bytes"),
        ("0.depth", "short", r"frame 0: 0\.depth: 40 bytes, expected 3072"),
        ("0.conf", "short", r"frame 0: 0\.conf: 40 bytes, expected 768"),
        ("0.depth", "bomb", r"frame 0: 0\.depth: it would unpack to more than 3072 bytes"),
        ("0.jpg", b"no JPEG", r"frame 0: not an image in JPEG, PNG"),
    ],
)
def test_damaged_files_of_record3d(tmp_path: Path, name: str, content: Any, message: str) -> None:
    lzfse = pytest.importorskip("lzfse")
    folder = write_r3d(tmp_path / "walk")
    first = open_dataset(folder).frames[0]
    if content == "short":
        content = lzfse.compress(bytes(40))
    elif content == "bomb":
        content = lzfse.compress(bytes(30_000_000))
    (folder / "rgbd" / name).write_bytes(content)
    with pytest.raises(ValueError, match=message):
        first.read()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"K": [1, 2, 3]}, "metadata: K: List should have at least 9 items"),
        ({"dw": 10**9}, "metadata: dw: .* less than or equal to 1920"),
        ({"poses": [[0, 0, 0, 1]]}, r"metadata: poses\.0\.4: Field required"),
        ({"w": 0}, "metadata: w: .* greater than or equal to 1"),
    ],
)
def test_damaged_metadata_of_record3d(tmp_path: Path, change: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        open_dataset(write_r3d(tmp_path / "walk", **change))


def test_archives_that_are_none(tmp_path: Path) -> None:
    path = tmp_path / "walk.r3d"
    path.write_bytes(b"PK")
    with pytest.raises(ValueError, match=r"walk\.r3d: File is not a zip file"):
        open_dataset(path)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("readme", "")
    with pytest.raises(ValueError, match=r"walk\.r3d: there is no metadata"):
        open_dataset(path)
    packed = bytearray(pack(write_r3d(tmp_path / "walk")).read_bytes())
    at = packed.index(b"rgbd/1.depth") + len("rgbd/1.depth") + 20
    packed[at : at + 4] = b"oops"  # Its checksum is another one now.
    path.write_bytes(packed)
    with pytest.raises(ValueError, match=r"frame 1: .*Bad CRC-32"):
        open_dataset(path).frames[1].read()


def test_missing_packages_are_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = write_r3d(tmp_path / "walk")
    monkeypatch.setitem(sys.modules, "lzfse", None)
    with pytest.raises(ImportError, match=r"lzfse: pip install 'gslts\[record3d\]'"):
        open_dataset(folder)
    (folder / "metadata").rename(folder / "metadata.json")
    (folder / "rgbd").rename(folder / "rgb")
    monkeypatch.setitem(sys.modules, "OpenEXR", None)
    with pytest.raises(ImportError, match=r"OpenEXR: pip install 'gslts\[record3d\]'"):
        open_dataset(folder)
