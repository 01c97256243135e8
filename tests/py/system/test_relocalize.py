"""Relocalization of single images, and its status."""

from dataclasses import replace
from functools import cache

import change_room
import cv2
import numpy as np
import pytest
import update_room
from landmark_room import found
from landmark_room import frames as mapped_frames
from shared import viewpoints_all_around

from gslts.core.camera import at_pose
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.core.se3 import se3_retract, twist_of
from gslts.localization.config import RelocalizationConfig
from gslts.localization.landmark_extraction import extract_landmarks
from gslts.localization.landmarks import Landmarks, concatenate
from gslts.localization.pose_quality import inlier_fault
from gslts.localization.relocalizer import Localization, Relocalizer
from gslts_sim.controller import Controller

ONE_THREAD = RelocalizationConfig(threads=1)
AWAY = np.array([[0, -1, 0, 7.0], [1, 0, 0, -3], [0, 0, 1, 0], [0, 0, 0, 1]])
"""A rigid motion of the world: a quarter turn and some metres."""


@cache
def relocalizer() -> Relocalizer:
    return Relocalizer(change_room.mapped()[0], found(), ONE_THREAD)


@cache
def views() -> tuple[RgbdFrame, ...]:
    """Return frames of the mapped room with the noise of a Kinect, at their true poses."""
    viewpoints = viewpoints_all_around("change_room", change_room.home(), 9)
    frames = []
    for seed, viewpoint in enumerate(viewpoints):
        true = change_room.see(change_room.home(), viewpoint)
        seen = change_room.see(change_room.home(), viewpoint, "kinect", seed)
        frames.append(replace(seen, camera=true.camera))
    return tuple(frames)


def off(result: Localization, frame: RgbdFrame) -> tuple[float, float]:
    """Return the error of a pose, m and degrees."""
    assert result.world_from_camera is not None
    twist = twist_of(np.linalg.inv(result.world_from_camera) @ frame.camera.world_from_camera)
    return float(np.linalg.norm(twist[:3])), float(np.degrees(np.linalg.norm(twist[3:])))


def without_pose(frame: RgbdFrame) -> RgbdFrame:
    return replace(frame, camera=at_pose(frame.camera, np.eye(4)))


@pytest.mark.smoke
def test_views_are_localized_without_a_prior() -> None:
    errors = []
    for frame in views():
        result = relocalizer().localize(without_pose(frame))
        assert result.status == "ok", result.reason
        assert result.inliers >= 10
        assert result.fit is not None
        assert result.fit.alike > 0.8
        errors.append(off(result, frame))
    # A pixel of these small images is 2 cm wide at 3 m.
    assert np.median([metres for metres, _ in errors]) < 0.01
    assert max(metres for metres, _ in errors) < 0.04
    assert max(degrees for _, degrees in errors) < 1.0


def test_the_covariance_matches_the_errors() -> None:
    squares = []
    for frame in views():
        result = relocalizer().localize(frame)
        assert result.world_from_camera is not None
        assert result.covariance is not None
        np.testing.assert_array_equal(result.covariance, result.covariance.T)
        assert np.linalg.eigvalsh(result.covariance).min() > 0
        twist = twist_of(np.linalg.inv(result.world_from_camera) @ frame.camera.world_from_camera)
        squares.append(twist @ np.linalg.solve(result.covariance, twist) / 6)
    assert 0.2 < np.mean(squares) < 5


def test_the_pose_of_the_frame_is_not_used() -> None:
    frame = views()[0]
    localized = relocalizer().localize(without_pose(frame))
    elsewhere = se3_retract(frame.camera.world_from_camera, np.full(6, 0.5))
    other = relocalizer().localize(replace(frame, camera=at_pose(frame.camera, elsewhere)))
    np.testing.assert_array_equal(localized.world_from_camera, other.world_from_camera)


def test_far_from_the_origin_of_the_world_poses_are_as_good() -> None:
    far = np.array([512_345.6, 4_123_456.7, 400.0])  # Such as eastings and northings, m.

    def carried(frame: RgbdFrame) -> RgbdFrame:
        pose = frame.camera.world_from_camera.copy()
        pose[:3, 3] += far
        return replace(frame, camera=at_pose(frame.camera, pose))

    gaussian_map = replace(change_room.mapped()[0], origin=far)
    landmarks = extract_landmarks(gaussian_map, map(carried, mapped_frames()), threads=1)
    np.testing.assert_allclose(landmarks.positions, found().positions, atol=1e-4)
    there = Relocalizer(gaussian_map, landmarks, ONE_THREAD)
    for frame in views()[:3]:
        result, near = there.localize(without_pose(frame)), relocalizer().localize(frame)
        assert result.status == near.status == "ok"
        assert abs(off(result, carried(frame))[0] - off(near, frame)[0]) < 1e-3
        assert result.coarse is not None
        assert near.coarse is not None
        np.testing.assert_allclose(result.coarse[:3, 3] - far, near.coarse[:3, 3], atol=1e-3)


def test_any_number_of_threads_gives_the_same_pose() -> None:
    gaussian_map = change_room.mapped()[0]
    two = Relocalizer(gaussian_map, found(), RelocalizationConfig(threads=2))
    localized, other = relocalizer().localize(views()[1]), two.localize(views()[1])
    np.testing.assert_array_equal(localized.world_from_camera, other.world_from_camera)
    np.testing.assert_array_equal(localized.covariance, other.covariance)


def test_colours_alone_are_enough() -> None:
    frame = replace(views()[0], depth=np.zeros_like(views()[0].depth))
    result = relocalizer().localize(frame)
    assert result.status == "ok", result.reason
    assert off(result, frame)[0] < 0.05


def test_tracking_corrects_centimetres() -> None:
    rng = np.random.default_rng(0)
    lost = 0
    for frame in views():
        twist = rng.normal(size=6)
        twist[:3] *= 0.05 / np.linalg.norm(twist[:3])
        twist[3:] *= 0.035 / np.linalg.norm(twist[3:])
        start = se3_retract(frame.camera.world_from_camera, twist)
        result = relocalizer().track(without_pose(frame), start)
        # 2 degrees are 6 of these small pixels, from which not every view is found again.
        lost += result.status == "lost"
        assert result.status == "lost" or off(result, frame)[0] < 0.03
    assert lost <= 1


def test_tracking_from_a_distant_pose_is_lost() -> None:
    frame = views()[0]
    start = frame.camera.world_from_camera.copy()
    start[:3, :3] = start[:3, :3] @ np.diag([-1.0, 1, -1])  # Turned by 180 degrees.
    across = frame.camera.world_from_camera.copy()
    across[:2, 3] = np.array([5.0, 4.0]) - across[:2, 3]  # Of a room of 5 x 4 m.
    for elsewhere in (start, across):
        result = relocalizer().track(frame, elsewhere)
        assert result.status == "lost"
        assert result.world_from_camera is None
        assert result.covariance is None


@pytest.mark.parametrize("level", [0, 180, 255])
def test_a_blank_image_without_depth_is_lost(level: int) -> None:
    """An exposure without contrast would explain any view."""
    frame = views()[0]
    blank = replace(frame, rgb=np.full_like(frame.rgb, level), depth=np.zeros_like(frame.depth))
    result = relocalizer().track(blank, frame.camera.world_from_camera)
    assert result.status == "lost"
    assert "does not determine the pose" in result.reason


@pytest.mark.parametrize("kind", ["removal", "addition", "relocation"])
def test_changes_of_the_room_do_not_matter(kind: update_room.Kind) -> None:
    home = update_room.changed_home(kind)
    for viewpoint in change_room.VIEWPOINTS:
        frame = change_room.see(home, viewpoint)
        result = relocalizer().localize(without_pose(frame))
        assert result.status == "ok", result.reason
        assert off(result, frame)[0] < 0.03


def black(frame: RgbdFrame) -> RgbdFrame:
    return replace(frame, rgb=np.zeros_like(frame.rgb))


def saturated(frame: RgbdFrame) -> RgbdFrame:
    return replace(frame, rgb=np.full_like(frame.rgb, 255))


def noise(frame: RgbdFrame) -> RgbdFrame:
    rng = np.random.default_rng(0)
    return replace(frame, rgb=rng.integers(0, 256, frame.rgb.shape, np.uint8))


def textureless(frame: RgbdFrame) -> RgbdFrame:
    return replace(frame, rgb=np.full_like(frame.rgb, 180))


@pytest.mark.parametrize("harmed", [black, saturated, noise, textureless])
def test_images_without_the_map_are_lost(harmed) -> None:  # type: ignore[no-untyped-def]
    result = relocalizer().localize(harmed(views()[0]))
    assert result.status == "lost"
    assert result.reason
    assert result.world_from_camera is None


def test_a_large_image_is_localized_by_blocks() -> None:
    """Four resolutions of 640 x 480, three of them with thinned maps."""
    robot = Controller(change_room.home(), width=640, height=480)
    for viewpoint in viewpoints_all_around("change_room", change_room.home(), 3):
        robot.go(viewpoint)
        frame = robot.observe()
        result = relocalizer().localize(without_pose(frame))
        assert result.status == "ok", result.reason
        assert off(result, frame)[0] < 0.02
        twist = np.array([0.03, -0.03, 0.02, 0.02, -0.02, 0.01])
        beside = se3_retract(frame.camera.world_from_camera, twist)
        tracked = relocalizer().track(frame, beside)
        assert tracked.status == "ok", tracked.reason
        assert off(tracked, frame)[0] < 0.02


def test_a_blurred_image_is_never_at_a_wrong_pose() -> None:
    found = []
    for frame in views():
        rgb = cv2.GaussianBlur(frame.rgb, (0, 0), 2.0)  # Of 160 columns: a smear of 8 at 640.
        result = relocalizer().localize(replace(frame, rgb=rgb))
        if result.world_from_camera is not None:
            found.append(off(result, frame)[0])
    assert found
    assert max(found) < 0.06


def test_saturated_depth_is_ignored() -> None:
    """65.535 m, the maximum of 16-bit millimetres, in a third of the image."""
    frame = views()[0]
    depth = frame.depth.copy()
    depth[:, : depth.shape[1] // 3] = 65.535
    result = relocalizer().localize(replace(frame, depth=depth))
    assert result.status == "ok", result.reason
    assert off(result, frame)[0] < 0.05


def test_wrong_intrinsics_are_not_ok() -> None:
    frame = views()[0]
    camera = frame.camera
    wrong = type(camera)(
        fx=2 * camera.fx,
        fy=2 * camera.fy,
        cx=camera.cx,
        cy=camera.cy,
        width=camera.width,
        height=camera.height,
        world_from_camera=camera.world_from_camera,
    )
    assert relocalizer().localize(replace(frame, camera=wrong)).status == "lost"


def test_two_equal_rooms_are_ambiguous() -> None:
    """Add a second copy of the room, some metres away and turned."""
    gaussian_map, landmarks = change_room.mapped()[0], found()
    twice = doubled(gaussian_map)
    both = concatenate([landmarks, carried(landmarks)])
    result = Relocalizer(twice, both, ONE_THREAD).localize(views()[0])
    assert result.status == "ambiguous"
    assert len(result.others) >= 1
    places = [result.world_from_camera, *result.others]
    true = views()[0].camera.world_from_camera
    for expected in (true, AWAY @ true):
        apart = min(
            np.linalg.norm((place - expected)[:3, 3]) for place in places if place is not None
        )
        assert apart < 0.05


def doubled(gaussian_map: GaussianMap) -> GaussianMap:
    quarter = np.sqrt(0.5)
    w, x, y, z = gaussian_map.quats.T
    turned = np.column_stack([w - z, x - y, y + x, z + w]) * quarter
    means = gaussian_map.means @ AWAY[:3, :3].T + AWAY[:3, 3]
    assert gaussian_map.sh.shape[1] == 1  # Colours of higher degree would have to turn.
    joint = {
        "means": np.concatenate([gaussian_map.means, means]),
        "quats": np.concatenate([gaussian_map.quats, turned]),
        "ids": np.arange(2 * gaussian_map.size, dtype=np.uint64),
    }
    for name in ("log_scales", "logit_opacities", "sh", "features"):
        array = getattr(gaussian_map, name)
        joint[name] = np.concatenate([array, array])
    typed = {
        name: array.astype(np.float32) if name != "ids" else array for name, array in joint.items()
    }
    return replace(gaussian_map, **typed)


def carried(landmarks: Landmarks) -> Landmarks:
    positions = landmarks.positions @ AWAY[:3, :3].T + AWAY[:3, 3]
    return replace(
        landmarks,
        positions=positions.astype(np.float32),
        world_from_keyframe=AWAY @ landmarks.world_from_keyframe,
    )


def test_a_map_without_landmarks_tracks_only() -> None:
    bare = Relocalizer(change_room.mapped()[0], None, ONE_THREAD)
    result = bare.localize(views()[0])
    assert result.status == "lost"
    assert "no landmarks" in result.reason
    assert bare.track(views()[0], views()[0].camera.world_from_camera).status == "ok"


def test_an_empty_map_localizes_nothing() -> None:
    gaussian_map = change_room.mapped()[0]
    empty = gaussian_map.select(np.zeros(gaussian_map.size, np.bool_))
    result = Relocalizer(empty, None, ONE_THREAD).track(
        views()[0], views()[0].camera.world_from_camera
    )
    assert result.status == "lost"
    assert "covers 0 %" in result.reason


def test_a_double_map_is_rejected() -> None:
    with pytest.raises(ValueError, match="must be float32, got float64"):
        Relocalizer(change_room.mapped()[0].astype(np.float64), None)


class FitOf:
    """Agreement of an image that is known and measured everywhere."""

    known = measured = 1.0

    def __init__(self, alike: float) -> None:
        self.alike, self.near = alike, 1.0


@pytest.mark.parametrize(("alike", "enough"), [(0.96, 10), (0.9, 20), (0.72, 30)])
def test_a_lower_score_needs_more_keypoints(alike: float, enough: int) -> None:
    fit = FitOf(alike)
    assert inlier_fault(enough, fit, True) is None  # type: ignore[arg-type]
    fault = inlier_fault(enough - 1, fit, True)  # type: ignore[arg-type]
    assert fault == f"only {enough - 1} keypoints support the best pose"
