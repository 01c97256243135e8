"""Visibility of points of an object in an image, by depth and by semantics."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gslts.core.camera import Camera
from gslts.core.frame import RgbdFrame
from gslts.core.se3 import inverse_transform
from gslts.semantics.source import CANONICAL, SemanticSource
from gslts.types import Bools, Floats, Indices

DEPTH_TOLERANCE_M, DEPTH_TOLERANCE_SHARE = 0.03, 0.025
"""Maximum difference between the depth of a visible point and that of its pixel: the larger of
both, absolute and relative. Gaussians are some centimetres off the surface."""
BORDER_SHARE = 0.03
"""Border of an image in which no point counts as visible, as a share of the width."""


def visible_points(points: Floats, camera: Camera, depth: NDArray[np.floating]) -> Bools:
    """Test which points are visible: in the image, and at its depth.

    Args:
        points: [P,3] world, m.
        camera: Camera of the depth.
        depth: [H,W] rendered or measured, z in the camera frame, m; 0 or NaN for none.

    Returns:
        [P] bool.
    """
    inside, rows, columns, z = _project(points, camera)
    pixel_depths = depth[rows, columns]
    tolerance_m = np.maximum(DEPTH_TOLERANCE_M, DEPTH_TOLERANCE_SHARE * z)
    visible: Bools = inside & (pixel_depths > 0) & (np.abs(pixel_depths - z) <= tolerance_m)
    return visible


def matching_points(points: Floats, frame: RgbdFrame, source: SemanticSource, text: str) -> Bools:
    """Test at which points a frame shows an object that matches a text.

    Args:
        points: [P,3] world, m.
        frame: The frame.
        source: Segments the frame and encodes the text, with the threshold of the map.
        text: Such as "sofa".

    Returns:
        [P] bool.

    Raises:
        ValueError: The source cannot segment the frame.
    """
    segments = source.segments(frame)
    query, canonical = source.encode([text])[0], source.encode(CANONICAL)
    to_query, to_canonical = segments.embeddings @ query, segments.embeddings @ canonical.T
    is_match = source.relevance(to_query, to_canonical) >= source.threshold
    inside, rows, columns, _ = _project(points, frame.camera)
    labels = segments.labels[:, rows, columns]
    result: Bools = inside & np.append(is_match, False)[labels].any(axis=0)  # -1 is the last.
    return result


def view_angles(eye: Floats, point: Floats) -> tuple[float, float]:
    """Compute the angles of a camera that looks at a point.

    Args:
        eye: (3,) position of the camera, world, m.
        point: (3,) world, m.

    Returns:
        Yaw about z, from x to y, and pitch below the horizon, rad.
    """
    x, y, z = (point - eye).tolist()
    return float(np.arctan2(y, x)), float(np.arctan2(-z, np.hypot(x, y)))


def _project(points: Floats, camera: Camera) -> tuple[Bools, Indices, Indices, Floats]:
    """Return [P] if points are in the image, their rows and columns, 0 if not, and depths."""
    x, y, z = inverse_transform(camera.world_from_camera, points).T
    in_front = z > DEPTH_TOLERANCE_M
    divisor = np.where(in_front, z, 1.0)
    u = camera.fx * x / divisor + camera.cx
    v = camera.fy * y / divisor + camera.cy
    margin = BORDER_SHARE * camera.width
    inside = in_front & (u >= margin) & (u < camera.width - margin)
    inside &= (v >= margin) & (v < camera.height - margin)
    rows = np.where(inside, v, 0).astype(np.intp)
    return inside, rows, np.where(inside, u, 0).astype(np.intp), z
