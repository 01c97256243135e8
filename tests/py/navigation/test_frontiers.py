"""Exploration without a map: which floor is free, and goals until nothing is left to see."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pytest

from gslts.core.camera import Camera, at_pose, look_at
from gslts.core.frame import RgbdFrame
from gslts.core.robot_body import RobotBody
from gslts.keeper.exploration import RINGS
from gslts.navigation.frontiers import REPEAT_M, SPACING_M, FrontierExplorer
from gslts.navigation.observed_floor import ObservedFloor
from gslts.navigation.planner import distance_field_m
from gslts.types import Bools, Floats
from gslts_sim.controller import Controller
from gslts_sim.home_source import open_home
from gslts_sim.walkable import floor_of

BODY = RobotBody()
EYE_M = 1.5
ORIGIN = np.zeros(2)


def explorer(robot: Controller, side_m: float = 30.0) -> FrontierExplorer:
    floor_m = float(robot.home.space.box[0, 2])
    return FrontierExplorer(ObservedFloor(robot.pose()[:2, 3], floor_m, BODY, side_m), BODY)


def small_robot(room: str, seed: int) -> Controller:
    return Controller(open_home(room, seed), width=160, height=120, noise="none")


def explore(robot: Controller, own: FrontierExplorer) -> list[RgbdFrame]:
    """Look around at all goals, as a robot on its first visit; return the frames."""
    frames, position = [], robot.pose()[:2, 3]
    while True:
        for count, pitch_rad in RINGS:
            for number in range(count):
                if robot.move_towards(position, 2 * np.pi * number / count, float(pitch_rad)):
                    frames.append(robot.observe())
                    own.floor.add(frames[-1])
        goal = own.next_goal(robot.pose()[:2, 3])
        if goal is None:
            return frames
        position = goal.position
        if not robot.move_towards(position, goal.yaw_rad):
            own.block(position)


def at(mask: Bools, floor: ObservedFloor, points: Floats) -> Bools:
    cells = floor.grid.cells(points)
    inside = floor.grid.contains(cells)
    values: Bools = inside & mask[tuple(np.where(inside[:, None], cells, 0).T)]
    return values


@pytest.mark.parametrize(
    ("room", "seed", "max_frames"), [("living_room", 3, 200), ("kitchen", 3, 150)]
)
def test_a_robot_explores_all_floor_that_it_can_reach(
    room: str, seed: int, max_frames: int
) -> None:
    robot = small_robot(room, seed)
    own = explorer(robot)
    frames = explore(robot, own)
    truth = floor_of(robot.home)
    rows, columns = np.nonzero(truth.largest)
    reachable = truth.origin + truth.cell_m * np.column_stack([columns, rows])
    known = own.floor.semantic_map
    assert at(known.explored & ~known.obstacles, own.floor, reachable).mean() > 0.95
    assert at(own.free(), own.floor, reachable).mean() > 0.95
    # Views from near of all of it, without a crowd of them.
    positions = np.array([frame.camera.world_from_camera[:2, 3] for frame in frames])
    offsets_m = np.linalg.norm(reachable[:, None] - positions[None], axis=2).min(axis=1)
    assert np.quantile(offsets_m, 0.95) < SPACING_M + 0.2  # The robot stands on a grid of 0.25 m.
    assert len(frames) <= max_frames


def test_floor_that_the_robot_does_not_reach_is_given_up() -> None:
    class FencedRobot(Controller):
        """Arrives nowhere beyond a fence that no camera sees."""

        def move_towards(
            self, position: Floats, yaw_rad: float, pitch_rad: float | None = None
        ) -> bool:
            return position[0] < fence_m and super().move_towards(position, yaw_rad, pitch_rad)

    robot = FencedRobot(open_home("kitchen", 3), width=160, height=120, noise="none")
    fence_m = float(robot.pose()[0, 3]) + 0.3
    frames = explore(robot, explorer(robot))
    assert 12 <= len(frames) < 150
    assert max(frame.camera.world_from_camera[0, 3] for frame in frames) < fence_m + 0.2


def test_exploration_stays_in_its_square() -> None:
    robot = small_robot("living_room", 3)
    own = explorer(robot, side_m=2.0)
    start = robot.pose()[:2, 3]
    frames = explore(robot, own)
    offsets_m = [abs(frame.camera.world_from_camera[:2, 3] - start).max() for frame in frames]
    assert max(offsets_m) < 1.0 + 0.2
    assert own.floor.semantic_map.layers.shape == (2, 40, 40)


def camera(yaw_rad: float, down_rad: float = 0.6) -> Camera:
    eye = np.array([0.0, 0.0, EYE_M])
    cosine = np.cos(down_rad)
    forward = [np.cos(yaw_rad) * cosine, np.sin(yaw_rad) * cosine, -np.sin(down_rad)]
    return Camera(
        fx=80.0,
        fy=80.0,
        cx=80.0,
        cy=60.0,
        width=160,
        height=120,
        world_from_camera=look_at(eye, eye + np.array(forward)),
    )


def floor_frame(view: Camera, drop_x_m: float = np.inf, wall_x_m: float = np.inf) -> RgbdFrame:
    """Return a frame of a floor at z = 0 that drops by 1 m, or ends at a wall, at some x."""
    rows, columns = np.indices((view.height, view.width)) + 0.5
    rays = np.stack(
        [(columns - view.cx) / view.fx, (rows - view.cy) / view.fy, np.ones(rows.shape)], axis=-1
    )
    rays = rays @ view.world_from_camera[:3, :3].T
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = np.where(rays[..., 2] < 0, -EYE_M / rays[..., 2], 0.0)
        lower = np.where(rays[..., 2] < 0, -(EYE_M + 1) / rays[..., 2], 0.0)
        depth = np.where(depth * rays[..., 0] > drop_x_m, lower, depth)
        to_wall = np.where(rays[..., 0] > 0, wall_x_m / rays[..., 0], np.inf)
    depth = np.minimum(depth, np.where(np.isfinite(to_wall), to_wall, np.inf))
    return RgbdFrame(
        np.zeros((view.height, view.width, 3), np.uint8), depth.astype(np.float32), view
    )


def observed(frames: Iterable[RgbdFrame]) -> ObservedFloor:
    floor = ObservedFloor(ORIGIN, 0.0, BODY, 8.0)
    for frame in frames:
        floor.add(frame)
    return floor


def value(floor: ObservedFloor, x: float, y: float) -> str:
    known, point = floor.semantic_map, np.array([[x, y]])
    if at(known.obstacles, floor, point)[0]:
        return "obstacle"
    return "free" if at(known.explored, floor, point)[0] else "unknown"


def test_floor_is_free_and_a_wall_is_an_obstacle() -> None:
    floor = observed([floor_frame(camera(0.0), wall_x_m=2.02)])
    assert [value(floor, x, 0.0) for x in (0.0, 1.5, 2.02, 2.5, -1.0)] == [
        "free",
        "free",
        "obstacle",
        "unknown",
        "unknown",
    ]


def test_floor_beyond_a_drop_stays_unknown() -> None:
    floor = observed([floor_frame(camera(0.0), drop_x_m=1.5)])
    assert [value(floor, x, 0.0) for x in (1.2, 1.7, 2.5)] == ["free", "unknown", "unknown"]


def test_what_has_passed_is_forgotten() -> None:
    passing, gone = floor_frame(camera(0.0), wall_x_m=2.02), floor_frame(camera(0.0))
    assert value(observed([passing]), 2.02, 0.0) == "obstacle"
    assert value(observed([gone, passing]), 2.02, 0.0) == "free"
    assert value(observed([passing] * 50 + [gone] * 4), 2.02, 0.0) == "free"
    assert value(observed([gone] * 50 + [passing] * 4), 2.02, 0.0) == "obstacle"


def test_a_frame_with_a_fault_changes_nothing() -> None:
    frame = floor_frame(camera(0.0))
    broken = RgbdFrame(frame.rgb, frame.depth, frame.camera, fault="the pose is unknown")
    assert not observed([broken]).semantic_map.explored.any()


def test_a_robot_that_sees_no_floor_is_told_why() -> None:
    floor = ObservedFloor(ORIGIN, -1.0, BODY, 8.0)
    floor.add(floor_frame(camera(0.0)))
    with pytest.raises(ValueError, match=r"no floor at height -1\.00 m is seen within 1\.5 m"):
        FrontierExplorer(floor, BODY).next_goal(ORIGIN)


def test_the_nearest_frontier_comes_first_and_no_goal_twice() -> None:
    # All around there is floor, of which the camera sees none beyond its range.
    floor = observed(floor_frame(camera(yaw)) for yaw in np.arange(8) * np.pi / 4)
    own = FrontierExplorer(floor, BODY)
    goals = [own.next_goal(ORIGIN)]
    while goals[-1] is not None:
        goals.append(own.next_goal(ORIGIN))
    positions = np.array([goal.position for goal in goals if goal is not None])
    offsets_m = np.linalg.norm(positions[:, None] - positions[None], axis=2)
    assert offsets_m[~np.eye(len(positions), dtype=bool)].min() > REPEAT_M
    assert any(goal is not None and goal.is_frontier for goal in goals)
    for goal in goals:
        if goal is not None and goal.is_frontier:  # It looks outwards, where nothing is known.
            outwards = goal.position / np.linalg.norm(goal.position)
            assert outwards @ [np.cos(goal.yaw_rad), np.sin(goal.yaw_rad)] > 0


def seen_at(x_m: float, y_m: float = 0.0) -> RgbdFrame:
    frame = floor_frame(camera(0.0))
    pose = frame.camera.world_from_camera.copy()
    pose[:2, 3] = x_m, y_m
    return replace(frame, camera=at_pose(frame.camera, pose))


def test_the_path_of_the_robot_stays_free() -> None:
    """It can drive back where it drove, whatever a gap looks like from afar."""

    floor = observed(map(seen_at, (0.0, 0.4, 0.8)))
    path = np.column_stack([np.linspace(0.02, 0.78, 20), np.full(20, 0.02)])
    beside = path + np.array([0.0, 0.15])
    assert at(floor.driven, floor, path).all()
    assert not at(floor.driven, floor, beside).any()
    for _ in range(8):
        floor.add(floor_frame(camera(0.0), wall_x_m=0.5))
    free = FrontierExplorer(floor, BODY).free()
    assert at(free, floor, path).all()
    assert not at(free, floor, beside).all()
    # Carried away, it leaves no path.
    floor.add(seen_at(-1.5))
    assert not at(floor.driven, floor, np.array([[-0.7, 0.02]]))[0]


def test_a_robot_that_drove_askew_can_drive_back() -> None:
    """Paths do not pass between cells that touch at a corner."""
    floor = observed(seen_at(share, 0.7 * share) for share in (0.0, 0.4, 0.8))
    end = floor.grid.cells_within(np.array([0.8, 0.56]), floor.grid.cell_m)
    lengths_m = distance_field_m(floor.driven, end, floor.grid.cell_m)
    assert np.isfinite(lengths_m[floor.driven]).all()


@pytest.mark.parametrize("radius_m", [0.2, 0.58, 0.8, 0.9])
def test_robots_of_any_size_face_what_is_unknown(radius_m: float) -> None:
    body = RobotBody(radius_m=radius_m)
    floor = ObservedFloor(ORIGIN, 0.0, body)
    floor.assume_free(ORIGIN, 7.0)
    goal = FrontierExplorer(floor, body, spacing_m=50.0).next_goal(ORIGIN)
    assert goal is not None
    assert goal.is_frontier
    outwards = np.array([np.cos(goal.yaw_rad), np.sin(goal.yaw_rad)])
    assert outwards @ goal.position > 0.8 * np.linalg.norm(goal.position)
