"""Depth of added objects where the sensor's depth is coarse: they stand on surfaces of the map."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from gslts.core.camera import unproject
from gslts.types import Bools, Floats, Floats32, Ints
from gslts.update.views import View

FRONT_M = 0.005
"""An added object lies at least this much before the surface that it occludes, m. Without it, half
of its Gaussians would lie behind that surface."""
FRONT_QUANTILE = 0.2
"""Quantile of the contact points, by distance, at which the front of an object is: the sides of a
round object touch their support farther back."""
MIN_CONTACTS = 3
"""Minimum number of columns in which the lower edge of an object meets a surface of the map."""
MIN_HORIZONTAL = 0.2
"""Minimum horizontal part of the viewing direction: from above, the front is hidden."""


def place_added_objects(view: View) -> View:
    """Return a view with the depth of added objects where they stand, instead of the coarse one.

    The front of an object is taken to be upright above the line where its lower edge meets the
    surface below it. Where this is farther from the measured depth than its steps allow, the
    measured depth counts, but an object is always nearer than the surface that it occludes.

    Args:
        view: With masks of what was added; the world has z up.
    """
    depth = view.depth.copy()
    count, labels = cv2.connectedComponents(view.after.astype(np.uint8))
    for label in range(1, count):
        mask: Bools = labels == label
        placed = _upright_depth(view, mask)
        measured = depth[mask]
        known = measured > 0
        if placed is not None and known.any():
            error_m = np.abs(np.median(placed[known]) - np.median(measured[known]))
            placed = placed if error_m <= view.depth_quantum_m else None
        depth[mask] = measured if placed is None else placed
    behind = view.after & (view.rendered_depth > 0) & (depth > view.rendered_depth - FRONT_M)
    depth[behind] = view.rendered_depth[behind] - FRONT_M
    return replace(view, frame=replace(view.frame, depth=depth))


def _upright_depth(view: View, mask: Bools) -> Floats32 | None:
    """Return [P] depths of a mask on an upright plane above its contact line; None if unknown."""
    pose = view.camera.world_from_camera
    ahead = pose[:2, 2]
    if np.linalg.norm(ahead) < MIN_HORIZONTAL:
        return None
    normal = np.append(ahead / np.linalg.norm(ahead), 0.0)
    contacts = _contact_points(view, mask) @ normal
    if len(contacts) < MIN_CONTACTS:
        return None
    rows, columns = np.nonzero(mask)
    rays = _points(view, rows, columns, np.ones(len(rows))) - pose[:3, 3]
    distance_m = np.quantile(contacts, FRONT_QUANTILE) - pose[:3, 3] @ normal
    slopes = rays @ normal
    if distance_m <= 0 or (slopes <= 0).any():
        return None
    depths: Floats32 = (distance_m / slopes).astype(np.float32)
    return depths


def _contact_points(view: View, mask: Bools) -> Floats:
    """Return [P,3] points of the map just below a mask, one a column, m."""
    height, _ = mask.shape
    columns = np.flatnonzero(mask.any(axis=0))
    below = height - np.argmax(mask[::-1, columns], axis=0)  # Row below the lowest pixel.
    columns, below = columns[below < height], below[below < height]
    depths = view.rendered_depth[below, columns].astype(np.float64)
    free = (depths > 0) & ~view.after[below, columns]
    return _points(view, below[free], columns[free], depths[free])


def _points(view: View, rows: Ints, columns: Ints, depths_m: Floats) -> Floats:
    return unproject(view.camera, np.column_stack([columns + 0.5, rows + 0.5]), depths_m)
