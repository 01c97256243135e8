"""Masks of objects in boxes, from depth and colour: the table below a cup is no cup.

Surfaces that go on outside of a box, such as tables, walls and floors, are planes through the
points around it; what lies on them is background, and so is what is far behind or before the
object. The rest starts GrabCut (Rother et al. 2004), which decides by colours where there is no
depth and where the object is flat.
"""

from __future__ import annotations

import cv2
import numpy as np

from gslts.core.camera import Camera
from gslts.types import Bools, Bytes, Floats, Floats32

MARGIN_SHARE, MIN_MARGIN_PX = 0.2, 4
"""Width of the surroundings of a box as a share of its sides, and at least so many pixels."""
MAX_SIDE_PX = 96
"""Maximum sides of a box and its surroundings when they are segmented; bounds time. The masks are
lifted to Gaussians of centimetres, and several views average their borders."""
PLANE_TRIALS, PLANE_POINTS, MAX_PLANES = 64, 400, 3
"""Random planes tried, points that they are fitted to, and planes of the surroundings of a box:
those of a corner of a room."""
PLANE_TOLERANCE_M, PLANE_TOLERANCE_SHARE = 0.008, 0.008
"""Maximum distance of a point of a plane, absolute and relative to its depth; the larger counts. A
Kinect has a noise of 3 mm at 1 m and of a few centimetres at 4 m."""
MIN_PLANE_SHARE = 0.15
"""Minimum share of the points around a box on a plane."""
DEPTH_SIDES = 0.7
"""Maximum depth of an object before and behind its middle, as a multiple of the longer side of its
box, m."""
MIN_DEPTH_M = 0.05
"""The same, at least, for flat objects, m."""
MIN_OBJECT_SHARE = 0.08
"""Minimum share of a box that its object covers; with less, its middle starts GrabCut."""
GRABCUT_STEPS, MIN_COLORS = 2, 8
"""Iterations of GrabCut, and minimum number of pixels of the object and of the background: it fits
five colours to each."""


def box_mask(rgb: Bytes, depth: Floats32, camera: Camera, box: Floats32) -> Bools:
    """Segment the object in a box.

    Args:
        rgb: [H,W,3] uint8, sRGB.
        depth: [H,W] float32, z, m, of the same camera; 0 or NaN for none.
        camera: Intrinsics.
        box: (4,) left, top, right, bottom, px.

    Returns:
        [H,W] bool, within the box; never empty for a box with a pixel.
    """
    height, width = depth.shape
    left, top, right, bottom = _pixels(box, (height, width))
    margins = [max(MIN_MARGIN_PX, round(MARGIN_SHARE * n)) for n in (right - left, bottom - top)]
    x0, x1 = max(0, left - margins[0]), min(width, right + margins[0])
    y0, y1 = max(0, top - margins[1]), min(height, bottom + margins[1])
    down, across = -(-(y1 - y0) // MAX_SIDE_PX), -(-(x1 - x0) // MAX_SIDE_PX)
    rows, columns = np.arange(y0, y1, down), np.arange(x0, x1, across)
    z = np.nan_to_num(depth[np.ix_(rows, columns)]).astype(np.float64)
    inside = ((rows >= top) & (rows < bottom))[:, None] & ((columns >= left) & (columns < right))
    rays = np.empty((*z.shape, 3))
    rays[..., 0] = (columns + 0.5 - camera.cx) / camera.fx
    rays[..., 1] = ((rows + 0.5 - camera.cy) / camera.fy)[:, None]
    rays[..., 2] = 1
    side = max((right - left) / camera.fx, (bottom - top) / camera.fy)
    seed = _seed(z, rays * z[..., None], inside, side)
    small = _grabcut(rgb[y0:y1:down, x0:x1:across], seed, inside)
    mask = np.zeros((height, width), np.bool_)
    large = small.repeat(down, axis=0).repeat(across, axis=1)[: y1 - y0, : x1 - x0]
    mask[y0:y1, x0:x1] = large
    outside = np.ones_like(mask)
    outside[top:bottom, left:right] = False
    mask[outside] = False
    return mask


def _pixels(box: Floats32, size: tuple[int, int]) -> tuple[int, int, int, int]:
    """Return the first column and row in a box, and the first behind it: at least one pixel."""
    left, right = (round(float(box[k])) for k in (0, 2))
    top, bottom = (round(float(box[k])) for k in (1, 3))
    left, top = min(max(left, 0), size[1] - 1), min(max(top, 0), size[0] - 1)
    return left, top, min(max(right, left + 1), size[1]), min(max(bottom, top + 1), size[0])


def _seed(z: Floats, points: Floats, inside: Bools, side: float) -> Bytes:
    """Return the initial labels [h,w] of GrabCut.

    Args:
        z: [h,w] depth, m; 0 for none.
        points: [h,w,3] points in the camera frame, m.
        inside: [h,w] pixels of the box.
        side: Longer side of the box at a depth of 1 m, m.
    """
    measured = z > 0
    background = _on_planes(points, _surroundings(points[measured & ~inside]))
    middle = _middle(inside)
    candidates = measured & inside & ~background
    labels = np.where(inside, cv2.GC_PR_BGD, cv2.GC_BGD).astype(np.uint8)
    enough = MIN_OBJECT_SHARE * np.count_nonzero(inside)
    core = candidates & middle if np.count_nonzero(candidates & middle) else candidates
    if np.count_nonzero(candidates) >= enough:
        depth_m = float(np.median(z[core]))
        is_object = candidates & (
            np.abs(z - depth_m) < max(MIN_DEPTH_M, DEPTH_SIDES * side * depth_m)
        )
        labels[is_object] = cv2.GC_PR_FGD
        labels[measured & inside & ~is_object & (np.abs(z - depth_m) > 2 * side * depth_m)] = (
            cv2.GC_BGD
        )
        labels[~measured & middle] = cv2.GC_PR_FGD
    if np.count_nonzero(labels == cv2.GC_PR_FGD) < enough:
        labels[middle] = cv2.GC_PR_FGD
    return labels


def _middle(inside: Bools) -> Bools:
    """Return the ellipse in a box."""
    rows, columns = np.flatnonzero(inside.any(axis=1)), np.flatnonzero(inside.any(axis=0))
    y = (np.arange(len(inside)) - rows.mean()) / max(1, len(rows) / 2)
    x = (np.arange(inside.shape[1]) - columns.mean()) / max(1, len(columns) / 2)
    return np.asarray((x * x + (y * y)[:, None] < 1) & inside)


def _surroundings(points: Floats) -> list[tuple[Floats, float]]:
    """Fit planes to points around a box, by random samples with a fixed seed.

    Args:
        points: [P,3] camera frame, m.

    Returns:
        Unit normal (3,) and offset of each plane: normal . x = offset.
    """
    rest = points[:: max(1, len(points) // PLANE_POINTS)]
    least = max(8.0, MIN_PLANE_SHARE * len(rest))
    planes: list[tuple[Floats, float]] = []
    rng = np.random.default_rng(0)
    while len(planes) < MAX_PLANES and len(rest) >= least:
        corners = rest[rng.integers(len(rest), size=(PLANE_TRIALS, 3))]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        lengths = np.linalg.norm(normals, axis=1)
        normals = normals[lengths > 1e-9] / lengths[lengths > 1e-9, None]
        if len(normals) == 0:
            break
        offsets = (normals * corners[lengths > 1e-9, 0]).sum(axis=1)
        near = np.abs(rest @ normals.T - offsets) < _tolerance_m(rest)[:, None]
        best = int(near.sum(axis=0).argmax())
        own = near[:, best]
        if own.sum() < least:
            break
        center = rest[own].mean(axis=0)
        normal = np.linalg.svd(rest[own] - center, full_matrices=False)[2][2]
        planes.append((normal, float(normal @ center)))
        rest = rest[~own]
    return planes


def _tolerance_m(points: Floats) -> Floats:
    tolerance: Floats = np.maximum(PLANE_TOLERANCE_M, PLANE_TOLERANCE_SHARE * points[..., 2])
    return tolerance


def _on_planes(points: Floats, planes: list[tuple[Floats, float]]) -> Bools:
    """Return [h,w] which points lie on a plane."""
    found = np.zeros(points.shape[:2], np.bool_)
    for normal, offset in planes:
        found |= np.abs(points @ normal - offset) < _tolerance_m(points)
    return found


def _grabcut(rgb: Bytes, labels: Bytes, inside: Bools) -> Bools:
    """Refine labels by colours; return the object, or the initial one if little is left."""
    start: Bools = labels == cv2.GC_PR_FGD
    if min(np.count_nonzero(start), np.count_nonzero(~start)) < MIN_COLORS:
        return start
    refined, image = labels.copy(), np.ascontiguousarray(rgb)
    cv2.setRNGSeed(0)  # GrabCut clusters colours at random.
    models, no_box = (np.zeros((1, 65)), np.zeros((1, 65))), (0, 0, 1, 1)
    cv2.grabCut(image, refined, no_box, *models, GRABCUT_STEPS, cv2.GC_INIT_WITH_MASK)
    found: Bools = refined == cv2.GC_PR_FGD
    enough = MIN_OBJECT_SHARE * np.count_nonzero(inside)
    return found if np.count_nonzero(found) >= enough else start
