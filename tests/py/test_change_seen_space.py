"""What cameras looked through: a wall 2 m ahead of one made by hand."""

import numpy as np
import pytest

from gslts.camera import Camera, at_pose, look_at
from gslts.change.seen_space import MARGIN_M, SeenSpace
from gslts.gaussian_map import GaussianMap

WALL_Y_M = 2.0
CAMERA = Camera(
    fx=100,
    fy=120,
    cx=70,
    cy=60,
    width=160,
    height=120,
    world_from_camera=look_at(np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 1.0])),
)


def wall(low_x: float = -2.0, high_x: float = 2.0) -> GaussianMap:
    """Opaque flat Gaussians in the plane y = 2 m, from z = 0 to 2 m."""
    x, z = np.meshgrid(np.arange(low_x, high_x, 0.05), np.arange(0, 2, 0.05))
    means = np.stack([x.ravel(), np.full(x.size, WALL_Y_M), z.ravel()], axis=1)
    quats = np.zeros((x.size, 4))
    quats[:, 0] = 1
    return GaussianMap(
        means=means.astype(np.float32),
        quats=quats.astype(np.float32),
        log_scales=np.tile(np.log(np.float32([0.05, 0.002, 0.05])), (x.size, 1)),
        logit_opacities=np.full(x.size, 6, np.float32),
        sh=np.zeros((x.size, 1, 3), np.float32),
    )


def share(space: SeenSpace, *points: tuple[float, float, float]) -> float:
    return space.free_share(np.array(points, np.float64))


@pytest.mark.parametrize(
    ("point", "free"),
    [
        ((0.0, 1.0, 1.0), True),
        ((0.0, WALL_Y_M - MARGIN_M - 0.03, 1.0), True),
        ((0.0, WALL_Y_M - MARGIN_M + 0.03, 1.0), False),  # It may be the wall itself.
        ((0.0, WALL_Y_M + 0.5, 1.0), False),
        ((0.0, -1.0, 1.0), False),  # Behind the camera,
        ((0.0, 0.0, 1.0), False),  # and in it.
        # The image reaches from x / y = -0.7 to 0.9, and down to z = 1 - 0.5 y.
        ((-0.65, 1.0, 1.0), True),
        ((-0.75, 1.0, 1.0), False),
        ((0.85, 1.0, 1.0), True),
        ((0.95, 1.0, 1.0), False),
        ((0.0, 1.0, 0.55), True),
        ((0.0, 1.0, 0.45), False),
    ],
)
def test_free_is_what_stands_before_a_surface(
    point: tuple[float, float, float], free: bool
) -> None:
    assert share(SeenSpace(wall(), [CAMERA]), point) == free


def test_where_the_map_shows_nothing_nothing_is_known() -> None:
    """Through a hole in the wall nobody knows how far the camera saw."""
    half = SeenSpace(wall(high_x=0.0), [CAMERA])
    assert share(half, (-0.3, 1.0, 1.0)) == 1
    assert share(half, (0.3, 1.0, 1.0)) == 0


def test_one_camera_that_saw_it_is_enough() -> None:
    beside = look_at(np.array([3.0, 0.0, 1.0]), np.array([3.0, -1.0, 1.0]))
    point = (0.0, 1.0, 1.0)
    for cameras in ([CAMERA, at_pose(CAMERA, beside)], [at_pose(CAMERA, beside), CAMERA]):
        assert share(SeenSpace(wall(), cameras), point) == 1
    assert share(SeenSpace(wall(), [at_pose(CAMERA, beside)]), point) == 0


def test_the_share_is_that_of_the_points() -> None:
    space = SeenSpace(wall(), iter([CAMERA]))
    assert share(space, (0, 1, 1), (0, 2.5, 1), (0.1, 1, 1), (0, -1, 1)) == 0.5


def test_without_cameras_everything_was_seen() -> None:
    assert share(SeenSpace(wall(), []), (0.0, 2.5, 1.0)) == 1
