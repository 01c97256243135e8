"""Depth pictures carried into the view of a colour camera beside the depth camera."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gslts.camera import Camera

Floats32 = NDArray[np.float32]

EDGE_STEP = 0.05
"""Relative step of depth within 2 x 2 pixels that counts as an edge: the surfaces beside it are not
joined. At 640 px a plane seen at 80 degrees from its normal makes steps of 0.02."""
NEAREST_M = 0.01
"""Points nearer to the colour camera are left out."""
MOST_COVERED_PX = 32
"""Along each axis; a pixel of the depth picture that covers more is right before the lens."""


def register_depth(depth: Floats32, depth_camera: Camera, camera: Camera) -> Floats32:
    """What a camera would measure, from the depth that another one has measured beside it.

    Each pixel is carried over as the patch of surface that it covers, so that a surface stays
    closed whatever the sizes of the pictures are; where patches overlap, the nearest wins. Within a
    patch the inverse depth is linear, which is exact for planes.

    Args:
        depth: [H,W] float32, z in the frame of `depth_camera`, m; 0 or NaN means no measurement.
        depth_camera: Of the depth.
        camera: In whose view it is wanted. Only its pose relative to `depth_camera` counts.

    Returns:
        [H',W'] float32, z in the frame of `camera`, m; 0 where nothing was measured.

    Raises:
        ValueError: The depth does not have the size of its camera's image.
    """
    size = (depth_camera.height, depth_camera.width)
    if depth.shape != size:
        raise ValueError(f"register_depth: depth: expected {size}, got {depth.shape}")
    carry = _Carry(depth_camera, camera)
    depth = np.where(depth > 0, depth, 0).astype(np.float32)  # NaN is not above 0.
    corner_depth, at_edge = _corners(depth)
    # [H,W] or [H+1,W+1]: image coordinates and inverse depth in the new view.
    rows, columns = (np.arange(count + 1, dtype=np.float32) for count in size)
    x, y, inverse = carry(columns, rows[:, None], corner_depth)
    middle_x, middle_y, middle = carry(columns[:-1] + 0.5, rows[:-1, None] + 0.5, depth)

    # The box of each patch; the inverse depth rises by slope_x and slope_y a pixel in it.
    x0, x1 = _extremes(x)
    y0, y1 = _extremes(y)
    left, right = _sides(x, inverse, axis=1)
    slope_x = _ratio(right[1] - left[1], right[0] - left[0])
    top, bottom = _sides(y, inverse, axis=0)
    slope_y = _ratio(bottom[1] - top[1], bottom[0] - top[0])

    # Corners at an edge belong to several surfaces: each patch there gets corners at its own depth.
    j, i = np.nonzero(_any_corner(at_edge) & (middle > 0))
    own: list[tuple[Floats32, Floats32]] = []
    for dj, di in ((0, 0), (0, 1), (1, 0), (1, 1)):
        edge = at_edge[j + dj, i + di]
        own_x, own_y, _ = carry(columns[i + di], rows[j + dj], depth[j, i])
        own.append(
            (
                np.where(edge, own_x, x[j + dj, i + di]),
                np.where(edge, own_y, y[j + dj, i + di]),
            )
        )
    own_xs, own_ys = (np.stack(values) for values in zip(*own, strict=True))
    x0[j, i], x1[j, i] = own_xs.min(axis=0), own_xs.max(axis=0)
    y0[j, i], y1[j, i] = own_ys.min(axis=0), own_ys.max(axis=0)
    slope_x[j, i] = slope_y[j, i] = 0

    # The pixels of the new view whose centres are in a box.
    seen = np.flatnonzero(middle > 0)
    first_i, count_i = _centres_within(x0.ravel()[seen], x1.ravel()[seen], camera.width)
    first_j, count_j = _centres_within(y0.ravel()[seen], y1.ravel()[seen], camera.height)
    counts = count_i * count_j
    patch = np.repeat(np.arange(len(seen)), counts)
    place = np.arange(len(patch)) - np.repeat(np.cumsum(counts) - counts, counts)
    down, across = np.divmod(place, count_i[patch])
    column, row = first_i[patch] + across, first_j[patch] + down
    source = seen[patch]
    near = middle.ravel()[source]
    near = near + slope_x.ravel()[source] * (column + np.float32(0.5) - middle_x.ravel()[source])
    near += slope_y.ravel()[source] * (row + np.float32(0.5) - middle_y.ravel()[source])

    nearest = np.zeros(camera.height * camera.width, np.float32)
    np.maximum.at(nearest, row * camera.width + column, near)
    nearest[nearest > 1 / NEAREST_M] = 0
    return _ratio(np.ones_like(nearest), nearest).reshape(camera.height, camera.width)


class _Carry:
    """Takes image points with depth from one camera's view into another's."""

    def __init__(self, depth_camera: Camera, camera: Camera) -> None:
        moved = np.linalg.inv(camera.world_from_camera) @ depth_camera.world_from_camera
        into, out_of = _intrinsics(camera), np.linalg.inv(_intrinsics(depth_camera))
        self._turn = (into @ moved[:3, :3] @ out_of).astype(np.float32)
        self._shift = (into @ moved[:3, 3]).astype(np.float32)

    def __call__(
        self, x: Floats32, y: Floats32, depth: Floats32
    ) -> tuple[Floats32, Floats32, Floats32]:
        """Image coordinates, px, and inverse depth, 1/m; all 0 without depth or behind."""
        homogeneous = [
            (row[0] * x + (row[1] * y + row[2])) * depth + shift
            for row, shift in zip(self._turn, self._shift, strict=True)
        ]
        ahead = (depth > 0) & (homogeneous[2] > NEAREST_M)
        inverse = _ratio(np.ones_like(depth), np.where(ahead, homogeneous[2], np.float32(0)))
        return homogeneous[0] * inverse, homogeneous[1] * inverse, inverse


def _intrinsics(camera: Camera) -> NDArray[np.float64]:
    return np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]])


def _corners(depth: Floats32) -> tuple[Floats32, NDArray[np.bool_]]:
    """[H+1,W+1] mean depth around each corner of pixels, and whether it is at an edge."""
    padded = np.pad(depth, 1)
    around = [padded[:-1, :-1], padded[:-1, 1:], padded[1:, :-1], padded[1:, 1:]]
    total = around[0] + around[1] + around[2] + around[3]
    count = sum((values > 0).astype(np.float32) for values in around)
    mean = _ratio(total, np.asarray(count))
    farthest = np.maximum(np.maximum(around[0], around[1]), np.maximum(around[2], around[3]))
    nearest = np.full_like(farthest, np.inf)
    for values in around:
        np.minimum(nearest, values, out=nearest, where=values > 0)
    # A corner with missing neighbours is an edge, too: the mean is not of its place.
    return mean, (farthest - nearest > EDGE_STEP * nearest) | (count < 4)


def _extremes(corners: Floats32) -> tuple[Floats32, Floats32]:
    """[H,W] least and greatest of the four corners of each pixel."""
    pairs = np.minimum(corners[:-1], corners[1:]), np.maximum(corners[:-1], corners[1:])
    low = np.minimum(pairs[0][:, :-1], pairs[0][:, 1:])
    return low, np.maximum(pairs[1][:, :-1], pairs[1][:, 1:])


def _sides(
    place: Floats32, inverse: Floats32, axis: int
) -> tuple[tuple[Floats32, Floats32], tuple[Floats32, Floats32]]:
    """(place, inverse depth), each [H,W], of the two sides of each pixel across an axis."""
    across = []
    for values in (place, inverse):
        sums = values[:-1] + values[1:] if axis == 1 else values[:, :-1] + values[:, 1:]
        across.append(0.5 * sums)
    if axis == 1:
        return (across[0][:, :-1], across[1][:, :-1]), (across[0][:, 1:], across[1][:, 1:])
    return (across[0][:-1], across[1][:-1]), (across[0][1:], across[1][1:])


def _any_corner(flags: NDArray[np.bool_]) -> NDArray[np.bool_]:
    return flags[:-1, :-1] | flags[:-1, 1:] | flags[1:, :-1] | flags[1:, 1:]


def _ratio(above: Floats32, below: Floats32) -> Floats32:
    """The quotient, 0 where the divisor is 0."""
    return np.divide(above, below, out=np.zeros_like(above), where=below != 0)


def _centres_within(
    low: Floats32, high: Floats32, count: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The first pixel whose centre is in [low, high), and how many there are in the picture."""
    high = np.minimum(high, low + MOST_COVERED_PX)
    bounds = (np.ceil(np.clip(edge, 0, count) - np.float32(0.5)) for edge in (low, high))
    first, end = (np.clip(bound, 0, count).astype(np.int64) for bound in bounds)
    return first, np.maximum(end - first, 0)
