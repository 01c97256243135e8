"""Visibility counts for a wall 2 m ahead, made by hand."""

from dataclasses import replace

import numpy as np
import pytest

from gslts.change import visibility
from gslts.change.visibility import Visibility
from gslts.core.camera import Camera, TrainingCamera, at_pose, look_at
from gslts.core.gaussian_map import GaussianMap
from gslts.core.surface_margin import SURFACE_MARGIN_M, SURFACE_MARGIN_SHARE

WALL_Y_M = 2.0
FIRST_Y_M = (WALL_Y_M - SURFACE_MARGIN_M) / (1 + SURFACE_MARGIN_SHARE)
LAST_Y_M = (WALL_Y_M + SURFACE_MARGIN_M) / (1 - SURFACE_MARGIN_SHARE)
"""Depths between which a point is on the wall, m."""
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
    """Return opaque flat Gaussians in the plane y = 2 m, from z = 0 to 2 m."""
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


def counts_at(space: Visibility, *points: tuple[float, float, float]) -> list[tuple[int, int]]:
    """Return for each point how many cameras saw through it and how many saw a surface."""
    counts = space.counts(np.array(points, np.float64).reshape(-1, 3))
    assert counts.through.shape == counts.on.shape == (len(points),)
    return list(zip(counts.through.tolist(), counts.on.tolist(), strict=True))


BEFORE, ON, UNSEEN = (1, 0), (0, 1), (0, 0)


@pytest.mark.parametrize(
    ("point", "expected"),
    [
        ((0.0, 1.0, 1.0), BEFORE),
        ((0.0, FIRST_Y_M - 0.01, 1.0), BEFORE),
        ((0.0, FIRST_Y_M + 0.01, 1.0), ON),  # It may be the wall itself.
        ((0.0, WALL_Y_M, 1.0), ON),
        ((0.3, WALL_Y_M, 0.7), ON),
        ((0.0, LAST_Y_M - 0.01, 1.0), ON),
        ((0.0, LAST_Y_M + 0.01, 1.0), UNSEEN),
        ((0.0, WALL_Y_M + 0.5, 1.0), UNSEEN),
        ((0.0, -1.0, 1.0), UNSEEN),  # Behind the camera,
        ((0.0, -WALL_Y_M, 1.0), UNSEEN),  # as far as the wall is before it,
        ((0.0, -0.01, 1.0), UNSEEN),  # just behind it,
        ((0.0, 0.0, 1.0), UNSEEN),  # and in it.
        # The image reaches from x / y = -0.7 to 0.9, and down to z = 1 - 0.5 y.
        ((-0.695, 1.0, 1.0), BEFORE),
        ((-0.705, 1.0, 1.0), UNSEEN),
        ((0.895, 1.0, 1.0), BEFORE),
        ((0.905, 1.0, 1.0), UNSEEN),
        ((0.0, 1.0, 0.505), BEFORE),
        ((0.0, 1.0, 0.495), UNSEEN),
        ((-1.39, WALL_Y_M, 1.0), ON),
        ((-1.41, WALL_Y_M, 1.0), UNSEEN),
        ((0.0, WALL_Y_M, 0.05), ON),
        ((0.0, WALL_Y_M, -0.05), UNSEEN),
    ],
)
def test_cameras_see_through_points_before_a_surface(
    point: tuple[float, float, float], expected: tuple[int, int]
) -> None:
    assert counts_at(Visibility(wall(), [CAMERA]), point) == [expected]


@pytest.mark.parametrize("distance_m", [0.6, 1.0, 1.7])
def test_the_margin_grows_with_the_distance(distance_m: float) -> None:
    """A camera nearer to the wall has a smaller margin."""
    eye = np.array([0.0, WALL_Y_M - distance_m, 1.0])
    nearer = Visibility(wall(), [at_pose(CAMERA, look_at(eye, np.array([0.0, WALL_Y_M, 1.0])))])
    first = WALL_Y_M - distance_m + (distance_m - SURFACE_MARGIN_M) / (1 + SURFACE_MARGIN_SHARE)
    last = WALL_Y_M - distance_m + (distance_m + SURFACE_MARGIN_M) / (1 - SURFACE_MARGIN_SHARE)
    places = (first - 0.008, first + 0.008, last - 0.008, last + 0.008)
    points = [(0.0, y, 1.0) for y in places]
    assert counts_at(nearer, *points) == [BEFORE, ON, ON, UNSEEN]


def test_cameras_do_not_see_through_holes_of_the_map() -> None:
    """Behind a hole in the wall, the range of the camera is unknown."""
    half = Visibility(wall(high_x=0.0), [CAMERA])
    places = ((-0.3, 1.0, 1.0), (0.3, 1.0, 1.0), (-0.3, WALL_Y_M, 1.0), (0.3, WALL_Y_M, 1.0))
    assert counts_at(half, *places) == [BEFORE, UNSEEN, ON, UNSEEN]


def test_each_camera_counts_each_point() -> None:
    """Test cameras at the left, at the right and in the middle of the wall, and one turned away."""
    left, right = (
        at_pose(CAMERA, look_at(np.array([x, 0.0, 1.0]), np.array([x, 1.0, 1.0])))
        for x in (-0.5, 0.5)
    )
    away = at_pose(CAMERA, look_at(np.array([0.0, 0.0, 1.0]), np.array([0.0, -1.0, 1.0])))
    cameras = [left, right, CAMERA, away]
    points = [
        (0.0, 1.0, 1.0),  # Before the wall, for all but the last;
        (0.0, WALL_Y_M, 1.0),  # on it,
        (0.0, WALL_Y_M + 0.5, 1.0),  # and behind it.
        (-1.0, 1.0, 1.0),  # At x / y = -0.5 for the left one, and out of the image for the others.
        (-1.8, WALL_Y_M, 1.0),
        (1.0, 1.0, 1.0),  # For the right one, and out of the image for the others.
        (0.0, 0.0, 3.0),  # Above all.
    ]
    expected = [(3, 0), (0, 3), (0, 0), (1, 0), (0, 1), (1, 0), (0, 0)]
    assert counts_at(Visibility(wall(), cameras), *points) == expected
    assert counts_at(Visibility(wall(), reversed(cameras)), *points) == expected
    assert counts_at(Visibility(wall(), [away]), *points) == [UNSEEN] * len(points)


def test_one_camera_may_see_through_a_point_and_another_see_it() -> None:
    """From 2.5 m away a point 9 cm off the wall is clear of it, and from 9 m it is not."""
    far, behind = (
        at_pose(CAMERA, look_at(np.array([0.0, y, 1.0]), np.array([0.0, WALL_Y_M, 1.0])))
        for y in (WALL_Y_M - 9, WALL_Y_M + 2.5)
    )
    space = Visibility(wall(), [CAMERA, far, behind])
    points = [(0.0, y, 1.0) for y in (1.0, WALL_Y_M - 0.09, WALL_Y_M, WALL_Y_M + 1)]
    assert counts_at(space, *points) == [(2, 0), (1, 1), (0, 3), (1, 0)]


def test_counts_do_not_depend_on_the_image_size() -> None:
    """Depth images are 160 px wide whatever the camera."""
    large = Camera(
        fx=300,
        fy=360,
        cx=210,
        cy=180,
        width=480,
        height=360,
        world_from_camera=CAMERA.world_from_camera,
    )
    rng = np.random.default_rng(0)
    points = rng.uniform((-2, -1, -0.5), (2, 3, 2.5), (2000, 3))
    small, other = (Visibility(wall(), [camera]).counts(points) for camera in (CAMERA, large))
    np.testing.assert_array_equal(small.through, other.through)
    np.testing.assert_array_equal(small.on, other.on)
    assert small.through.sum() > 50
    assert small.on.sum() > 10


def test_cameras_are_read_once() -> None:
    space = Visibility(wall(), iter([CAMERA]))
    assert space.has_cameras
    assert counts_at(space, (0, 1, 1), (0, 2.5, 1), (0.1, 2, 1), (0, -1, 1)) == [
        BEFORE,
        UNSEEN,
        ON,
        UNSEEN,
    ]
    assert counts_at(space) == []


def test_without_cameras_all_counts_are_zero() -> None:
    nobody = Visibility(wall(), [])
    assert not nobody.has_cameras
    assert counts_at(nobody, (0.0, 1.0, 1.0), (0.0, WALL_Y_M, 1.0)) == [UNSEEN, UNSEEN]


def test_many_points_are_tested_in_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    points = np.random.default_rng(0).uniform((-1, 0.5, 0), (1, 2.5, 2), (500, 3))
    space = Visibility(wall(), [CAMERA, at_pose(CAMERA, look_at((0.5, 0.2, 1), (0, 2, 1)))])
    once, shown = space.counts(points), space.visible(points, 1.9)
    assert once.through.any()
    assert shown.any()
    monkeypatch.setattr(visibility, "MAX_PROJECTIONS", 64)
    assert len(space._parts(points)) > 10
    again = space.counts(points)
    np.testing.assert_array_equal(again.through, once.through)
    np.testing.assert_array_equal(again.on, once.on)
    np.testing.assert_array_equal(space.visible(points, 1.9), shown)


def opened_door() -> tuple[GaussianMap, int]:
    """Return the wall without a door of 0.8 x 1.2 m, and a newer wall 2 m behind it.

    The second value is greater than the ids of the wall with the door.
    """
    front, behind = wall(), wall()
    x, _, z = front.means.T
    kept = front.select((np.abs(x) > 0.4) | (z < 0.4) | (z > 1.6))
    behind = replace(behind, means=behind.means + np.float32([0, 2, 0]))
    names = ("means", "quats", "log_scales", "logit_opacities", "sh")
    arrays = {name: np.concatenate([getattr(kept, name), getattr(behind, name)]) for name in names}
    ids = np.concatenate([kept.ids, front.size + behind.ids])
    return GaussianMap(**arrays, ids=ids), front.size


BEHIND_DOOR = ((0.0, 2.5, 1.0), (0.0, 4.0, 1.0))


@pytest.mark.parametrize(
    ("point", "now"), [(BEHIND_DOOR[0], BEFORE), (BEHIND_DOOR[1], ON)], ids=["space", "surface"]
)
def test_a_camera_saw_nothing_behind_a_door_that_opened_later(
    point: tuple[float, float, float], now: tuple[int, int]
) -> None:
    gaussian_map, next_id = opened_door()
    before = Visibility(gaussian_map, [TrainingCamera(CAMERA, next_id)], 1)
    assert counts_at(before, point) == [UNSEEN]
    assert not before.visible(np.array([point]), 9.0).any()
    after = TrainingCamera(CAMERA, int(gaussian_map.ids.max()) + 1)
    for camera in (after, CAMERA):
        assert counts_at(Visibility(gaussian_map, [camera], 1), point) == [now]


def test_a_camera_knows_what_was_before_the_door() -> None:
    gaussian_map, next_id = opened_door()
    space = Visibility(gaussian_map, [TrainingCamera(CAMERA, next_id)], 1)
    wall_beside, in_the_door = (0.6, WALL_Y_M, 1.0), (0.0, WALL_Y_M, 1.0)
    points = ((0.0, 1.0, 1.0), wall_beside, in_the_door)
    assert counts_at(space, *points) == [BEFORE, ON, BEFORE]


def test_a_camera_knows_the_space_of_an_object_that_came_later() -> None:
    cup = replace(wall(-0.2, 0.2), means=wall(-0.2, 0.2).means - np.float32([0, 0.5, 0]))
    names = ("means", "quats", "log_scales", "logit_opacities", "sh")
    arrays = {
        name: np.concatenate([getattr(part, name) for part in (wall(), cup)]) for name in names
    }
    space = Visibility(GaussianMap(**arrays), [TrainingCamera(CAMERA, wall().size)], 1)
    assert counts_at(space, (0.0, 1.5, 1.0), (0.0, 1.0, 1.0)) == [ON, BEFORE]
