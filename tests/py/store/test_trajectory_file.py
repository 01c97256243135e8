"""Poses of recordings in the frame of a map: those of the map's own recording only."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scenes
from lpips_files import write_nerfstudio

from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.datasets import Dataset, open_dataset
from gslts.datasets.posed import with_poses
from gslts.mapping.evaluation.held_out import TrainingRecord
from gslts.rendering.rasterizer import render
from gslts.store.fingerprints import fingerprint, is_recording_of
from gslts.store.map_folder import write_map_folder
from gslts.store.trajectory_file import TRAJECTORY, open_recording, write_trajectory

FRAMES = 10
SHIFT_M = 5.0


def record(folder: Path, start_rad: float = 0.0) -> Dataset:
    """Write a recording along an orbit; all have the same names of frames, and one camera."""
    gaussian_map = scenes.random_map(300, dtype=np.float32)
    frames = []
    for angle_rad in start_rad + 0.1 * np.arange(FRAMES):
        camera = scenes.orbit_camera(80, 60, angle_rad=angle_rad)
        rgb = np.rint(255 * render(gaussian_map, camera).rgb.clip(0, 1)).astype(np.uint8)
        frames.append(RgbdFrame(rgb, np.zeros((60, 80), np.float32), camera))
    write_nerfstudio(folder, frames)
    return open_dataset(folder)


def shifted(dataset: Dataset) -> Dataset:
    """Return a recording in the world of a map whose poses were estimated."""
    poses = {frame.name: frame.camera.world_from_camera.copy() for frame in dataset.frames}
    for pose in poses.values():
        pose[0, 3] += SHIFT_M
    return with_poses(dataset, poses)


def write_map(folder: Path, dataset: Dataset, *, old: bool = False) -> None:
    """Write a map of a recording at estimated poses; an old one has no fingerprints."""
    placed = shifted(dataset)
    fingerprints = {frame.name: fingerprint(frame.read().rgb) for frame in dataset.frames}
    manifest = {
        "dataset": dataset.name,
        "validation_frames": [dataset.frames[8].name],
        **({} if old else {"fingerprints": fingerprints}),
    }
    cameras = {frame.name: frame.camera for k, frame in enumerate(placed.frames) if k % 8}
    write_map_folder(folder, small_map(), manifest, cameras)
    write_trajectory(folder / TRAJECTORY, placed)


def small_map() -> GaussianMap:
    gaussian_map = scenes.random_map(5, dtype=np.float32)
    return replace(gaussian_map, ids=np.arange(5, dtype=np.uint64))


def shift_m(opened: Dataset, dataset: Dataset) -> float:
    """Return how far the poses of a recording lie from its own."""
    steps = [
        frame.camera.world_from_camera[0, 3] - own.camera.world_from_camera[0, 3]
        for frame, own in zip(opened.frames, dataset.frames, strict=True)
    ]
    assert np.ptp(steps) < 1e-9
    return float(np.mean(steps))


@pytest.fixture
def paths(tmp_path: Path) -> tuple[Path, Path]:
    """Return the folders of a map and of its recording."""
    dataset = record(tmp_path / "monday")
    write_map(tmp_path / "map", dataset)
    return tmp_path / "map", tmp_path / "monday"


def test_another_recording_with_the_same_names_keeps_its_poses(paths, tmp_path):
    gaussian_map, _ = paths
    (tmp_path / "elsewhere").mkdir()
    for name in ("tuesday", "elsewhere/monday"):
        other = record(tmp_path / name, start_rad=0.5)
        assert not is_recording_of(gaussian_map, other)
        assert shift_m(open_recording(gaussian_map, tmp_path / name), other) == 0
        known = TrainingRecord.read(gaussian_map, other)
        assert known.cameras == {}
        assert known.choose_test([frame.name for frame in other.frames]) == [0, 8]
        pose = known.observe(other.frames[1]).world_from_camera
        np.testing.assert_allclose(pose, other.frames[1].camera.world_from_camera, atol=1e-9)


def test_the_recording_of_a_map_is_known_by_its_images(paths, tmp_path):
    gaussian_map, monday = paths
    dataset = open_dataset(monday)
    names = [frame.name for frame in dataset.frames]
    known = TrainingRecord.read(gaussian_map, open_recording(gaussian_map, monday))
    assert list(known.cameras) == names[1:8] + names[9:]
    assert known.split(names) == ([8], [0])
    monday.rename(tmp_path / "moved")
    opened = open_recording(gaussian_map, tmp_path / "moved")
    assert shift_m(opened, dataset) == pytest.approx(SHIFT_M)
    assert TrainingRecord.read(gaussian_map, opened).cameras.keys() == known.cameras.keys()


def test_a_part_of_a_recording_is_known_and_so_is_a_damaged_one(paths):
    gaussian_map, monday = paths
    path = monday / "transforms.json"
    content = json.loads(path.read_text())
    content["frames"] = content["frames"][4:]
    for frame in content["frames"]:
        del frame["transform_matrix"]  # As of a recording whose poses were estimated.
    path.write_text(json.dumps(content))
    for name in ("4.png", "5.png"):
        (monday / name).write_bytes((monday / name).read_bytes()[:200])
    opened = open_recording(gaussian_map, monday)
    assert len(opened.frames) == FRAMES - 4
    assert opened.frames[0].camera.world_from_camera[0, 3] > 3


def test_equal_first_frames_do_not_make_a_recording_that_of_the_map(paths, tmp_path):
    """A robot that starts at its dock sees the same there each day."""
    gaussian_map, monday = paths
    other = record(tmp_path / "tuesday", start_rad=0.5)
    for name in ("0.png", "1.png", "2.png"):
        shutil.copy(monday / name, tmp_path / "tuesday" / name)
    assert not is_recording_of(gaussian_map, other)


def test_maps_without_fingerprints_go_by_the_name_of_the_data_set(tmp_path):
    dataset = record(tmp_path / "monday")
    write_map(tmp_path / "map", dataset, old=True)
    assert is_recording_of(tmp_path / "map", dataset)
    assert not is_recording_of(tmp_path / "map", replace(dataset, name="tuesday"))
    opened = open_recording(tmp_path / "map", tmp_path / "monday")
    assert shift_m(opened, dataset) == pytest.approx(SHIFT_M)


def test_plain_files_have_no_recording(paths, tmp_path):
    dataset = open_dataset(paths[1])
    assert not is_recording_of(tmp_path / "room.ply", dataset)


@pytest.mark.parametrize("value", [[], {"0.png": 3}, {"0.png": "zz"}, {"0.png": "00"}])
def test_damaged_fingerprints_are_named(paths, value):
    gaussian_map, monday = paths
    path = gaussian_map / "manifest.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"fingerprints": value}))
    with pytest.raises(ValueError, match=r"map: fingerprints of the manifest: "):
        open_recording(gaussian_map, monday)


def test_fingerprints_bear_rounding_and_no_other_exposure():
    rng = np.random.default_rng(0)
    rgb = rng.integers(40, 200, (60, 80, 3)).astype(np.uint8)
    noise = rng.integers(-1, 2, rgb.shape)
    assert len(fingerprint(rgb)) == 96
    small = fingerprint((rgb + noise).astype(np.uint8))
    differences = np.subtract(list(bytes.fromhex(small)), list(bytes.fromhex(fingerprint(rgb))))
    assert np.abs(differences).max() <= 1
    brighter = np.array(list(bytes.fromhex(fingerprint((1.05 * rgb).astype(np.uint8)))))
    assert (brighter - list(bytes.fromhex(fingerprint(rgb))) > 2).all()
