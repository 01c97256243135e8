"""Halved frames: depth of one surface stays, edges between surfaces have none."""

import numpy as np
import pytest

from gslts.core.camera import Camera
from gslts.core.frame import RgbdFrame, halve_depth

NEAR_M, FAR_M = 1.0, 2.0
SIZE = (48, 64)
ROWS, COLUMNS = np.indices(SIZE)
STEP_PX = 31
"""Column at which the near surface begins: in the middle of a block."""
HOLES = {
    "every second": (ROWS % 2 == 0) & (COLUMNS % 2 == 0),
    "two of three": (ROWS % 3 < 2) & (COLUMNS % 3 < 2),
    "three of four": (ROWS % 4 < 3) & (COLUMNS % 4 < 3),
    "six of seven pixels": (ROWS + 2 * COLUMNS) % 7 > 0,
}


def slanted(start_m: float) -> np.ndarray:
    """[H,W] depths of a surface that rise by 0.2 % of a metre per pixel."""
    return (start_m + 0.002 * COLUMNS).astype(np.float32)


def step() -> np.ndarray:
    """[H,W] depths of a near surface at the right of a far one."""
    return np.where(COLUMNS < STEP_PX, slanted(FAR_M), slanted(NEAR_M))


def test_complete_blocks_of_one_surface_are_averaged() -> None:
    depth = step()
    halved = halve_depth(depth)
    edge = STEP_PX // 2
    assert not halved[:, edge].any()
    mean = depth.reshape(24, 2, 32, 2).mean(axis=(1, 3))
    np.testing.assert_allclose(np.delete(halved, edge, 1), np.delete(mean, edge, 1), rtol=1e-6)


@pytest.mark.parametrize("empty", [0, np.nan])
def test_a_hole_stays_a_hole(empty: float) -> None:
    depth = slanted(FAR_M)
    depth[10:14, 20:23] = empty
    assert np.argwhere(halve_depth(depth) == 0).tolist() == [[5, 10], [5, 11], [6, 10], [6, 11]]


@pytest.mark.parametrize("empty", [0, np.nan])
@pytest.mark.parametrize("holes", HOLES)
def test_depth_with_holes_all_over_is_kept_but_at_edges(holes: str, empty: float) -> None:
    complete = halve_depth(step())
    halved = halve_depth(np.where(HOLES[holes], step(), np.float32(empty)))
    edge = STEP_PX // 2
    assert not halved[:, edge].any(), "foreground and background are not mixed"
    off_edge = np.delete(halved, [edge - 1, edge, edge + 1], 1)
    np.testing.assert_allclose(off_edge, np.delete(complete, [edge - 1, edge, edge + 1], 1), 0.002)


def test_a_halved_frame_has_no_depth_outside_its_mask() -> None:
    height, width = SIZE
    camera = Camera(
        fx=60, fy=60, cx=32, cy=24, width=width, height=height, world_from_camera=np.eye(4)
    )
    depth = np.where(HOLES["every second"], slanted(FAR_M), np.float32(0))
    rgb = np.zeros((*SIZE, 3), np.uint8)
    halved = RgbdFrame(rgb, depth, camera, mask=COLUMNS < STEP_PX).halved()
    assert halved.mask is not None
    assert halved.depth[halved.mask].all()
    assert not halved.depth[~halved.mask].any()


def test_nothing_measured_stays_nothing() -> None:
    assert not halve_depth(np.zeros(SIZE, np.float32)).any()
    assert halve_depth(np.zeros((1, 1), np.float32)).shape == (0, 0)
