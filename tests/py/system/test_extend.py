"""Extension of a map of one half of a room by a recording of the other."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import change_room
import half_room
import numpy as np
import pytest
from change_room import YELLOW
from command import gslts as run

from gslts.core.gaussian_map import GaussianMap
from gslts.core.se3 import pose_distance, product
from gslts.datasets import open_dataset
from gslts.extension import placement
from gslts.extension.pipeline import MapExtension, extend_map
from gslts.localization.relocalizer import Relocalizer
from gslts.mapping.evaluation.evaluate import evaluate, refine_pose
from gslts.mapping.evaluation.held_out import TrainingRecord
from gslts.mapping.observation import Observation
from gslts.store.causes import ExtensionCause
from gslts.store.map_folder import open_map, read_map
from gslts.store.measurement_files import read_measurements
from gslts.store.trajectory_file import extension_by, open_recording

MOVED = np.eye(4)
MOVED[0, 3] = 1.0
TURN_RAD = 0.7
MOTION = np.array(
    [
        [np.cos(TURN_RAD), -np.sin(TURN_RAD), 0, 3.0],
        [np.sin(TURN_RAD), np.cos(TURN_RAD), 0, -2.0],
        [0, 0, 1, 0.2],
        [0, 0, 0, 1.0],
    ]
)
"""From the world of the map to another one."""


@pytest.fixture(scope="module")
def extended(tmp_path_factory):
    """Return the folder of the map, the recording and the outcome."""
    folder = tmp_path_factory.mktemp("extended")
    path, visit = half_room.map_of_half(folder / "map"), half_room.recording(folder / "far_half")
    return path, visit, extend_map(path, open_dataset(visit), half_room.CONFIG)


def first_version(path: Path) -> GaussianMap:
    """Return the map before the extension."""
    return read_map(path.with_name(f"{path.name}@1"))


def psnr_db(gaussian_map: GaussianMap, visit: Path, names: tuple[str, ...]) -> float:
    """Return the PSNR of some frames of a recording."""
    wanted = [frame for frame in open_dataset(visit).frames if frame.name in names]
    frames = [Observation.of(frame.read()) for frame in wanted]
    return evaluate(gaussian_map, [refine_pose(gaussian_map, frame) for frame in frames]).psnr_db


def test_new_space_is_shown(extended):
    path, visit, outcome = extended
    assert outcome.version.number == 2
    names = outcome.version.cause.test_frames
    before, after = (psnr_db(m, visit, names) for m in (first_version(path), read_map(path)))
    assert after > before + 2
    assert outcome.record.test_psnr_db == pytest.approx(after, abs=0.5)


def test_what_the_map_knew_stays_bit_by_bit(extended):
    path, _, outcome = extended
    old, new = first_version(path), read_map(path)
    rows = np.searchsorted(new.ids, old.ids)
    kept = new.ids[np.minimum(rows, new.size - 1)] == old.ids
    same = kept.copy()
    for name in ("means", "quats", "log_scales", "logit_opacities", "sh"):
        equal = getattr(old, name)[kept] == getattr(new, name)[rows[kept]]
        same[kept] &= equal.reshape(len(equal), -1).all(axis=1)
    assert (~same).sum() <= outcome.record.refined
    assert same.mean() > 0.5


def test_new_space_is_measured(extended):
    """Its Gaussians have errors, and what its frames measured does not count as new any more."""
    path, _, outcome = extended
    first, both = (read_measurements(Path(f"{path}@{number}")) for number in (1, 2))
    new = both.ids[len(first.ids) :]
    gaussian_map = read_map(path)
    added = gaussian_map.ids[gaussian_map.ids > first.ids.max()]
    np.testing.assert_array_equal(new, np.sort(added))
    assert both.is_measured[len(first.ids) :].mean() > 0.8
    assert np.isfinite(both.errors[len(first.ids) :]).mean() > 0.8
    cameras = both.depths.cameras[len(first.depths.cameras) :]
    assert len(cameras) == len(outcome.version.cause.frames)
    points = gaussian_map.means[gaussian_map.ids > first.ids.max()] + gaussian_map.origin
    before, after = (m.depths.counts(points).on >= 2 for m in (first, both))
    assert after.mean() > before.mean() + 0.3


def test_cameras_landmarks_and_cause_are_stored(extended):
    path, visit, outcome = extended
    with open_map(path) as store:
        cause = store.version().cause
        assert store.find_problems() == []
    assert isinstance(cause, ExtensionCause)
    assert cause.dataset == visit.name
    assert cause.landmarks is not None
    held_out = outcome.record.new - len(cause.frames)
    assert len(cause.names) == len(cause.frames)
    assert len(cause.test_frames) in (held_out // 2, held_out - held_out // 2)


def test_test_frames_of_an_extension_are_evaluated(extended, tmp_path):
    """Whatever the world of the recording: the frames are at their poses in the map."""
    path, visit, outcome = extended
    done = run("eval", str(path), str(visit), "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    quality = json.loads(done.stdout)
    cause = outcome.version.cause
    assert quality["refined"]["frames"] == len(cause.test_frames)
    assert quality["refined"]["psnr_db"] == pytest.approx(outcome.record.test_psnr_db, abs=0.3)
    assert quality["given"]["psnr_db"] > outcome.record.test_psnr_db - 3
    record = TrainingRecord.read(path, open_dataset(visit))
    assert set(record.cameras) == set(cause.names)
    assert open_recording(path, visit).frames[0].name in {*cause.names, *cause.test_frames}
    assert extension_by(path, "another") is None


def test_second_time_nothing_is_new(extended, tmp_path):
    path, visit, _ = extended
    copy = shutil.copytree(path, tmp_path / "map")
    again = extend_map(copy, open_dataset(visit), half_room.CONFIG)
    assert again.record is None
    assert again.version.number == 2


def placement_errors(outcome: MapExtension, truth: dict[str, np.ndarray]) -> np.ndarray:
    """Return [F,2] errors of the poses of the placed frames, m and rad."""
    placed = outcome.placement.frames
    return np.array([pose_distance(placed[name].given_pose, truth[name]) for name in placed])


def test_recording_in_another_world_that_drifts(tmp_path):
    path, visit = half_room.map_of_half(tmp_path / "map"), half_room.recording(tmp_path / "visit")
    truth = half_room.true_poses(visit)
    drift = np.eye(4)
    drift[:2, 3] = 0.002, -0.001  # m a frame

    def move(poses):
        moved, drifted = [], np.eye(4)
        for pose in poses:
            moved.append(product(MOTION, product(drifted, pose)))
            drifted = product(drifted, drift)
        return moved

    outcome = extend_map(path, half_room.with_poses(visit, move), half_room.CONFIG)
    errors = placement_errors(outcome, truth)
    assert len(errors) == len(truth)
    assert np.median(errors[:, 0]) < 0.02
    assert errors[:, 0].max() < 0.1
    assert errors[:, 1].max() < 0.03
    assert outcome.version.number == 2


def test_frames_beyond_a_jump_are_named(tmp_path):
    path, visit = half_room.map_of_half(tmp_path / "map"), half_room.recording(tmp_path / "visit")
    dataset = half_room.with_poses(visit, lambda poses: poses)
    known = extend_map(
        shutil.copytree(path, tmp_path / "other"), dataset, half_room.CONFIG
    ).placement
    names = list(known.frames)
    # Between two frames that the map places, frames that it does not: there the odometry jumps.
    ends = [names.index(name) for name in known.anchors]
    gap = next(k for k in range(ends[0], ends[-1]) if k not in ends)

    def jump(poses):
        poses[gap:, 0, 3] += 1.5
        return poses

    placement = extend_map(path, half_room.with_poses(visit, jump), half_room.CONFIG).placement
    assert any(reason.startswith(f"{names[gap]}: ") for reason in placement.unplaced)
    assert all("contradict" in reason for reason in placement.unplaced)


def shifted(poses):
    """Return poses of which every second one is a metre off."""
    poses[1::2, 0, 3] += 1.0
    return poses


def larger(poses):
    """Return poses of another scale."""
    poses[:, :3, 3] *= 1.3
    return poses


@pytest.mark.parametrize(
    ("change", "reason"),
    [(shifted, "are elsewhere than the poses of the recording say"), (larger, "1.3. times as far")],
)
def test_poses_that_contradict_the_map_are_rejected(tmp_path, change, reason):
    path, visit = half_room.map_of_half(tmp_path / "map"), half_room.recording(tmp_path / "visit")
    with pytest.raises(ValueError, match=reason):
        extend_map(path, half_room.with_poses(visit, change), half_room.CONFIG)
    with open_map(path) as store:
        assert store.version().number == 1


def test_frame_that_the_map_shows_elsewhere_is_named(tmp_path):
    path, visit = half_room.map_of_half(tmp_path / "map"), half_room.recording(tmp_path / "visit")
    dataset = half_room.with_poses(visit, lambda poses: poses)
    frames = {frame.name: Observation.of(frame.read()) for frame in dataset.frames}
    relocalizer = Relocalizer.of_map(path)
    wrong = placement.place_frames(frames, relocalizer).anchors[1]
    frames[wrong] = replace(
        frames[wrong], world_from_camera=frames[wrong].world_from_camera @ MOVED
    )
    placed = placement.place_frames(frames, relocalizer)
    assert wrong not in placed.frames
    assert placed.unplaced == (f"{wrong}: the map shows it elsewhere than its pose says",)


def test_known_space_alone_changes_nothing(tmp_path):
    path = half_room.map_of_half(tmp_path / "map")
    visit = half_room.known_recording(tmp_path / "visit")
    outcome = extend_map(path, open_dataset(visit), half_room.CONFIG)
    assert outcome.record is None
    assert outcome.version.number == 1


def test_another_scene_is_rejected_and_nothing_written(tmp_path):
    from gslts_sim import make_home
    from gslts_sim.capture import capture
    from gslts_sim.controller import Controller
    from gslts_sim.explore import explore

    path = half_room.map_of_half(tmp_path / "map")
    bedroom = make_home("bedroom", 3, detail=0.1)
    viewpoints, _ = explore(bedroom, 6)
    capture(Controller(bedroom, **change_room.SIZE), viewpoints, tmp_path / "visit")
    with pytest.raises(ValueError, match="another scene"):
        extend_map(path, open_dataset(tmp_path / "visit"), half_room.CONFIG)
    with open_map(path) as store:
        assert store.version().number == 1


def test_what_changed_meanwhile_is_named_and_not_added(tmp_path):
    path = half_room.map_of_half(tmp_path / "map", 3.4)
    box = change_room.thing("Box|3", 2.6, 1.7, YELLOW, "Block|1")
    home = change_room.home()
    visit = half_room.recording(tmp_path / "visit", replace(home, objects=(*home.objects, box)))
    outcome = extend_map(path, open_dataset(visit), half_room.CONFIG)
    assert outcome.changed
    before, after = first_version(path), read_map(path)
    new = after.select(after.ids > before.ids[-1])
    inside = (np.abs(new.means - [2.6, 1.7, 0.9]) < [0.11, 0.11, 0.14]).all(axis=1)
    assert not inside.any()


def test_frames_between_the_scouts_place_a_recording(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(placement, "MAX_SCOUTS", 2)
    path = half_room.map_of_half(tmp_path / "map")
    near = open_dataset(half_room.known_recording(tmp_path / "near")).frames[:4]
    far = open_dataset(half_room.recording(tmp_path / "far")).frames
    ahead = [frame.camera.world_from_camera[:3] @ [0, 0, 1.5, 1] for frame in far]
    last = far[int(np.argmax([x for x, _, _ in ahead]))]
    frames = {str(k): Observation.of(frame.read()) for k, frame in enumerate((*near, last))}
    placed = placement.place_frames(frames, Relocalizer.of_map(path))
    assert placed.anchors[:4] == ("0", "1", "2", "3")
    assert set(placed.frames) == set(frames)
