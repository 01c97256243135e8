"""Frames that are recorded come back from the data set."""

import errno
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from gslts.core.camera import camera_from_fov, look_at
from gslts.core.frame import Labels, RgbdFrame
from gslts.datasets import open_dataset, recording
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


def masked(number: int) -> RgbdFrame:
    """Return a frame whose first column is beyond the border of its undistorted image."""
    mask = np.ones((6, 8), np.bool_)
    mask[:, 0] = False
    return replace(frame(number), mask=mask)


def test_masks_come_back(tmp_path: Path) -> None:
    writer = RecordingWriter(tmp_path)
    for each in (masked(0), frame(1), replace(frame(2), mask=np.ones((6, 8), np.bool_))):
        writer.add(each)
    writer.save()
    masks = [entry.read().mask for entry in open_dataset(tmp_path).frames]
    np.testing.assert_array_equal(masks[0], masked(0).mask)
    assert masks[1:] == [None, None]
    with Image.open(tmp_path / "masks" / "00000.png") as image:
        assert image.mode == "L"
        assert image.getextrema() == (0, 255)


def test_a_recording_is_continued_after_its_last_list(tmp_path: Path) -> None:
    first = RecordingWriter(tmp_path)
    for number in range(12):
        first.add(frame(number))  # Without an end: the list of the first, or of the first ten.
        assert RecordingWriter(tmp_path).count == (1 if number < 9 else 10)
    second = RecordingWriter(tmp_path)
    second.add(frame(20))
    second.save()
    opened = open_dataset(tmp_path)
    assert len(opened.frames) == 11
    np.testing.assert_array_equal(opened.frames[10].read().rgb, frame(20).rgb)


def test_a_recording_that_is_closed_again_stays_as_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = RecordingWriter(tmp_path)
    for number in range(3):
        first.add(frame(number))
    first.save()
    files = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    RecordingWriter(tmp_path).keep_complete_frames()
    monkeypatch.setattr(recording, "write_atomic", full)
    RecordingWriter(tmp_path).keep_complete_frames()
    second = RecordingWriter(tmp_path)
    second.add(masked(3))
    second.keep_complete_frames()
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == files


def test_a_recording_without_frames_is_continued(tmp_path: Path) -> None:
    RecordingWriter(tmp_path).keep_complete_frames()
    second = RecordingWriter(tmp_path)
    second.add(frame(0))
    second.save()
    assert RecordingWriter(tmp_path).count == 1


def test_a_frame_of_another_camera_keeps_its_intrinsics(tmp_path: Path) -> None:
    wide = replace(frame(2), camera=camera_from_fov(8, 6, 1.4, frame(2).camera.world_from_camera))
    small = RgbdFrame(
        np.zeros((4, 6, 3), np.uint8),
        np.ones((4, 6), np.float32),
        camera_from_fov(6, 4, 1.0, frame(3).camera.world_from_camera),
    )
    first = RecordingWriter(tmp_path)
    first.add(frame(0))
    first.add(frame(1))
    first.save()
    second = RecordingWriter(tmp_path)
    frames = [frame(0), frame(1), wide, small, frame(4)]
    for each in frames[2:]:
        second.add(each)
    second.save()
    opened = open_dataset(tmp_path).frames
    assert len(opened) == len(frames)
    for entry, each in zip(opened, frames, strict=True):
        camera = entry.read().camera
        for name in ("width", "height", "fx", "fy", "cx", "cy"):
            assert getattr(camera, name) == getattr(each.camera, name)


def labelled(number: int, *types: str) -> RgbdFrame:
    """Return a frame that shows its objects side by side, the last one leftmost."""
    plain = frame(number)
    instances = np.full((6, 8), -1, np.int32)
    instances[:, : len(types)] = np.arange(len(types))[:8][::-1]
    return replace(plain, labels=Labels(instances, types))


def shown(folder: Path, number: int, count: int) -> list[str]:
    """Return the types of the objects of a frame, the first one first."""
    labels = open_dataset(folder).frames[number].read().labels
    assert labels is not None
    assert (labels.instances[:, count:] == -1).all()
    return [labels.types[row] for row in labels.instances[0, count - 1 :: -1]]


def test_names_of_objects_may_change_with_each_frame(tmp_path: Path) -> None:
    lists = [
        ("Mug",),
        ("Sofa", "Plant"),
        ("Plant", "Mug", "Plant"),
        ("Mug",),
        ("Door", "Plant", "Plant", "Plant"),
    ]
    for start, end in ((0, 3), (3, 5)):
        writer = RecordingWriter(tmp_path)
        for number in range(start, end):
            writer.add(labelled(number, *lists[number]))
        writer.save()
    for number, types in enumerate(lists):
        assert shown(tmp_path, number, len(types)) == list(types)
    listed = [each["objectType"] for each in json.loads((tmp_path / "objects.json").read_text())]
    assert listed == ["Mug", "Sofa", "Plant", "Plant", "Door", "Plant"]


def test_facts_about_objects_stay_in_their_list(tmp_path: Path) -> None:
    known = [{"objectType": "Mug", "objectId": "Mug|1"}, {"objectType": "Mug", "objectId": "Mug|2"}]
    writer = RecordingWriter(tmp_path)
    (tmp_path / "objects.json").write_text(json.dumps(known))
    writer.add(labelled(0, "Mug", "Mug", "Sofa"))
    assert json.loads((tmp_path / "objects.json").read_text()) == [*known, {"objectType": "Sofa"}]


def test_objects_that_cannot_be_listed_are_rejected(tmp_path: Path) -> None:
    writer, listed = RecordingWriter(tmp_path), tmp_path / "objects.json"
    listed.write_text("[{}]")
    with pytest.raises(ValueError, match=r"objects\.json: object 0 has no objectType"):
        writer.add(labelled(0, "Mug"))
    listed.unlink()
    with pytest.raises(ValueError, match="70000 objects, at most 65535 fit into 16 bits"):
        writer.add(labelled(0, *["Mug"] * 70_000))
    writer.add(replace(frame(0), labels=None))
    assert writer.count == 1
    assert not listed.exists()


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("camera_model", "OPENCV_FISHEYE"),
        ("k1", 0.1),
        ("is_fisheye", True),
        ("depth_unit_scale_factor", 0.0002),
    ],
)
def test_a_list_of_other_images_is_not_continued(tmp_path: Path, key: str, value: object) -> None:
    (tmp_path / "transforms.json").write_text(json.dumps({key: value, "frames": []}))
    with pytest.raises(ValueError, match=rf"transforms.json: it is no recording of gslts: {key} "):
        RecordingWriter(tmp_path)


def test_other_folders_are_rejected(tmp_path: Path) -> None:
    (tmp_path / "letter.txt").write_text("dear")
    with pytest.raises(ValueError, match="it is not empty, and no recording"):
        RecordingWriter(tmp_path)
    (tmp_path / "letter.txt").rename(tmp_path / "transforms.json")
    for text in ("dear", "[" * 100_000, '"frames"'):
        (tmp_path / "transforms.json").write_text(text)
        with pytest.raises(ValueError, match=r"transforms.json: it is no list of frames"):
            RecordingWriter(tmp_path)
