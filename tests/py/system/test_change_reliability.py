"""Unreliable frames are reported as such, without changes."""

import re
from collections.abc import Callable
from dataclasses import replace

import change_room
import cv2
import numpy as np
import pytest
from change_room import VIEWPOINTS, see

from gslts.core.camera import Camera, at_pose
from gslts.core.frame import RgbdFrame
from gslts_sim.robot_body import Viewpoint

VIEWS = {
    "front": VIEWPOINTS[0],
    "back": VIEWPOINTS[1],
    "corner": VIEWPOINTS[2],
    "along": Viewpoint(0.6, 2.0, 0.0, 20.0),
    "across": Viewpoint(4.2, 3.3, 225.0, 20.0),
    "wall": Viewpoint(1.0, 3.2, 200.0, 10.0),
}

Spoil = Callable[[RgbdFrame], RgbdFrame]


def with_depth(frame: RgbdFrame, depth: np.ndarray) -> RgbdFrame:
    return replace(frame, depth=depth.astype(np.float32))


def with_rgb(frame: RgbdFrame, rgb: np.ndarray) -> RgbdFrame:
    return replace(frame, rgb=rgb.clip(0, 255).astype(np.uint8))


def with_focal(frame: RgbdFrame, fx: float, fy: float) -> RgbdFrame:
    """Scale the focal lengths."""
    camera = frame.camera
    scaled = Camera(
        fx=fx * camera.fx,
        fy=fy * camera.fy,
        cx=camera.cx,
        cy=camera.cy,
        width=camera.width,
        height=camera.height,
        world_from_camera=camera.world_from_camera,
    )
    return replace(frame, camera=scaled)


def shifted(frame: RgbdFrame, *metres: float) -> RgbdFrame:
    """Shift the position of a frame."""
    pose = frame.camera.world_from_camera.copy()
    pose[:3, 3] += metres
    return replace(frame, camera=at_pose(frame.camera, pose))


def turned(frame: RgbdFrame, degrees: float) -> RgbdFrame:
    """Turn the yaw of a frame."""
    pose = frame.camera.world_from_camera.copy()
    cosine, sine = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    pose[:3, :3] = np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]]) @ pose[:3, :3]
    return replace(frame, camera=at_pose(frame.camera, pose))


def smeared(rgb: np.ndarray, length_px: int) -> np.ndarray:
    """Blur as by a turn of the camera about the vertical axis."""
    return cv2.filter2D(rgb, -1, np.full((1, length_px), 1 / length_px))


SPOILED: dict[str, tuple[Spoil, str]] = {
    "black": (lambda frame: with_rgb(frame, frame.rgb // 50), "black"),
    "white": (lambda frame: with_rgb(frame, 0 * frame.rgb + 255), "saturated"),
    "overexposed": (lambda frame: with_rgb(frame, 15 * frame.rgb.astype(int)), "saturated"),
    "out of focus": (
        lambda frame: with_rgb(frame, cv2.GaussianBlur(frame.rgb, (0, 0), 4)),
        "blurred",
    ),
    "smeared": (lambda frame: with_rgb(frame, smeared(frame.rgb, 25)), "blurred"),
    "outside": (lambda frame: shifted(frame, 20, 0, 0), "the map covers"),
    "below": (lambda frame: shifted(frame, 0, 0, -4), "the map covers"),
    "fx 40 % too large": (lambda frame: with_focal(frame, 1.4, 1), ""),
    "fx 40 % too small": (lambda frame: with_focal(frame, 0.6, 1), ""),
    "f 40 % too large": (lambda frame: with_focal(frame, 1.4, 1.4), ""),
    "f 40 % too small": (lambda frame: with_focal(frame, 0.6, 0.6), ""),
    "1 m to x": (lambda frame: shifted(frame, 1, 0, 0), ""),
    "1 m to -x": (lambda frame: shifted(frame, -1, 0, 0), ""),
    "1 m to y": (lambda frame: shifted(frame, 0, 1, 0), ""),
    "1 m to -y": (lambda frame: shifted(frame, 0, -1, 0), ""),
    "1 m up": (lambda frame: shifted(frame, 0, 0, 1), ""),
    "1 m down": (lambda frame: shifted(frame, 0, 0, -1), ""),
    "turned": (lambda frame: turned(frame, 20), ""),
    "turned back": (lambda frame: turned(frame, 180), ""),
    "depth in mm": (lambda frame: with_depth(frame, 1000 * frame.depth), "depths agree in 0 %"),
}


@pytest.mark.parametrize("noise", ["none", "kinect"])
@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("how", SPOILED)
def test_a_spoiled_frame_is_unreliable(how: str, view: str, noise: str) -> None:
    spoil, reason = SPOILED[how]
    frame = spoil(see(change_room.home(), VIEWS[view], noise, seed=3))
    detection = change_room.detector().detect(frame)
    assert detection.unreliable is not None
    assert re.search(reason, detection.unreliable)
    assert detection.changes == ()
    assert detection.rendered_rgb is None
    assert detection.combined_mask is None
    assert detection.observed_rgb.shape == (120, 160, 3)


DEPTHS: dict[str, Spoil] = {
    "no depth": lambda frame: with_depth(frame, 0 * frame.depth),
    "depth NaN": lambda frame: with_depth(frame, np.nan * frame.depth),
    "hardly any depth": lambda frame: with_depth(
        frame, np.where(np.arange(160) < 8, frame.depth, 0)
    ),
}


@pytest.mark.parametrize("view", ["front", "wall"])
@pytest.mark.parametrize("how", [name for name in SPOILED if "depth" not in name])
def test_a_spoiled_frame_without_depth_is_unreliable(how: str, view: str) -> None:
    spoil, _ = SPOILED[how]
    frame = DEPTHS["no depth"](spoil(see(change_room.home(), VIEWS[view], "kinect", seed=3)))
    detection = change_room.detector().detect(frame)
    assert detection.unreliable is not None
    assert detection.changes == ()


@pytest.mark.parametrize("view", ["front", "wall"])
@pytest.mark.parametrize("how", DEPTHS)
def test_an_unchanged_frame_without_depth_has_no_change(how: str, view: str) -> None:
    frame = DEPTHS[how](see(change_room.home(), VIEWS[view], "kinect", seed=1))
    detection = change_room.detector().detect(frame)
    assert detection.unreliable is None
    assert detection.changes == ()


@pytest.mark.parametrize("noise", ["none", "kinect"])
@pytest.mark.parametrize("view", VIEWS)
def test_good_frames_are_reliable(view: str, noise: str) -> None:
    for seed in range(3):
        frame = see(change_room.home(), VIEWS[view], noise, seed=seed)
        detection = change_room.detector().detect(frame)
        assert detection.unreliable is None
        assert detection.changes == ()


def masked(frame: RgbdFrame, mask: np.ndarray) -> RgbdFrame:
    """Leave nothing outside a mask, as beyond the border of an undistorted image."""
    rgb, depth = np.where(mask[..., None], frame.rgb, 0), np.where(mask, frame.depth, 0)
    return with_depth(replace(with_rgb(frame, rgb), mask=mask), depth)


MASK = np.zeros((120, 160), np.bool_)
MASK[20:90, 50:105] = True
"""A fifth of the image."""
SMALL_MASK = np.zeros((120, 160), np.bool_)
SMALL_MASK[30:70, 60:105] = True
"""Less than a tenth of it."""


@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("mask", [MASK, SMALL_MASK], ids=["fifth", "tenth"])
def test_pixels_outside_the_mask_do_not_count(view: str, mask: np.ndarray) -> None:
    frame = masked(see(change_room.home(), VIEWS[view], "kinect", seed=3), mask)
    detection = change_room.detector().detect(frame)
    assert detection.unreliable is None
    assert detection.changes == detection.unknown == ()
    assert detection.fine_depths is not None
    assert not detection.fine_depths[1][~mask].any()


def test_a_dark_image_within_a_mask_is_black() -> None:
    frame = see(change_room.home(), VIEWS["front"])
    dark = with_rgb(frame, np.where(MASK[..., None], frame.rgb // 50, frame.rgb))
    detection = change_room.detector().detect(replace(dark, mask=MASK))
    assert detection.unreliable == "the image is black"


@pytest.mark.parametrize("view", ["front", "back", "corner", "along", "across"])
def test_a_blurred_image_within_a_mask_is_blurred(view: str) -> None:
    frame = see(change_room.home(), VIEWS[view], "kinect", seed=3)
    blurred = masked(with_rgb(frame, cv2.GaussianBlur(frame.rgb, (0, 0), 4)), MASK)
    assert change_room.detector().detect(blurred).unreliable == "the image is blurred"


def test_an_empty_mask_leaves_nothing_to_compare() -> None:
    frame = masked(see(change_room.home(), VIEWS["front"]), np.zeros_like(MASK))
    detection = change_room.detector().detect(frame)
    assert detection.unreliable == "the mask of the frame is empty"


@pytest.mark.parametrize("view", VIEWS)
def test_the_part_behind_a_smeared_window_is_unknown(view: str) -> None:
    frame = see(change_room.home(), VIEWS[view], "kinect", seed=3)
    rgb = frame.rgb.copy()
    rgb[:, :80] = cv2.GaussianBlur(rgb, (0, 0), 3)[:, :80]
    detection = change_room.detector().detect(replace(frame, rgb=rgb))
    assert detection.changes == ()
    reasons = [detection.unreliable, *(region.reason for region in detection.unknown)]
    assert "the image is blurred" in reasons
