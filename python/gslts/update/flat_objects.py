"""Flat objects, such as a newspaper on a table: found by colour, because depth does not differ."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from gslts.core.camera import unproject
from gslts.types import Bools, Floats, Floats32, Ints
from gslts.update.region import Region
from gslts.update.views import View, pixels_in_region
from gslts.update.voxel_groups import MAX_DISTANCE_M, MIN_VIEWS, VOXEL_M, connected_to_region

MAX_GAP_VOXELS = 2
"""Maximum gap between parts of one flat object along each axis, voxels."""
MIN_COLOR_DIFFERENCE = 0.1
"""Minimum difference in a colour channel, 0 to 1."""
BLUR_PX = 3.0
"""Standard deviation of the blur before colours are compared, px; hides edges that are off by one
pixel."""
MIN_EDGE_CONTRAST, EDGE_PX = 0.1, 8
"""Minimum step of log-colours at the outline of an object, within this distance, px. Light that
changed has no such outline."""
DARK = 0.1
"""Added to colours before the logarithm, because dark pixels are mostly noise."""


def recolored_pixels(view: View, depth_step_m: float, depth_step_per_m: float) -> Bools:
    """Return the pixels where the colour of an unchanged surface differs from the map.

    Args:
        view: Aligned with the map.
        depth_step_m: Maximum difference of depth of an unchanged surface, m,
        depth_step_per_m: plus this factor of the squared depth, 1/m.

    Returns:
        [H,W] bool; changes of light are not in it.
    """
    step_m = depth_step_m + depth_step_per_m * view.depth**2
    same = (
        (view.depth > 0)
        & (view.rendered_depth > 0)
        & (np.abs(view.depth - view.rendered_depth) < step_m)
    )
    if view.frame.mask is not None:
        same &= view.frame.mask
    other = same & (_max_blurred(view.colors - view.rendered_rgb, same) > MIN_COLOR_DIFFERENCE)
    # Light scales colours: it changes the logarithms of all surfaces that it falls on alike.
    observed, rendered = (image.clip(0, 1) + DARK for image in (view.colors, view.rendered_rgb))
    return _with_colour_step(other, _max_blurred(np.log(observed / rendered), same), same)


def find_flat_object(
    region: Region, views: Sequence[View], recolored: Sequence[Bools]
) -> tuple[Floats, list[Bools]]:
    """Return the part of a flat object that lies in or beside a region.

    Args:
        region: With side "after".
        views: Of the region.
        recolored: [H,W] bool of each view, from `recolored_pixels`.

    Returns:
        [P,3] centres of its voxels in the world frame, m, and [H,W] bool of each view, its pixels.
    """
    low = region.low - MAX_DISTANCE_M
    shape = np.floor((region.high + MAX_DISTANCE_M - low) / VOXEL_M).astype(np.int64) + 1
    count = int(shape.prod())
    measured, changed, hits = np.zeros((3, count))
    pixels = []
    for view, other in zip(views, recolored, strict=True):
        rows, columns, voxels = _voxels_of_pixels(view, region, low, shape)
        changes = np.bincount(voxels, other[rows, columns], count)
        measured += np.bincount(voxels, minlength=count)
        changed += changes
        hits += changes > 0
        pixels.append((rows, columns, voxels))
    found = np.flatnonzero((changed > measured / 2) & (hits >= min(MIN_VIEWS, len(views))))
    centers = low + VOXEL_M * (np.column_stack(np.unravel_index(found, tuple(shape))) + 0.5)
    connected = connected_to_region(centers, region, MAX_GAP_VOXELS)
    is_flat = np.zeros(count, np.bool_)
    is_flat[found[connected]] = True
    masks = [np.zeros(view.depth.shape, np.bool_) for view in views]
    for mask, (rows, columns, voxels) in zip(masks, pixels, strict=True):
        mask[rows, columns] = is_flat[voxels]
    return centers[connected], masks


def _voxels_of_pixels(
    view: View, region: Region, low: Floats, shape: Ints
) -> tuple[Ints, Ints, Ints]:
    """Return rows, columns and voxel numbers of the pixels around a region."""
    rows, columns = np.nonzero(pixels_in_region(view.depth, view.camera, region, MAX_DISTANCE_M))
    pixels = np.column_stack([columns + 0.5, rows + 0.5])
    points = unproject(view.camera, pixels, view.depth[rows, columns].astype(np.float64))
    cells = ((points - low) / VOXEL_M).astype(np.int64).clip(0, shape - 1)
    return rows, columns, np.ravel_multi_index(tuple(cells.T), tuple(shape))


def _max_blurred(difference: Floats32, where: Bools) -> Floats32:
    """Return [H,W] the largest absolute channel of an image [H,W,3], blurred within a mask."""
    weights = where.astype(np.float32)
    blurred = cv2.GaussianBlur(difference * weights[..., None], (0, 0), BLUR_PX)
    weight = cv2.GaussianBlur(weights, (0, 0), BLUR_PX)
    return np.asarray(np.abs(blurred).max(axis=2) / np.maximum(weight, 1e-6), np.float32)


def _with_colour_step(other: Bools, steps: Floats32, same: Bools) -> Bools:
    """Return the components of `other` whose colours step at their outline.

    Args:
        other: [H,W] bool, pixels of another colour.
        steps: [H,W] difference of the log-colours.
        same: [H,W] bool, pixels of unchanged surfaces.
    """
    window = np.ones((2 * EDGE_PX + 1, 2 * EDGE_PX + 1), np.uint8)
    _, labels = cv2.connectedComponents(other.astype(np.uint8))
    rest = same & ~other
    edge = other & (cv2.dilate(rest.astype(np.uint8), window) > 0)
    nearest = cv2.dilate(labels.astype(np.float32), window).astype(np.int64)
    inside = _means_by_label(steps, np.where(edge, labels, 0), labels.max())
    outside = _means_by_label(steps, np.where(rest, nearest, 0), labels.max())
    stands_out = inside > outside + MIN_EDGE_CONTRAST
    stands_out[0] = False
    return np.asarray(stands_out[labels], np.bool_)


def _means_by_label(values: Floats32, labels: Ints, last: int) -> Floats:
    """Return [last + 1] the mean value of each label; 0 of labels without pixels."""
    sums = np.bincount(labels.ravel(), values.ravel(), last + 1)
    means: Floats = sums / np.maximum(np.bincount(labels.ravel(), minlength=last + 1), 1)
    return means
