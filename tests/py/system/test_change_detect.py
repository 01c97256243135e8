"""Change detection in a simulated room, from frame and map to changes."""

from dataclasses import replace
from pathlib import Path

import change_room
import numpy as np
import pytest
from change_room import BLUE, VIEWPOINTS, YELLOW, see, thing
from shared import viewpoints_all_around

from gslts.change.changes import Change
from gslts.change.config import DetectionConfig
from gslts.change.constants import MAX_CAMERAS
from gslts.change.detection import Detection
from gslts.change.detector import ChangeDetector, choose_evenly
from gslts.change.overlay import COLORS, overlay
from gslts.core.camera import Camera, at_pose, camera_from_fov, look_at
from gslts.core.frame import RgbdFrame
from gslts.store.measurements import NO_MEASUREMENTS, Measurements
from gslts.store.recorded_depths import RecordedDepths, small_depth_image
from gslts.store.records import Updates
from gslts_sim.changes import place
from gslts_sim.home import Home

pytestmark = pytest.mark.smoke

NEAR_M = 0.3
RED_M, BLUE_M, FREE_M = (2.2, 1.85, 0.9), (3.0, 1.95, 0.9), (2.6, 1.85, 0.9)
"""Middles of the boxes on the block, and a free position between them, m."""

viewpoints = pytest.mark.parametrize("viewpoint", VIEWPOINTS, ids=["front", "back", "corner"])
noises = pytest.mark.parametrize("noise", ["none", "kinect"])


def added(home: Home) -> Home:
    return home.with_object(thing("Box|3", 2.6, 1.85, YELLOW, "Block|1"))


def removed(home: Home) -> Home:
    return home.without(["Box|1"])


def moved(home: Home) -> Home:
    return place(home, "Box|1", np.array([2.6, 1.85, change_room.BLOCK_TOP_M]))


def without_depth(frame: RgbdFrame) -> RgbdFrame:
    return replace(frame, depth=np.zeros_like(frame.depth))


def summary(changes: tuple[Change, ...]) -> list[tuple[str, np.ndarray]]:
    return [(change.kind, change.point) for change in changes]


def require(detection: Detection, *expected: tuple[str, tuple[float, float, float]]) -> None:
    """Require these changes and no others, each within 0.3 m."""
    assert detection.unreliable is None
    assert sorted(change.kind for change in detection.changes) == sorted(
        kind for kind, _ in expected
    )
    for kind, point in expected:
        distances = [
            np.linalg.norm(change.point - point)
            for change in detection.changes
            if change.kind == kind
        ]
        assert min(distances) < NEAR_M, summary(detection.changes)


@viewpoints
@noises
def test_an_added_object_is_found(viewpoint: object, noise: str) -> None:
    detection = change_room.detector().detect(see(added(change_room.home()), viewpoint, noise))
    require(detection, ("addition", FREE_M))
    (change,) = detection.changes
    before, after = change.masks
    assert before is None
    assert after is not None
    assert change.boxes[0] is None
    # It is where the frame is yellow: red and green, and not blue.
    red, green, blue = detection.observed_rgb.transpose(2, 0, 1)
    yellow = (red > 2 * blue) & (green > 2 * blue) & (red > 0.2)
    assert (after & yellow).sum() > 0.6 * after.sum()


@viewpoints
@noises
def test_a_removed_object_is_found(viewpoint: object, noise: str) -> None:
    detection = change_room.detector().detect(see(removed(change_room.home()), viewpoint, noise))
    require(detection, ("removal", RED_M))
    (change,) = detection.changes
    before, after = change.masks
    assert after is None
    assert before is not None
    assert detection.rendered_rgb is not None
    red, green, blue = detection.rendered_rgb.transpose(2, 0, 1)
    assert (before & (red > 2 * blue) & (red > 2 * green)).sum() > 0.6 * before.sum()


@viewpoints
@noises
def test_without_depth_an_added_object_is_found_in_the_image(viewpoint: object, noise: str) -> None:
    frame = without_depth(see(added(change_room.home()), viewpoint, noise))
    detection = change_room.detector().detect(frame)
    assert detection.changes
    red, green, blue = detection.observed_rgb.transpose(2, 0, 1)
    yellow = (red > 2 * blue) & (green > 2 * blue) & (red > 0.2)
    for change in detection.changes:
        assert change.kind == "addition"
        assert not change.is_measured
        assert (change.masks[1] & yellow).sum() > 0.6 * change.masks[1].sum()


@viewpoints
@noises
def test_without_depth_a_removed_object_is_where_the_map_has_it(
    viewpoint: object, noise: str
) -> None:
    frame = without_depth(see(removed(change_room.home()), viewpoint, noise))
    change = change_room.detector().detect(frame).changes[0]
    assert change.kind == "removal"
    assert change.is_measured
    assert np.linalg.norm(change.point - RED_M) < NEAR_M


def test_the_rule_of_gs_lts_needs_depth() -> None:
    detector = ChangeDetector(change_room.mapped()[0], DetectionConfig(strategy="gs_lts"))
    detection = detector.detect(without_depth(see(change_room.home(), VIEWPOINTS[0])))
    assert detection.unreliable is not None
    assert "hardly any depth is measured" in detection.unreliable


@viewpoints
@noises
def test_a_moved_object_is_found_at_both_ends(viewpoint: object, noise: str) -> None:
    detection = change_room.detector().detect(see(moved(change_room.home()), viewpoint, noise))
    require(detection, ("relocation", FREE_M))
    (change,) = detection.changes
    for box, place_m in zip(change.boxes, (RED_M, FREE_M), strict=True):
        assert box is not None
        assert np.linalg.norm(np.mean(box, axis=0) - place_m) < NEAR_M
    assert all(mask is not None and mask.any() for mask in change.masks)


@viewpoints
@noises
def test_an_unchanged_room_has_no_change(viewpoint: object, noise: str) -> None:
    for seed in range(3):
        frame = see(change_room.home(), viewpoint, noise, seed)
        require(change_room.detector().detect(frame))


@viewpoints
@noises
def test_two_changes_at_once_are_both_found(viewpoint: object, noise: str) -> None:
    home = added(change_room.home()).without(["Box|2"])
    detection = change_room.detector().detect(see(home, viewpoint, noise))
    require(detection, ("addition", FREE_M), ("removal", BLUE_M))
    masks = [mask for change in detection.changes for mask in change.masks if mask is not None]
    assert not (masks[0] & masks[1]).any()
    both_gone = change_room.home().without(["Box|1", "Box|2"])
    detection = change_room.detector().detect(see(both_gone, viewpoint, noise))
    require(detection, ("removal", RED_M), ("removal", BLUE_M))


def test_an_addition_on_the_floor_is_found() -> None:
    home = change_room.home().with_object(thing("Box|3", 1.4, 2.0, BLUE, "Floor|1"))
    for viewpoint in VIEWPOINTS:
        require(change_room.detector().detect(see(home, viewpoint)), ("addition", (1.4, 2.0, 0.15)))


def test_boxes_are_around_the_object() -> None:
    """The visible part of a box of 0.24 x 0.24 x 0.3 m is measured to 6 cm."""
    changed = see(added(change_room.home()), VIEWPOINTS[0])
    (change,) = change_room.detector().detect(changed).changes
    box = change.boxes[1]
    assert box is not None
    low, high = box
    assert (low > np.array([2.48, 1.73, 0.75]) - 0.06).all()
    assert (high < np.array([2.72, 1.97, 1.05]) + 0.06).all()
    assert (high - low)[[0, 2]] == pytest.approx([0.24, 0.3], abs=0.1)


def test_gs_lts_finds_one_change_per_frame() -> None:
    config = replace(change_room.CONFIG, strategy="gs_lts")
    detector = ChangeDetector(change_room.mapped()[0], config)
    for home, kind, point in (
        (added(change_room.home()), "addition", FREE_M),
        (removed(change_room.home()), "removal", RED_M),
        (moved(change_room.home()), "relocation", np.mean([RED_M, FREE_M], axis=0)),
    ):
        require(detector.detect(see(home, VIEWPOINTS[0])), (kind, tuple(point)))
    require(detector.detect(see(change_room.home(), VIEWPOINTS[0])))


def test_results_are_the_same_for_any_number_of_threads() -> None:
    frame = see(added(removed(change_room.home())), VIEWPOINTS[2], "kinect")
    single, two = (
        ChangeDetector(
            change_room.mapped()[0],
            replace(change_room.CONFIG, threads=threads),
            cameras=change_room.mapped()[1].values(),
        ).detect(frame)
        for threads in (1, 2)
    )
    assert len(single.changes) == len(two.changes) >= 1
    for a, b in zip(single.changes, two.changes, strict=True):
        assert (a.kind, a.confidence) == (b.kind, b.confidence)
        np.testing.assert_array_equal(a.point, b.point)
        for side in (0, 1):
            np.testing.assert_array_equal(a.masks[side], b.masks[side])
            np.testing.assert_array_equal(a.boxes[side], b.boxes[side])
    for name in ("observed_rgb", "rendered_rgb", "pixel_mask", "feature_mask", "combined_mask"):
        np.testing.assert_array_equal(getattr(single, name), getattr(two, name), err_msg=name)
    np.testing.assert_array_equal(single.camera.world_from_camera, two.camera.world_from_camera)


def test_changes_come_by_falling_confidence() -> None:
    home = added(change_room.home()).without(["Box|1", "Box|2"])
    for viewpoint in VIEWPOINTS:
        detection = change_room.detector().detect(see(home, viewpoint))
        certain = [change.confidence for change in detection.changes]
        assert certain == sorted(certain, reverse=True)
        assert all(0 < confidence <= 1 for confidence in certain)


def test_a_pose_that_is_a_little_off_is_corrected() -> None:
    frame = see(removed(change_room.home()), VIEWPOINTS[0])
    off = frame.camera.world_from_camera.copy()
    off[:3, 3] += 0.02, -0.015, 0.01
    camera = at_pose(frame.camera, off)
    detection = change_room.detector().detect(replace(frame, camera=camera))
    require(detection, ("removal", RED_M))
    corrected = detection.camera.world_from_camera[:3, 3]
    true = frame.camera.world_from_camera[:3, 3]
    assert np.linalg.norm(corrected - true) < 0.5 * np.linalg.norm(off[:3, 3] - true)


def test_masked_pixels_have_not_changed() -> None:
    frame = see(removed(change_room.home()), VIEWPOINTS[0])
    mask = np.ones((120, 160), np.bool_)
    mask[:75, 40:] = False  # The block's top, and all behind it, right of the corner.
    require(change_room.detector().detect(replace(frame, mask=mask)))


def test_a_surface_that_no_frame_measured_is_no_removal() -> None:
    """Nobody knows where such a surface is; what it covers is unknown."""
    gaussian_map, cameras = change_room.mapped()
    near = np.linalg.norm(gaussian_map.means + gaussian_map.origin - RED_M, axis=1) < 0.4
    detector = ChangeDetector(
        gaussian_map,
        change_room.CONFIG,
        cameras=cameras.values(),
        measurements=Measurements(
            gaussian_map.ids, ~near, np.full((gaussian_map.size, 2), np.nan, np.float32)
        ),
    )
    detection = detector.detect(see(removed(change_room.home()), VIEWPOINTS[0]))
    require(detection)
    reasons = [region.reason for region in detection.unknown]
    assert "no frame of the map measured its depth" in reasons
    again = detector.with_map(gaussian_map, cameras.values())
    require(again.detect(see(removed(change_room.home()), VIEWPOINTS[0])))


def measured_depths(home: Home) -> Measurements:
    """Return the depths of a recording of a room."""
    viewpoints = viewpoints_all_around("change_room", change_room.home(), 48)
    frames = [see(home, viewpoint) for viewpoint in (*VIEWPOINTS, *viewpoints)]
    small, depths_mm = zip(*map(small_depth_image, frames), strict=True)
    return replace(NO_MEASUREMENTS, depths=RecordedDepths(small, np.concatenate(depths_mm)))


RED_BOX = (2.0, 1.65, 0.7), (2.4, 2.05, 1.1)
"""Corners around the red box, m."""


def test_what_the_recording_measured_is_no_addition() -> None:
    """A map may lack what was there; once it left, it may come."""
    whole, cameras = change_room.mapped()
    lacking = whole.select(np.linalg.norm(whole.means + whole.origin - RED_M, axis=1) > 0.25)
    measurements = measured_depths(change_room.home())

    def detector(updates: Updates) -> ChangeDetector:
        return ChangeDetector(
            lacking,
            change_room.CONFIG,
            cameras=cameras.values(),
            measurements=measurements,
            updates=updates,
        )

    frame, recorded = see(change_room.home(), VIEWPOINTS[0]), detector(Updates())
    detection = recorded.detect(frame)
    require(detection)
    reasons = [region.reason for region in detection.unknown]
    assert "the recording of the map measured this surface" in reasons
    require(recorded.with_map(lacking, cameras.values()).detect(frame))
    has_left = Updates(left=[RED_BOX])
    for other in (recorded.with_map(lacking, cameras.values(), has_left), detector(has_left)):
        require(other.detect(frame), ("addition", RED_M))


def test_what_the_recording_never_measured_is_no_removal() -> None:
    """A map may show what was not there; once it came, it may go."""
    gaussian_map, cameras = change_room.mapped()
    measurements = measured_depths(removed(change_room.home()))
    detector = ChangeDetector(
        gaussian_map, change_room.CONFIG, cameras=cameras.values(), measurements=measurements
    )
    frame = see(removed(change_room.home()), VIEWPOINTS[0])
    detection = detector.detect(frame)
    require(detection)
    reasons = [region.reason for region in detection.unknown]
    assert "the recording of the map saw through this surface" in reasons
    has_come = Updates(came=[RED_BOX])
    require(
        detector.with_map(gaussian_map, cameras.values(), has_come).detect(frame),
        ("removal", RED_M),
    )


def test_an_object_in_unseen_space_is_no_addition() -> None:
    """If no training camera saw through the space, the object may have been there before."""
    gaussian_map, _ = change_room.mapped()
    frame = see(added(change_room.home()), VIEWPOINTS[0])
    # In a corner of the room, looking into it.
    pose = look_at(np.array([0.5, 3.5, 0.3]), np.array([0.0, 4.0, 0.2]))
    elsewhere = camera_from_fov(160, 120, 1.0, pose)
    blind = ChangeDetector(gaussian_map, change_room.CONFIG, cameras=[elsewhere])
    require(blind.detect(frame))
    require(ChangeDetector(gaussian_map, change_room.CONFIG).detect(frame), ("addition", FREE_M))


def test_a_detector_of_a_map_folder_knows_its_training_cameras(tmp_path: Path) -> None:
    change_room.write_room_map(tmp_path / "map")
    detector = ChangeDetector.of_map(tmp_path / "map", change_room.CONFIG)
    frame = see(removed(change_room.home()), VIEWPOINTS[0], "kinect")
    found, expected = (each.detect(frame).changes for each in (detector, change_room.detector()))
    assert [change.confidence for change in found] == [change.confidence for change in expected]
    require(detector.detect(frame), ("removal", RED_M))
    with pytest.raises(OSError, match="gone"):
        ChangeDetector.of_map(str(tmp_path / "gone"))


def test_tiny_frames_and_double_maps_are_rejected() -> None:
    gaussian_map, _ = change_room.mapped()
    camera = Camera(fx=2, fy=2, cx=1, cy=1, width=2, height=2, world_from_camera=np.eye(4))
    tiny = RgbdFrame(np.zeros((2, 2, 3), np.uint8), np.ones((2, 2), np.float32), camera)
    with pytest.raises(ValueError, match=r"camera\.width must be in"):
        ChangeDetector(gaussian_map, DetectionConfig()).detect(tiny)
    doubles = gaussian_map.astype(np.float64)
    with pytest.raises(ValueError, match="ChangeDetector: the map must be float32, got float64"):
        ChangeDetector(doubles)


def test_the_overlay_shows_the_detection() -> None:
    detection = change_room.detector().detect(see(added(change_room.home()), VIEWPOINTS[0]))
    large = overlay(detection)
    assert large.shape == (3 * 120, 3 * 3 * 160, 3)  # Three times as large.
    assert large.dtype == np.uint8
    small = large[1::3, 1::3]  # The middle of each pixel.
    photo, render, masks = np.split(small, 3, axis=1)
    mask = detection.changes[0].masks[1]
    assert mask is not None
    plain = (255 * detection.observed_rgb).round()
    change = photo[mask].astype(float) - plain[mask]
    towards = np.array(COLORS["addition"]) - plain[mask]
    # Somewhere inside, the image is mixed with the colour of an addition.
    assert np.abs(change - 0.55 * towards).max(axis=1).min() < 2
    assert np.abs(render - (255 * detection.rendered_rgb).round()).max() <= 1
    untouched = np.abs(photo - plain).max(axis=-1) <= 1
    assert 0.7 < untouched.mean() < 1  # All but the change, its box and its name.
    np.testing.assert_array_equal((masks == 255).all(axis=-1), detection.combined_mask)
    lost = overlay(change_room.detector().detect(see_nothing()))
    assert lost.shape == large.shape
    assert (lost[:, 3 * 160 :] == 60).all()


def see_nothing() -> RgbdFrame:
    frame = see(change_room.home(), VIEWPOINTS[0])
    return replace(frame, rgb=np.zeros_like(frame.rgb))


def test_many_cameras_are_thinned_evenly() -> None:
    cameras = [camera_from_fov(8 + k, 8, 1.0, np.eye(4)) for k in range(3 * MAX_CAMERAS)]
    assert choose_evenly(cameras[:7], MAX_CAMERAS) == cameras[:7]
    assert choose_evenly((), MAX_CAMERAS) == []
    kept = [camera.width for camera in choose_evenly(cameras, MAX_CAMERAS)]
    assert len(kept) == MAX_CAMERAS
    assert (kept[0], kept[-1]) == (cameras[0].width, cameras[-1].width)
    assert np.ptp(np.diff(kept)) <= 1
