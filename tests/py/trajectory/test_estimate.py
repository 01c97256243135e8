"""Estimation of the poses of a recording from its images."""

import weakref
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import pytest
import turn

import gslts.trajectory.completion
import gslts.trajectory.odometry
from gslts._core import reloc
from gslts.core.camera import Camera, at_pose, camera_from_fov
from gslts.core.frame import RgbdFrame
from gslts.core.se3 import pose_distance, product, relative, rotation
from gslts.datasets import Dataset
from gslts.datasets.poses import inverse
from gslts.trajectory.completion import place_rest
from gslts.trajectory.estimate import estimate_poses
from gslts.trajectory.features import FrameFeatures
from gslts.trajectory.odometry import KeyframeOdometry
from gslts.trajectory.pose_graph import Edge, optimize_poses
from gslts.trajectory.registration import Motion

pytest.importorskip("open3d", reason="the extra poses is not installed")

DRIFT = np.eye(4)
DRIFT[:2, 3] = 0.01, 0.005
DRIFT[:3, :3] = rotation(np.array([0, 0, 0.01]))
"""Error of each step of a drifting odometry: 0.6 degrees and 11 mm."""
BESIDE = np.eye(4)
BESIDE[0, 3] = 0.02
"""Pose of a depth camera beside the colour camera."""


@dataclass(frozen=True, eq=False)
class KeptFrame:
    """A frame in memory."""

    name: str
    frame: RgbdFrame

    @property
    def camera(self) -> Camera:
        return self.frame.camera

    def read(self) -> RgbdFrame:
        return self.frame


class BrokenFrame:
    """A frame whose file is damaged."""

    name = "broken"

    def read(self) -> RgbdFrame:
        raise ValueError("damaged.png: not an image")


@pytest.fixture(scope="module")
def recording() -> Dataset:
    return dataset_of(turn.frames())


def dataset_of(frames: list[RgbdFrame]) -> Dataset:
    return Dataset("turn", tuple(KeptFrame(f"{k:03}", frame) for k, frame in enumerate(frames)))


def at_poses(dataset: Dataset, poses: np.ndarray) -> Dataset:
    """Return a recording that gives other poses [F,4,4]."""
    frames = [frame.read() for frame in dataset.frames]
    return dataset_of(
        [
            replace(frame, camera=at_pose(frame.camera, pose))
            for frame, pose in zip(frames, poses, strict=True)
        ]
    )


def poses_of(dataset: Dataset) -> np.ndarray:
    return np.array([frame.camera.world_from_camera for frame in dataset.frames])


def errors_of(found: Dataset, true: Dataset) -> tuple[np.ndarray, np.ndarray]:
    """Return errors of the poses relative to the first one, m and rad."""
    given = {frame.name: frame.camera.world_from_camera for frame in true.frames}
    names = [frame.name for frame in found.frames]
    poses = poses_of(found)
    pairs = [
        pose_distance(relative(poses[0], pose), relative(given[names[0]], given[name]))
        for pose, name in zip(poses, names, strict=True)
    ]
    metres, turns_rad = np.array(pairs).T
    return metres, turns_rad


def test_poses(recording):
    found = estimate_poses(recording)
    assert found.unplaced == ()
    assert [f.name for f in found.dataset.frames] == [f.name for f in recording.frames]
    metres, turns_rad = errors_of(found.dataset, recording)
    assert np.median(metres) < 0.005
    assert np.median(turns_rad) < np.deg2rad(0.15)
    assert metres.max() < 0.02
    assert turns_rad.max() < np.deg2rad(0.5)
    assert 5 < found.keyframes < 30
    assert found.loops > 5


def test_world_has_z_up_and_begins_at_the_first_camera(recording):
    poses = poses_of(estimate_poses(recording).dataset)
    np.testing.assert_allclose(poses[0][:3, 3], 0, atol=1e-9)
    assert poses[0][0, 2] > 0.9
    assert abs(poses[0][1, 2]) < 1e-6
    true = poses_of(recording)
    up = poses[0][:3, :3] @ true[0][:3, :3].T @ (0, 0, 1)
    assert np.arccos(up[2]) < np.deg2rad(0.3)


def test_few_indices_are_kept(recording, monkeypatch):
    """An index takes more memory than the rest of a keyframe."""
    make, built, most = reloc.LandmarkIndex, [], 0

    def counted(*arguments: np.ndarray) -> reloc.LandmarkIndex:
        nonlocal most
        index = make(*arguments)
        built.append(weakref.ref(index))
        most = max(most, sum(known() is not None for known in built))
        return index

    monkeypatch.setattr(reloc, "LandmarkIndex", counted)
    found = estimate_poses(recording, threads=1)
    assert found.keyframes > 12
    assert most <= 4
    assert len(built) < 2.5 * found.keyframes


@pytest.mark.parametrize(("width", "height", "points"), [(640, 480, 19200), (1920, 1080, 32400)])
def test_clouds_of_large_images_are_bounded(width, height, points):
    shape = (height, width)
    frame = RgbdFrame(
        np.zeros((*shape, 3), np.uint8),
        np.full(shape, 2, np.float32),
        camera_from_fov(width, height, 1.2),
    )
    features = FrameFeatures.of(frame)
    assert len(features.cloud) == features.seen_m.size == points


def test_given_poses_are_not_used(recording):
    moved = at_poses(recording, poses_of(recording)[::-1])
    found, again = (estimate_poses(dataset).dataset for dataset in (recording, moved))
    np.testing.assert_array_equal(poses_of(found), poses_of(again))


def test_frames_keep_their_images(recording):
    frame = recording.frames[5].read()
    depth_camera = at_pose(frame.camera, product(frame.camera.world_from_camera, BESIDE))
    frames = [other.read() for other in recording.frames]
    frames[5] = replace(frame, depth_camera=depth_camera)
    found = estimate_poses(dataset_of(frames)).dataset.frames[5]
    read = found.read()
    assert found.name == "005"
    np.testing.assert_array_equal(read.rgb, frame.rgb)
    np.testing.assert_array_equal(read.camera.world_from_camera, found.camera.world_from_camera)
    beside = relative(read.camera.world_from_camera, read.depth_camera.world_from_camera)
    np.testing.assert_allclose(beside, BESIDE, atol=1e-9)


def test_drift_of_the_given_poses_is_corrected(recording):
    true = poses_of(recording)
    given = [np.array(true[0])]
    for before, after in pairwise(true):
        given.append(product(given[-1], product(relative(before, after), DRIFT)))
    drifting = at_poses(recording, np.array(given))
    before, _ = errors_of(drifting, recording)
    found = estimate_poses(drifting, correct=True).dataset
    after, turns_rad = errors_of(found, recording)
    assert before.max() > 0.1
    assert after.max() < 0.02
    assert turns_rad.max() < np.deg2rad(0.5)
    np.testing.assert_allclose(poses_of(found)[0], given[0], atol=1e-9)


def test_given_poses_serve_where_images_tell_nothing(recording):
    frames = [frame.read() for frame in recording.frames]
    for k in range(10, 14):
        frames[k] = replace(frames[k], depth=np.zeros_like(frames[k].depth))
    dark = dataset_of(frames)
    found = estimate_poses(dark, correct=True)
    assert found.unplaced == ()
    metres, _ = errors_of(found.dataset, recording)
    assert metres.max() < 0.02
    without = estimate_poses(dark)
    assert [reason.split(":")[0] for reason in without.unplaced] == ["010", "011", "012", "013"]


def moved(x_m: float) -> np.ndarray:
    motion = np.eye(4)
    motion[0, 3] = x_m
    return motion


def odometry_of(recording: Dataset, given: np.ndarray) -> KeyframeOdometry:
    """Return the odometry of two keyframes at given poses [2,4,4]."""
    odometry = KeyframeOdometry()
    for frame, pose in zip(recording.frames[:3:2], given, strict=True):
        odometry.add(frame.name, FrameFeatures.of(frame.read()), pose)
    assert len(odometry.keyframes) == 2
    return odometry


def test_given_poses_choose_between_motions_that_images_allow(recording, monkeypatch):
    """Keypoints of a repeated pattern match 0.4 m beside the true position."""
    first, second = poses_of(recording)[:3:2]
    true = relative(first, second)
    wrong = Motion(product(moved(0.4), true), 1000 * np.eye(6), 0.9)
    monkeypatch.setattr(gslts.trajectory.odometry, "register_frames", lambda *_: wrong)
    (edge,) = odometry_of(recording, np.array([first, second])).edges
    metres, turn_rad = pose_distance(edge.motion.target_from_source, true)
    assert metres < 0.02
    assert turn_rad < np.deg2rad(0.5)
    assert edge.is_certain


def test_a_motion_that_contradicts_the_given_poses_is_doubted(recording):
    first, second = poses_of(recording)[:3:2]
    for jump_m, is_certain in ((0.0, True), (0.5, False)):
        given = np.array([first, product(moved(jump_m), second)])
        (edge,) = odometry_of(recording, given).edges
        assert edge.is_certain == is_certain
        metres, _ = pose_distance(edge.motion.target_from_source, relative(first, second))
        assert metres < 0.02


def test_a_jump_of_the_given_poses_is_corrected(recording):
    given = poses_of(recording)
    given[10:] = moved(0.5) @ given[10:]
    found = estimate_poses(at_poses(recording, given), correct=True)
    assert found.unplaced == ()
    metres, _ = errors_of(found.dataset, recording)
    assert metres.max() < 0.02


def test_frames_of_another_place_are_named(recording):
    turned = [frame.read() for frame in recording.frames]
    found = estimate_poses(dataset_of([*turned, turn.frame_elsewhere()]))
    assert found.unplaced == ("030: no other frame surely shows the same place",)
    assert len(found.dataset.frames) == 30


def test_a_frame_that_cannot_be_read_is_named(recording):
    broken = replace(recording, frames=(*recording.frames[:20], BrokenFrame()))
    assert estimate_poses(broken).unplaced == ("broken: damaged.png: not an image",)


def test_without_depth_no_pose_is_estimated(recording):
    frames = [frame.read() for frame in recording.frames[:4]]
    dark = [replace(frame, depth=np.zeros_like(frame.depth)) for frame in frames]
    with pytest.raises(ValueError, match=r"turn: no two frames show the same place.*record depth"):
        estimate_poses(dataset_of(dark))


def test_loop_closures_that_contradict_are_pruned():
    """A ring of nodes, and a false loop closure."""
    step = np.eye(4)
    step[0, 3] = 1.0
    motion = Motion(step, 1000 * np.eye(6), 0.9)
    edges = [Edge(k, k + 1, Motion(inverse(step), motion.information, 0.9)) for k in range(9)]
    far = np.eye(4)
    far[1, 3] = 3.0
    edges += [Edge(9, 0, Motion(far, motion.information, 0.9))]
    edges += [
        Edge(k + 2, k, Motion(product(step, step), motion.information, 0.9)) for k in range(8)
    ]
    poses = optimize_poses(10, edges)
    positions = np.array([poses[k][:3, 3] for k in range(10)])
    np.testing.assert_allclose(positions, np.outer(np.arange(10), (1, 0, 0)), atol=1e-3)


def test_largest_connected_part_is_placed():
    motion = Motion(np.eye(4), 1000 * np.eye(6), 0.9)
    edges = [Edge(1, 0, motion, True), Edge(3, 2, motion, True), Edge(4, 3, motion, True)]
    assert sorted(optimize_poses(6, edges)) == [2, 3, 4]
    assert sorted(optimize_poses(1, [])) == [0]
    assert optimize_poses(0, []) == {}


def test_motions_that_may_be_wrong_need_a_third_frame():
    motion = Motion(np.eye(4), 1000 * np.eye(6), 0.9)
    edges = [Edge(1, 0, motion, True), Edge(2, 1, motion, True), Edge(3, 0, motion)]
    assert sorted(optimize_poses(4, edges)) == [0, 1, 2]
    edges.append(Edge(3, 1, motion))
    assert sorted(optimize_poses(4, edges)) == [0, 1, 2, 3]


def test_a_keyframe_that_one_motion_connects_is_placed_where_it_fits(recording):
    keyframes = [FrameFeatures.of(frame.read()) for frame in recording.frames[:8]]
    true = poses_of(recording)[:8]
    placed = {k: pose for k, pose in enumerate(true) if k != 4}
    right = Edge(4, 3, Motion(relative(true[3], true[4]), 1000 * np.eye(6), 0.8))
    np.testing.assert_allclose(place_rest(placed, [right], keyframes)[4], true[4], atol=1e-9)
    turned = np.eye(4)
    turned[:3, :3] = rotation(np.array([0, np.deg2rad(40), 0]))
    wrong = Edge(4, 3, Motion(product(turned, relative(true[3], true[4])), 1000 * np.eye(6), 0.8))
    assert 4 not in place_rest(placed, [wrong], keyframes)
    assert 4 not in place_rest({3: true[3]}, [right], keyframes), "one frame is no witness"
    back = Edge(3, 4, Motion(relative(true[4], true[3]), 1000 * np.eye(6), 0.8))
    np.testing.assert_allclose(place_rest(placed, [back], keyframes)[4], true[4], atol=1e-9)


def edges_of_chains(count: int) -> list[Edge]:
    """Return motions of two chains of N frames, false ones, and last a motion that joins both."""
    motion = Motion(np.eye(4), np.eye(6), 0.5)
    away = np.eye(4)
    away[2, 3] = -1
    edges = [Edge(k, k - 1, motion, True) for k in (*range(1, count), *range(count + 1, 2 * count))]
    edges += [Edge(2 * count + k, 0, Motion(away, np.eye(6), 0.5)) for k in range(count // 4)]
    return [*edges, Edge(2 * count - 1, 0, motion)]


def test_each_doubtful_pose_is_compared_with_each_frame_once(monkeypatch):
    compared: list[tuple[int, int]] = []

    def count_seen(source, target, motion):
        compared.append((source, target))
        return (0, 1000) if abs(motion[2, 3]) < 0.5 else (500, 1000)

    monkeypatch.setattr(gslts.trajectory.completion, "count_seen", count_seen)
    for count in (8, 16):
        compared.clear()
        placed = place_rest({k: np.eye(4) for k in range(count)}, edges_of_chains(count), range(99))
        assert sorted(placed) == list(range(2 * count))
        assert len(compared) == len(set(compared))
