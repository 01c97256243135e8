"""Agreement of frames: the depth of a frame, seen from another one."""

from itertools import permutations

import numpy as np

from gslts.core.camera import Camera, unproject
from gslts.core.frame import RgbdFrame
from gslts.core.se3 import transform

MAX_ERROR_SHARE = 0.05
"""Maximum relative difference of depths of one surface; pixels are coarse."""
MIN_AGREEING = 0.9
"""Share of the pixels that must agree; the others are at edges of objects."""


def pixels_of(camera: Camera) -> np.ndarray:
    """Return the centres [P,2] of all pixels, row by row."""
    rows, columns = np.indices((camera.height, camera.width))
    return np.column_stack([columns.ravel(), rows.ravel()]) + 0.5


def assert_frames_agree(frames: list[RgbdFrame]) -> None:
    """Check that the surfaces of each frame are those of each other frame where both see them.

    It fails for wrong axes, units, or intrinsics of the depth camera.
    """
    compared = 0
    for first, second in permutations(frames, 2):
        source, target = (f.depth_camera or f.camera for f in (first, second))
        depth = first.depth.ravel().astype(np.float64)
        measured = depth > 0
        points = unproject(source, pixels_of(source)[measured], depth[measured])
        x, y, z = transform(np.linalg.inv(target.world_from_camera), points).T
        ahead = z > 0.05
        column = np.floor(target.fx * x[ahead] / z[ahead] + target.cx).astype(int)
        row = np.floor(target.fy * y[ahead] / z[ahead] + target.cy).astype(int)
        inside = (column >= 0) & (column < target.width) & (row >= 0) & (row < target.height)
        there = second.depth[row[inside], column[inside]]
        expected = z[ahead][inside]
        # What is nearer in the other frame may hide the point.
        seen = (there > 0) & (there > (1 - MAX_ERROR_SHARE) * expected)
        agreeing = np.abs(there - expected)[seen] < MAX_ERROR_SHARE * expected[seen]
        if seen.sum() >= 20:
            assert agreeing.mean() > MIN_AGREEING, f"{agreeing.mean():.2f} agree"
            compared += 1
    assert compared >= 2, "frames do not overlap"
