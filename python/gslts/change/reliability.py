"""Checks of frames: reasons why a frame cannot be compared with a map."""

from __future__ import annotations

import numpy as np

from gslts.change.blur import Detail
from gslts.change.constants import (
    BLACK,
    DEPTH_TOLERANCE,
    MAX_ALIGNED_DEPTHLESS_SHARE,
    MAX_ALIGNED_SHARE,
    MAX_CLIPPED_SHARE,
    MAX_CORRECTION_M,
    MAX_CORRECTION_RAD,
    MAX_DISSIMILAR_SHARE,
    MIN_AGREEING_SHARE,
    MIN_ALIGNMENT_PEAK,
    MIN_COARSE_AGREEING_SHARE,
    MIN_KNOWN_SHARE,
    SIMILAR,
    WHITE,
)
from gslts.change.depth_quality import DepthQuality
from gslts.change.features import alignment_peak
from gslts.core.gaussian_map import FloatArray
from gslts.core.se3 import pose_distance
from gslts.types import Bools, Floats, Floats32

WRONG_POSE = "pose, intrinsics or scale are wrong"
"""What makes a frame show another scene than the map."""


def frame_fault(observed_rgb: Floats32) -> str | None:
    """Check a frame on its own.

    Args:
        observed_rgb: [K,3] sRGB of the pixels of its mask, 0 to 1; [H,W,3] without a mask.

    Returns:
        The reason why the frame is unusable; None if it is usable.
    """
    if not len(observed_rgb):
        return "the mask of the frame is empty"
    if (observed_rgb.max(axis=-1) < BLACK).mean() > MAX_CLIPPED_SHARE:
        return "the image is black"
    if (observed_rgb.min(axis=-1) > WHITE).mean() > MAX_CLIPPED_SHARE:
        return "the image is saturated"
    return None


def correction_fault(given: Floats, aligned: Floats) -> str | None:
    """Check the correction of a pose by the alignment with the map.

    Args:
        given: [4,4] world_from_camera of the frame, m.
        aligned: [4,4] world_from_camera after the alignment, m.

    Returns:
        The reason why the correction is not plausible; None if it is.
    """
    shift_m, turn_rad = pose_distance(given, aligned)
    if shift_m <= MAX_CORRECTION_M and turn_rad <= MAX_CORRECTION_RAD:
        return None
    return f"the pose seems off by {shift_m:.2f} m and {np.degrees(turn_rad):.0f} degrees"


def view_fault(detail: Detail, known: Bools) -> str | None:
    """Check if a frame and a rendering can be compared.

    Args:
        detail: Detail of the frame and of the rendering.
        known: [K] True for those pixels of the mask of the frame that the map covers.

    Returns:
        The reason why they cannot be compared; None if they can.
    """
    if known.mean() < MIN_KNOWN_SHARE:
        return f"the map covers {100 * known.mean():.0f} % of the view"
    if detail.is_blurred():
        return "the image is blurred"
    return None


def appearance_fault(
    features: tuple[Floats32, Floats32], similarity: Floats32, known: Bools, depth: DepthQuality
) -> str | None:
    """Check if a frame shows the same scene as the rendering, by their features.

    Args:
        features: [h,w,D] of the frame and of the rendering.
        similarity: [H,W] their cosine.
        known: [H,W] pixels that the map covers.
        depth: Quality of the measured depth.

    Returns:
        The reason why it shows another scene; None if it does not.
    """
    if not known.any():
        return "no part of the view can be compared"
    dissimilar = float((similarity[known] < SIMILAR).mean())
    if dissimilar <= MAX_DISSIMILAR_SHARE:
        return None
    most = MAX_ALIGNED_DEPTHLESS_SHARE if depth == "none" else MAX_ALIGNED_SHARE
    if dissimilar <= most and alignment_peak(*features) >= MIN_ALIGNMENT_PEAK:
        return None
    return f"{100 * dissimilar:.0f} % of the pixels appear different: {WRONG_POSE}"


def depth_fault(
    observed_depth: Floats32, rendered_depth: FloatArray, known: Bools, depth: DepthQuality
) -> str | None:
    """Check if a frame shows the same scene as the rendering, by their depths.

    Args:
        observed_depth: [H,W] m; 0 where nothing was measured.
        rendered_depth: [H,W] m; 0 where the map is empty.
        known: [H,W] pixels that the map covers.
        depth: Quality of the measured depth; without any, nothing is checked.

    Returns:
        The reason why it shows another scene; None if it does not.
    """
    if depth == "none":
        return None
    both = known & (observed_depth > 0) & (rendered_depth > 0)
    if not both.any():
        return "no depth is measured where the map is known"
    errors = np.abs(observed_depth - rendered_depth)[both]
    agreeing = float((errors < DEPTH_TOLERANCE * rendered_depth[both]).mean())
    least = MIN_COARSE_AGREEING_SHARE if depth == "coarse" else MIN_AGREEING_SHARE
    if agreeing >= least:
        return None
    return f"depths agree in {100 * agreeing:.0f} % of the pixels: {WRONG_POSE}"
