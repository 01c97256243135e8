"""Tests of the robot's actions: destinations, obstacles and reports."""

from dataclasses import replace

import numpy as np
import pytest
import sim_scenes

from gslts.core.robot import Robot
from gslts.core.se3 import pose_distance
from gslts_sim import make_home
from gslts_sim.controller import Controller
from gslts_sim.robot_body import BODY, CAMERA_HEIGHT_M


@pytest.fixture
def controller() -> Controller:
    """Return a robot at (1, 1) in a room of 5 x 4 m with a block at 2.0..3.2 x 1.5..2.3."""
    controller = Controller(sim_scenes.simple_home(), width=64, height=48)
    assert go(controller, "Teleport", position={"x": 1.0, "y": 1.0}, rotation=0.0)
    return controller


def go(controller: Controller, action: str, **arguments: object) -> bool:
    return bool(controller.step(action, **arguments).metadata["lastActionSuccess"])


def position(controller: Controller) -> tuple[float, float, float]:
    agent = controller.last_event.metadata["agent"]
    return agent["position"]["x"], agent["position"]["y"], agent["rotation"]["z"]


def test_moves_end_at_their_destination(controller: Controller) -> None:
    assert go(controller, "MoveAhead")
    assert position(controller) == pytest.approx((1.25, 1.0, 0.0))
    assert go(controller, "MoveLeft")
    assert position(controller) == pytest.approx((1.25, 1.25, 0.0))
    assert go(controller, "RotateLeft")
    assert position(controller) == pytest.approx((1.25, 1.25, 90.0))
    assert go(controller, "MoveAhead", moveMagnitude=0.5)
    assert go(controller, "MoveRight")
    assert position(controller) == pytest.approx((1.5, 1.75, 90.0))
    assert go(controller, "RotateRight", degrees=45.0)
    assert go(controller, "MoveBack")
    back = 0.25 * np.sqrt(0.5)
    assert position(controller) == pytest.approx((1.5 - back, 1.75 - back, 45.0))


def test_walls_and_objects_stop_the_robot(controller: Controller) -> None:
    assert go(controller, "Teleport", position={"x": 1.5, "y": 2.0})
    assert not go(controller, "MoveAhead", moveMagnitude=0.5)  # Into the block.
    assert position(controller)[:2] == (1.5, 2.0)
    assert "MoveAhead: the path of 0.5 m is blocked" in str(
        controller.last_event.metadata["errorMessage"]
    )
    assert not go(controller, "MoveAhead", moveMagnitude=2.5)  # Through it.
    assert go(controller, "MoveBack", moveMagnitude=1.2)
    assert not go(controller, "MoveBack")  # Out of the room.
    assert not go(controller, "Teleport", position={"x": 2.6, "y": 2.0})
    assert "cannot stand at (2.6, 2)" in str(controller.last_event.metadata["errorMessage"])


def test_reachable_positions_are_those_of_the_free_floor(controller: Controller) -> None:
    result = controller.step("GetReachablePositions").metadata["actionReturn"]
    positions = np.array([(p["x"], p["y"]) for p in result])
    np.testing.assert_allclose(positions % 0.25, 0, atol=1e-9)
    outside = np.maximum(np.abs(positions - (2.6, 1.9)) - (0.6, 0.4), 0)
    gap = np.linalg.norm(outside, axis=1)
    to_wall = np.minimum(positions, (5, 4) - positions).min(axis=1)
    assert gap.min() >= BODY.radius_m - 0.05
    assert to_wall.min() >= BODY.radius_m - 0.05
    # The grid has 19 x 15 points inside the walls; the block and its margin take 7 x 5 at most.
    assert 19 * 15 - 7 * 5 <= len(positions) <= 19 * 15 - 4 * 3
    assert all(go(controller, "Teleport", position=p) for p in result[:: len(result) // 5])


def test_the_camera_points_along_the_robots_yaw(controller: Controller) -> None:
    def pose() -> np.ndarray:
        return np.asarray(controller.last_event.observation.camera.world_from_camera)

    np.testing.assert_allclose(pose()[:3, 3], (1, 1, CAMERA_HEIGHT_M), atol=1e-12)
    np.testing.assert_allclose(pose()[:3, 2], (1, 0, 0), atol=1e-12)
    assert go(controller, "RotateLeft")
    np.testing.assert_allclose(pose()[:3, 2], (0, 1, 0), atol=1e-12)
    assert go(controller, "LookDown")
    np.testing.assert_allclose(pose()[:3, 2], (0, np.sqrt(0.75), -0.5), atol=1e-12)
    assert go(controller, "LookDown")
    assert not go(controller, "LookDown")
    assert controller.last_event.metadata["agent"]["cameraHorizon"] == 60
    assert go(controller, "LookUp", degrees=70.0)
    assert controller.last_event.metadata["agent"]["cameraHorizon"] == -10


def test_an_event_shows_and_names_the_visible_objects(controller: Controller) -> None:
    event = controller.step("Teleport", position={"x": 1.25, "y": 2.0}, rotation=0.0, horizon=30.0)
    assert event.frame.shape == event.instance_segmentation_frame.shape == (48, 64, 3)
    assert event.depth_frame.shape == (48, 64)
    # The middle of the image is the top of the block, 0.75 m below the eye at 30 degrees down.
    assert event.depth_frame[24, 32] == pytest.approx(0.75 / np.sin(np.deg2rad(30)), rel=0.03)
    color = tuple(map(int, event.instance_segmentation_frame[24, 32]))
    assert event.color_to_object_id[color] == "Block|1"
    seen = {tuple(map(int, c)) for c in event.instance_segmentation_frame.reshape(-1, 3)}
    assert {event.color_to_object_id[color] for color in seen} == {"Block|1", "Wall|1"}
    kinds = {tuple(map(int, c)) for c in event.semantic_segmentation_frame.reshape(-1, 3)}
    assert {event.color_to_object_id[color] for color in kinds} == {"Block", "Wall"}
    assert set(event.instance_masks) == {"Block|1", "Wall|1"}
    assert event.instance_masks["Block|1"][24, 32]
    by_id = {obj["objectId"]: obj for obj in event.metadata["objects"]}
    block = by_id["Block|1"]
    assert block["objectType"] == "Block"
    assert block["visible"]
    assert block["axisAlignedBoundingBox"]["center"] == pytest.approx(
        {"x": 2.6, "y": 1.9, "z": 0.375}
    )
    assert block["axisAlignedBoundingBox"]["size"] == pytest.approx({"x": 1.2, "y": 0.8, "z": 0.75})
    away = controller.step("Teleport", rotation=180.0, horizon=0.0)
    by_id = {obj["objectId"]: obj for obj in away.metadata["objects"]}
    assert not by_id["Block|1"]["visible"]
    assert by_id["Wall|1"]["visible"]


def test_it_is_a_robot(controller: Controller) -> None:
    robot: Robot = controller
    assert robot.observe().rgb.shape == (48, 64, 3)
    positions = robot.reachable_positions()
    assert robot.move_towards(np.array([4.1, 3.3]), np.pi / 2)
    robot.observe()
    assert position(controller)[:2] in {tuple(p) for p in positions.tolist()}
    assert position(controller) == pytest.approx((4.0, 3.25, 90.0), abs=0.26)
    np.testing.assert_array_equal(robot.pose(), robot.observe().camera.world_from_camera)


def test_the_believed_pose_has_noise_and_takes_no_frame() -> None:
    home = sim_scenes.simple_home()
    exact, asked, silent = (
        Controller(home, width=32, height=24, noise=noise) for noise in ("none", "kinect", "kinect")
    )
    pose = asked.pose()
    np.testing.assert_array_equal(pose, asked.pose())
    error_m, error_rad = pose_distance(exact.pose(), pose)
    assert 0 < error_m < 0.1
    assert 0 < error_rad < 0.1
    np.testing.assert_array_equal(asked.observe().rgb, silent.observe().rgb)


def test_it_tilts_down_to_its_limit(controller: Controller) -> None:
    for pitch_rad, expected in (
        (0.5, np.rad2deg(0.5)),
        (None, np.rad2deg(0.5)),
        (1.5, 60),
        (-1, -30),
    ):
        assert controller.move_towards(np.array([4.0, 3.25]), 0.0, pitch_rad)
        event = controller.step("Pass")
        assert event.metadata["agent"]["cameraHorizon"] == pytest.approx(expected)


def test_bad_actions_are_named(controller: Controller) -> None:
    with pytest.raises(ValueError, match=r"action must be one of 'MoveAhead', .*, got 'Fly'"):
        controller.step("Fly")
    with pytest.raises(ValueError, match=r"MoveAhead: speed: Extra inputs"):
        controller.step("MoveAhead", speed=3)


def test_a_full_room_is_rejected() -> None:
    home = sim_scenes.simple_home()
    full = sim_scenes.box_object("Block|2", (0, 0, 0), (5, 4, 1.0), sim_scenes.plain(90))
    with pytest.raises(ValueError, match="simple: the robot can stand nowhere"):
        Controller(home.with_object(full))


@pytest.mark.parametrize(
    ("action", "arguments", "message"),
    [
        ("Teleport", {"rotation": float("nan")}, "rotation: .*finite"),
        ("Teleport", {"position": {"x": "1", "y": 1.0}}, "position.x: .*valid number"),
        ("RotateLeft", {"degrees": float("inf")}, "degrees: .*finite"),
        ("MoveAhead", {"moveMagnitude": 1e9}, "moveMagnitude: .*less than or equal to 100"),
        ("MoveAhead", {"moveMagnitude": float("nan")}, "moveMagnitude: .*finite"),
        ("LookUp", {"degrees": None}, "degrees: .*valid number"),
        ("InitialRandomSpawn", {"randomSeed": None}, "randomSeed: .*valid integer"),
        ("InitialRandomSpawn", {"randomSeed": -1}, "randomSeed: .*greater than or equal to 0"),
        ("DisableObject", {}, "objectId: Field required"),
        ("Pass", {"name": "x"}, "name: Extra inputs"),
    ],
)
def test_invalid_arguments_are_named_and_change_nothing(
    controller: Controller, action: str, arguments: dict[str, object], message: str
) -> None:
    before = position(controller)
    with pytest.raises(ValueError, match=f"{action}: {message}") as error:
        controller.step(action, **arguments)
    assert "\n" not in str(error.value)
    controller.step("Pass")
    assert position(controller) == before


def test_spawns_keep_the_robots_position_free() -> None:
    home = make_home("bedroom", 1, detail=0.05)
    for seed in range(5):
        controller = Controller(home, width=16, height=16)
        assert go(controller, "InitialRandomSpawn", randomSeed=seed)
        agent = controller.last_event.metadata["agent"]["position"]
        assert go(controller, "Teleport", position={"x": agent["x"], "y": agent["y"]})
        assert controller.home is not home


def test_a_distant_object_does_not_block_the_robot() -> None:
    """Removing a distant block makes another part of the floor larger than the robot's."""
    home = sim_scenes.simple_home()
    walls = [
        replace(
            sim_scenes.box_object(f"Block|{k}", (x, 0, 0), (x + 0.2, 4, 1.0), sim_scenes.plain(90)),
            movable=True,
        )
        for k, x in ((2, 1.9), (3, 3.4))
    ]
    home = home.without(["Block|1"])
    for wall in walls:
        home = home.with_object(wall)
    controller = Controller(home, width=16, height=16)
    assert go(controller, "Teleport", position={"x": 1.0, "y": 2.0})
    first = controller.reachable_positions()
    assert (first[:, 0] < 1.9).all()
    assert go(controller, "DisableObject", objectId="Block|3")
    np.testing.assert_array_equal(controller.reachable_positions(), first)


def test_frames_do_not_keep_the_samples_of_the_rendering() -> None:
    labels = Controller(sim_scenes.simple_home(), width=64, height=48).observe().labels
    assert labels is not None
    assert labels.instances.flags.owndata
