"""Trips in a map: which positions a robot goes to, and what it costs to choose them."""

import tracemalloc
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import surfel_room

from gslts.core.camera import camera_from_fov, look_at
from gslts.core.frame import RgbdFrame
from gslts.core.robot_body import RobotBody
from gslts.navigation.semantic_map import SemanticMap, make_semantic_map
from gslts.navigation.terrain import Terrain
from gslts.navigation.trip import (
    MAX_VIEWPOINTS,
    MAX_VIEWS,
    SEARCHED_M,
    NavigationResult,
    Trip,
)
from gslts.navigation.viewpoints import MAX_POINTS, Target, TargetView, ViewpointRenderer
from gslts.robots.in_map import MapRobot
from gslts.types import Floats

BODY = RobotBody()
MUG = (2.2, 1.4, 0.75), (2.35, 1.55, 0.9)


@cache
def semantic_map() -> SemanticMap:
    return make_semantic_map(surfel_room.surfel_map(), BODY)


def trip(robot: type[MapRobot], start: tuple[float, float, float] = (0.5, 1.5, 1.2)) -> Trip:
    """Return a trip of a robot that sees the map."""
    room, eye = surfel_room.surfel_map(), np.array(start)
    camera = camera_from_fov(160, 120, 1.2, look_at(eye, eye + np.array([1.0, 0.0, -0.3])))
    driven = robot(room, semantic_map(), BODY, camera, threads=1)
    return Trip(driven, "mug", room, Terrain(semantic_map(), BODY), None, lambda: None)


class BlindRobot(MapRobot):
    """Finds nothing: its frames are lost."""

    def observe(self) -> RgbdFrame:
        return replace(super().observe(), fault="lost: 3 matches")


def mug() -> Target:
    return Target.in_box(surfel_room.surfel_map(), MUG)


def searched(found: NavigationResult) -> Floats:
    """Return [V,2] positions at which the robot turned twice."""
    moved = np.linalg.norm(np.diff(found.path, axis=0), axis=1) > 1e-9
    stood = np.flatnonzero(~moved[1:] & ~moved[:-1])
    return np.unique(found.path[stood], axis=0)


def test_a_robot_finds_what_the_map_shows() -> None:
    assert trip(MapRobot).go_to_any([mug()]).status == "reached"


def test_after_a_search_the_robot_searches_from_elsewhere() -> None:
    found = trip(BlindRobot).go_to_any([mug()])
    assert (found.status, found.reason) == ("not found", "no mug is where the map has one")
    positions = searched(found)
    assert 1 < len(positions) <= MAX_VIEWPOINTS
    offsets_m = np.linalg.norm(positions[:, None] - positions[None], axis=2)
    assert offsets_m[~np.eye(len(positions), dtype=bool)].min() >= SEARCHED_M


def test_a_robot_on_another_storey_has_lost_track() -> None:
    found = trip(MapRobot, (0.5, 1.5, 4.2)).go_to_any([mug()])
    assert found.status == "lost track"
    assert found.reason.startswith("the map has no floor around (0.5")
    assert found.reason.endswith("within 2 m below the camera at z = 4.20 m")


def test_what_nothing_sees_costs_a_bounded_number_of_renderings(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    views, measured = [], []
    view, distances_m = ViewpointRenderer.view, Target.distances_m

    def counted_view(self: ViewpointRenderer, position: Floats, target: Target) -> TargetView:
        views.append(position)
        return view(self, position, target)

    def counted_distances_m(self: Target, positions: Floats, *others: float) -> Floats:
        measured.append(len(positions))
        return distances_m(self, positions, *others)

    monkeypatch.setattr(ViewpointRenderer, "view", counted_view)
    monkeypatch.setattr(Target, "distances_m", counted_distances_m)
    below_floor = np.array([0.8, 1.5, -0.5]) + np.random.default_rng(0).normal(0, 0.03, (50, 3))
    found = trip(MapRobot).go_to_any([Target(below_floor)])
    assert (found.status, found.reason) == (
        "unreachable",
        "there is no path to a position within 1 m of any mug from which it is visible",
    )
    assert 0 < len(views) <= 100 < MAX_VIEWS
    assert len(measured) == 1
    views.clear()
    # Below all of the floor, so that more positions are near it.
    x, y = np.meshgrid(np.arange(0, 4, 0.1), np.arange(0, 3, 0.1))
    wide = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, -0.5)])
    found = trip(MapRobot).go_to_any([Target(wide), Target(below_floor)])
    assert found.status == "unreachable"
    assert len(views) <= MAX_VIEWS + 100


def test_a_goal_stays_one_when_another_path_leads_to_it(monkeypatch: pytest.MonkeyPatch) -> None:
    class CarriedRobot(BlindRobot):
        """Is on the other side of the mug after its first move."""

        moves = 0

        def move_towards(
            self, position: Floats, yaw_rad: float, pitch_rad: float | None = None
        ) -> bool:
            self.moves += 1
            to = np.array([3.5, 1.5]) if self.moves == 1 else position
            return super().move_towards(to, yaw_rad, pitch_rad)

    views: list[Floats] = []

    def view_at_the_first_position(_: object, position: Floats, target: Target) -> TargetView:
        views.append(position)
        visible = np.full(len(target.points), np.array_equal(position, views[0]))
        return TargetView(0.0, 0.3, visible)

    monkeypatch.setattr(ViewpointRenderer, "view", view_at_the_first_position)
    found = trip(CarriedRobot).go_to_any([mug()])
    assert len(views) > 1
    assert (found.status, found.replans) == ("not found", 1)  # It has searched there.
    np.testing.assert_allclose(searched(found), views[:1])


def test_distances_are_those_of_the_nearest_point() -> None:
    rng = np.random.default_rng(0)
    shift = np.array([1e4, -2e4, 0])
    target = Target(rng.uniform(0, 0.5, (MAX_POINTS, 3)) + shift)
    positions = rng.uniform(-15, 15, (20_000, 2)) + shift[:2]
    tracemalloc.start()
    try:
        distances_m = target.distances_m(positions)
        near_m = target.distances_m(positions, 1.0)
        assert tracemalloc.get_traced_memory()[1] < 200 * len(positions)
    finally:
        tracemalloc.stop()
    expected = np.array(
        [np.linalg.norm(target.points[:, :2] - position, axis=1).min() for position in positions]
    )
    np.testing.assert_allclose(distances_m, expected, atol=1e-5)
    is_near = expected < 1.0
    np.testing.assert_allclose(near_m[is_near], expected[is_near], atol=1e-5)
    assert (near_m[~is_near] > 1.0 - 1e-5).all()
    assert target.distances_m(positions[:0]).shape == (0,)
    post = Target(np.column_stack([np.ones((50, 2)), np.linspace(0, 1, 50)]))
    np.testing.assert_allclose(post.distances_m(np.array([[1.0, 3.0], [1.0, 1.0]])), [2, 0])


@pytest.mark.parametrize("count", [1, MAX_POINTS, MAX_POINTS + 1, 2 * MAX_POINTS - 1, 1000])
def test_targets_have_a_bounded_number_of_points(count: int) -> None:
    means = np.random.default_rng(0).uniform(0.1, 0.9, (count, 3))
    cloud = surfel_room.gaussians(means, np.full((count, 3), 0.01), [""] * count)
    points = Target.in_box(cloud, ((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))).points
    assert min(count, MAX_POINTS // 2) <= len(points) <= MAX_POINTS
