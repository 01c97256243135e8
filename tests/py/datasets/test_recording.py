"""Frames that are recorded come back from the data set."""

from pathlib import Path

import numpy as np
import pytest

from gslts.core.camera import camera_from_fov, look_at
from gslts.core.frame import Labels, RgbdFrame
from gslts.datasets import open_dataset
from gslts.datasets.recording import RecordingWriter


def frame(number: int) -> RgbdFrame:
    rng = np.random.default_rng(number)
    pose = look_at(np.array([number, 0.0, 1.0]), np.array([number + 1.0, 1.0, 0.5]))
    depth = rng.integers(0, 5000, (6, 8)).astype(np.float32) / 1000
    depth[0, 0] = np.nan
    labels = Labels(rng.integers(-1, 2, (6, 8)).astype(np.int32), ("Mug", "Sofa"))
    rgb = rng.integers(0, 256, (6, 8, 3)).astype(np.uint8)
    return RgbdFrame(rgb, depth, camera_from_fov(8, 6, 1.0, pose), float(number), labels=labels)


def test_frames_come_back(tmp_path: Path) -> None:
    writer = RecordingWriter(tmp_path / "new")
    frames = [frame(number) for number in range(3)]
    for each in frames:
        writer.add(each)
    writer.save()
    opened = open_dataset(tmp_path / "new")
    assert len(opened.frames) == 3
    for entry, each in zip(opened.frames, frames, strict=True):
        read = entry.read()
        np.testing.assert_array_equal(read.rgb, each.rgb)
        np.testing.assert_allclose(read.depth, np.nan_to_num(each.depth), atol=6e-4)
        poses = read.camera.world_from_camera, each.camera.world_from_camera
        np.testing.assert_allclose(*poses, atol=1e-9)
        assert read.labels is not None
        assert each.labels is not None
        np.testing.assert_array_equal(read.labels.instances, each.labels.instances)
        assert read.labels.types == ("Mug", "Sofa")


def test_a_recording_is_continued_after_its_last_list(tmp_path: Path) -> None:
    first = RecordingWriter(tmp_path)
    for number in range(12):  # Without an end: the list of the first ten is there.
        first.add(frame(number))
    second = RecordingWriter(tmp_path)
    assert second.count == 10
    second.add(frame(20))
    second.save()
    opened = open_dataset(tmp_path)
    assert len(opened.frames) == 11
    np.testing.assert_array_equal(opened.frames[10].read().rgb, frame(20).rgb)


def test_other_folders_are_rejected(tmp_path: Path) -> None:
    (tmp_path / "letter.txt").write_text("dear")
    with pytest.raises(ValueError, match="it is not empty, and no recording"):
        RecordingWriter(tmp_path)
    (tmp_path / "letter.txt").rename(tmp_path / "transforms.json")
    with pytest.raises(ValueError, match=r"transforms.json: it is no list of frames"):
        RecordingWriter(tmp_path)
