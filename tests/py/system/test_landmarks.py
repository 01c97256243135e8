"""Landmarks: their positions, keyframes and descriptors, and their duplicates."""

from dataclasses import replace

import change_room
import numpy as np
import pytest
from landmark_room import assert_same, found, frames
from store_maps import random_map

from gslts._core import reloc
from gslts.core.frame import RgbdFrame
from gslts.localization.constants import (
    DESCRIPTOR_RADIUS_PX,
    MAX_GAUSSIAN_DISTANCE_M,
    SAME_LANDMARK_BITS,
    SAME_LANDMARK_M,
)
from gslts.localization.landmark_extraction import extract_landmarks, gray_image
from gslts.localization.landmarks import Landmarks, concatenate, limit_size, remove_duplicates
from gslts_sim.physics import boxes_in_world

SPLIT_PX = change_room.SIZE["width"] // 2


def off_surfaces_m(points: np.ndarray) -> np.ndarray:
    """Return [P] distances to the nearest face of any box of the room, m."""
    off = []
    for thing in change_room.home().objects:
        boxes = boxes_in_world(thing)
        for center, half in zip(boxes.centers, boxes.halves, strict=True):
            beyond = np.abs(points - center) - half
            outside = np.linalg.norm(beyond.clip(0), axis=1)
            off.append(np.abs(outside + np.minimum(beyond.max(axis=1), 0)))
    return np.min(off, axis=0)


def pixels_of(landmarks: Landmarks, frame: RgbdFrame) -> np.ndarray:
    """Return [L,2] pixels of landmarks in an image."""
    camera, pose = frame.camera, frame.camera.world_from_camera
    x, y, z = ((landmarks.positions - pose[:3, 3]) @ pose[:3, :3]).T
    assert (z > 0).all()
    return np.column_stack([camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy])


def test_landmarks_are_on_the_surfaces() -> None:
    assert found().size > 1500
    off_m = off_surfaces_m(found().positions)
    assert np.median(off_m) < 0.012
    assert np.quantile(off_m, 0.95) < 0.03
    assert off_m.max() < 0.1


def test_each_landmark_is_a_keypoint_of_its_keyframe() -> None:
    poses = [frame.camera.world_from_camera for frame in frames()]
    for row, pose in enumerate(found().world_from_keyframe):
        (number,) = (k for k, known in enumerate(poses) if np.array_equal(known, pose))
        own = found().select(found().keyframes == row)
        rule = reloc.FeatureRule(count=4000)
        pixels, descriptors = reloc.features_of(gray_image(frames()[number].rgb), None, rule)
        apart_px = np.linalg.norm(pixels_of(own, frames()[number])[:, None] - pixels, axis=2)
        same = (own.descriptors[:, None] == descriptors).all(axis=2)
        assert ((apart_px < 0.01) & same).any(axis=1).mean() > 0.9


def test_each_landmark_is_near_its_gaussian() -> None:
    gaussian_map, _ = change_room.mapped()
    rows = np.searchsorted(gaussian_map.ids, found().gaussians)
    np.testing.assert_array_equal(gaussian_map.ids[rows], found().gaussians)
    apart_m = np.linalg.norm(gaussian_map.means[rows] - found().positions, axis=1)
    assert apart_m.max() < MAX_GAUSSIAN_DISTANCE_M + 1e-5


def test_landmarks_do_not_depend_on_the_number_of_threads() -> None:
    gaussian_map, _ = change_room.mapped()
    assert_same(extract_landmarks(gaussian_map, frames(), threads=2), found())


def test_frames_from_one_pose_are_one_keyframe() -> None:
    gaussian_map, _ = change_room.mapped()
    single = extract_landmarks(gaussian_map, frames()[:1], threads=1)
    assert_same(extract_landmarks(gaussian_map, frames()[:1] * 3, threads=1), single)
    assert len(single.world_from_keyframe) == 1


def test_depth_need_not_be_measured() -> None:
    blind = [replace(frame, depth=np.zeros_like(frame.depth)) for frame in frames()]
    landmarks = extract_landmarks(change_room.mapped()[0], blind, threads=1)
    assert landmarks.size > 0.5 * found().size
    assert np.quantile(off_surfaces_m(landmarks.positions), 0.95) < 0.03


def test_there_are_none_where_map_and_depth_disagree() -> None:
    frame = frames()[-1]
    depth = frame.depth.copy()
    depth[:, :SPLIT_PX] *= 1.2
    landmarks = extract_landmarks(change_room.mapped()[0], [replace(frame, depth=depth)], threads=1)
    assert landmarks.size > 20
    assert pixels_of(landmarks, frame)[:, 0].min() > SPLIT_PX - 0.01


def test_descriptors_do_not_reach_beyond_the_mask() -> None:
    frame = frames()[-1]
    mask = np.ones(frame.depth.shape, np.bool_)
    mask[:, :SPLIT_PX] = False
    seen = replace(frame, mask=mask)
    landmarks = extract_landmarks(change_room.mapped()[0], [seen], threads=1)
    assert landmarks.size > 20
    assert pixels_of(landmarks, frame)[:, 0].min() > SPLIT_PX + DESCRIPTOR_RADIUS_PX - 1
    wanted = extract_landmarks(change_room.mapped()[0], [frame], [mask], threads=1)
    assert -0.01 < pixels_of(wanted, frame)[:, 0].min() - SPLIT_PX < DESCRIPTOR_RADIUS_PX


def test_no_frames_give_no_landmarks() -> None:
    gaussian_map, _ = change_room.mapped()
    grey = replace(frames()[0], rgb=np.full_like(frames()[0].rgb, 90))
    for none in ([], [grey]):
        landmarks = extract_landmarks(gaussian_map, none, threads=1)
        assert landmarks.size == len(landmarks.world_from_keyframe) == 0
    assert concatenate([]).size == 0


def test_the_size_is_limited_evenly_over_keyframes() -> None:
    gaussian_map, _ = change_room.mapped()
    for most in (found().nbytes // 2, 20_000):
        fewer = extract_landmarks(gaussian_map, frames(), max_bytes=most, threads=1)
        assert 0.8 * most < fewer.nbytes <= most
        share = fewer.size / found().size
        for pose, count in zip(
            found().world_from_keyframe, np.bincount(found().keyframes), strict=True
        ):
            (row,) = np.flatnonzero((fewer.world_from_keyframe == pose).all(axis=(1, 2)))
            assert abs((fewer.keyframes == row).sum() - share * count) < 2
    assert limit_size(found(), found().nbytes) is found()
    assert limit_size(found(), 0).size == 0


def flipped(landmarks: Landmarks, bits: int, shift_m: float) -> Landmarks:
    """Return the same landmarks with a few other bits and positions."""
    flipped_bits = np.unpackbits(landmarks.descriptors, axis=1)
    flipped_bits[:, :bits] ^= 1
    positions = landmarks.positions + np.float32([0, 0, shift_m])
    return replace(landmarks, positions=positions, descriptors=np.packbits(flipped_bits, axis=1))


def test_duplicates_are_removed() -> None:
    assert remove_duplicates(found()).size == found().size
    again = flipped(found(), SAME_LANDMARK_BITS - 1, 0.9 * SAME_LANDMARK_M)
    assert_same(remove_duplicates(concatenate([found(), again])), found())
    for other in (
        flipped(found(), SAME_LANDMARK_BITS, 0.0),
        flipped(found(), 0, 1.1 * SAME_LANDMARK_M),
    ):
        assert remove_duplicates(concatenate([found(), other])).size > 1.8 * found().size


def test_duplicates_are_those_of_all_pairs() -> None:
    rng = np.random.default_rng(0)
    positions = rng.uniform(-0.05, 0.05, (400, 3)).astype(np.float32)
    bits = rng.integers(0, 2, (3, 256))[rng.integers(0, 3, 400)] ^ (rng.random((400, 256)) < 0.055)
    landmarks = Landmarks(
        positions,
        np.packbits(bits.astype(np.uint8), axis=1),
        np.zeros(400, np.int32),
        np.eye(4)[None],
        np.arange(400, dtype=np.uint64),
    )
    kept: list[int] = []
    for k in range(400):
        near = np.linalg.norm(positions[kept] - positions[k], axis=1) < SAME_LANDMARK_M
        if not (near & ((bits[kept] != bits[k]).sum(axis=1) < SAME_LANDMARK_BITS)).any():
            kept.append(k)
    assert 150 < len(kept) < 390
    assert_same(remove_duplicates(landmarks), landmarks.select(np.array(kept)))


def landmarks_seen(times: int) -> Landmarks:
    """Return 60 landmarks, each seen from so many keyframes; some have few duplicates."""
    rng = np.random.default_rng(1)
    positions = np.tile(rng.uniform(0, 1, (60, 3)), (times, 1)) + rng.normal(
        0, 0.15 * SAME_LANDMARK_M, (60 * times, 3)
    )
    bits = np.tile(rng.integers(0, 2, (60, 256)), (times, 1))
    bits ^= rng.random(bits.shape) < 0.04
    return Landmarks(
        positions.astype(np.float32),
        np.packbits(bits.astype(np.uint8), axis=1),
        np.repeat(np.arange(times, dtype=np.int32), 60),
        np.tile(np.eye(4), (times, 1, 1)),
        np.arange(60 * times, dtype=np.uint64),
    )


def test_the_search_for_duplicates_is_not_quadratic(monkeypatch: pytest.MonkeyPatch) -> None:
    count, pairs = np.bitwise_count, 0

    def counted(words: np.ndarray) -> np.ndarray:
        nonlocal pairs
        pairs += len(words)
        return count(words)

    monkeypatch.setattr(np, "bitwise_count", counted)
    costs = []
    for times in (60, 120, 240):
        pairs = 0
        assert 60 <= remove_duplicates(landmarks_seen(times)).size < 0.2 * 60 * times
        costs.append(pairs)
    assert costs[1] < 3 * costs[0]
    assert costs[2] < 3 * costs[1]


def test_first_duplicates_are_kept_of_many_landmarks() -> None:
    landmarks = landmarks_seen(40)
    bits = np.unpackbits(landmarks.descriptors, axis=1)
    kept: list[int] = []
    for k in range(landmarks.size):
        apart_m = np.linalg.norm(landmarks.positions[kept] - landmarks.positions[k], axis=1)
        near = np.array(kept, np.intp)[apart_m < SAME_LANDMARK_M]
        if not ((bits[near] != bits[k]).sum(axis=1) < SAME_LANDMARK_BITS).any():
            kept.append(k)
    assert_same(remove_duplicates(landmarks), landmarks.select(np.array(kept)))


def test_selected_landmarks_keep_their_keyframes() -> None:
    rows = np.arange(found().size)[::-7]
    some = found().select(rows)
    both = concatenate([some, found()])
    assert both.size == some.size + found().size
    for landmarks, of in ((some, rows), (both, np.concatenate([rows, np.arange(found().size)]))):
        np.testing.assert_array_equal(
            landmarks.world_from_keyframe[landmarks.keyframes],
            found().world_from_keyframe[found().keyframes[of]],
        )
    ids = found().gaussians[:9]
    known = np.unique(ids)
    living = found().of_gaussians(replace(random_map(len(known)), ids=known))
    assert set(living.gaussians.tolist()) == set(ids.tolist())
    assert len(living.world_from_keyframe) == len(np.unique(living.keyframes))


@pytest.mark.parametrize(
    ("name", "array"),
    [
        ("positions", np.zeros((1, 3))),
        ("positions", np.full((1, 3), np.nan, np.float32)),
        ("descriptors", np.zeros((1, 31), np.uint8)),
        ("descriptors", np.zeros((2, 32), np.uint8)),
        ("keyframes", np.ones(1, np.int32)),
        ("keyframes", np.full(1, -1, np.int32)),
        ("world_from_keyframe", np.zeros((0, 4, 4))),
        ("world_from_keyframe", 2 * np.eye(4)[None]),
        ("world_from_keyframe", np.diag([1.0, 1, -1, 1])[None]),
        ("world_from_keyframe", np.full((1, 4, 4), np.nan)),
        ("world_from_keyframe", np.full((1, 4, 4), 1e200)),
        ("world_from_keyframe", np.zeros(())),
        ("gaussians", np.zeros(1, np.int64)),
        ("gaussians", np.zeros((1, 1), np.uint64)),
        ("gaussians", np.zeros((), np.uint64)),
    ],
)
def test_invalid_arrays_are_rejected(name: str, array: np.ndarray) -> None:
    arrays = {
        "positions": np.zeros((1, 3), np.float32),
        "descriptors": np.zeros((1, 32), np.uint8),
        "keyframes": np.zeros(1, np.int32),
        "world_from_keyframe": np.eye(4)[None],
        "gaussians": np.zeros(1, np.uint64),
    }
    Landmarks(**arrays)
    named = "keyframes" if array.shape == (0, 4, 4) else name
    with pytest.raises(ValueError, match=f"Landmarks: {named}: "):
        Landmarks(**{**arrays, name: array})
