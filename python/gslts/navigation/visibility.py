"""Whether a camera sees a thing: where it is, depth is as far as it, and the picture means it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gslts.core.camera import Camera
from gslts.core.frame import RgbdFrame
from gslts.core.se3 import inverse_transform
from gslts.semantics.relevance import CANONICAL, relevance
from gslts.semantics.source import SemanticSource
from gslts.types import Floats

Mask = NDArray[np.bool_]

OFF_M, OFF_SHARE = 0.03, 0.025
"""How far a depth may be from that of a point, or which share of it; the greater counts. Gaussians
lie some centimetres about the surface."""
BORDER = 0.03
"""Share of the width of an image at its border in which nothing counts as seen."""


def seen(points: Floats, camera: Camera, depth: NDArray[np.floating]) -> Mask:
    """[P] which points are in an image with nothing before them and nothing farther behind.

    Args:
        points: [P,3] in the world, m.
        camera: Of the depth.
        depth: [H,W] rendered or measured, z in the camera frame, m; 0 or NaN for none.
    """
    inside, rows, columns, z = _projected(points, camera)
    own = depth[rows, columns]
    off_m = np.maximum(OFF_M, OFF_SHARE * z)
    found: Mask = inside & (own > 0) & (np.abs(own - z) <= off_m)
    return found


def meant(points: Floats, frame: RgbdFrame, source: SemanticSource, text: str) -> Mask:
    """[P] at which points a picture shows what a text names.

    Args:
        points: [P,3] in the world, m.
        frame: The picture.
        source: Of its meaning.
        text: The words.

    Raises:
        ValueError: The source cannot read the frame.
    """
    segments = source.segments(frame)
    query, canonical = source.encode([text])[0], source.encode(CANONICAL)
    to_query, to_canonical = segments.embeddings @ query, segments.embeddings @ canonical.T
    fits = relevance(to_query, to_canonical) >= source.threshold
    inside, rows, columns, _ = _projected(points, frame.camera)
    labels = segments.labels[:, rows, columns]
    result: Mask = inside & (np.append(fits, False)[labels]).any(axis=0)  # Row -1 is the last.
    return result


def aim(eye: Floats, point: Floats) -> tuple[float, float]:
    """Yaw, from x to y, and angle below the horizon at which an eye looks at a point, rad.

    Args:
        eye: (3,) in the world, m.
        point: (3,) in the world, m.
    """
    x, y, z = (point - eye).tolist()
    return float(np.arctan2(y, x)), float(np.arctan2(-z, np.hypot(x, y)))


def _projected(
    points: Floats, camera: Camera
) -> tuple[Mask, NDArray[np.intp], NDArray[np.intp], Floats]:
    """[P] whether points are in an image, their rows and columns, 0 if not, and their depths."""
    x, y, z = inverse_transform(camera.world_from_camera, points).T
    before = z > OFF_M
    safe = np.where(before, z, 1.0)
    u = camera.fx * x / safe + camera.cx
    v = camera.fy * y / safe + camera.cy
    margin = BORDER * camera.width
    inside = before & (u >= margin) & (u < camera.width - margin)
    inside &= (v >= margin) & (v < camera.height - margin)
    rows = np.where(inside, v, 0).astype(np.intp)
    return inside, rows, np.where(inside, u, 0).astype(np.intp), z
