"""Tests of the AI2-THOR adapter, with ai2thor's own controller and event classes."""

import socket
import sys
from pathlib import Path

import numpy as np
import pytest
from unity_stand_in import FAR_M, StandInController, UnityStandIn, unity_rotation

from gslts.core.camera import Camera
from gslts.core.robot import Robot
from gslts_sim.thor import frame as thor_frame
from gslts_sim.thor.event import camera_of, frame_of, instances_of, objects_of
from gslts_sim.thor.robot import ThorRobot, start_thor

POSES = [(0, 0), (90, 0), (180, 30), (270, -30), (37.5, 12.5), (301.25, 60)]


@pytest.fixture
def controller() -> StandInController:
    """Return a controller at (1, 0.9, -2) in Unity's frame, facing its z; images of 64 x 48."""
    return StandInController(scene="FloorPlan1", width=64, height=48)


@pytest.fixture
def unity(controller: StandInController) -> UnityStandIn:
    return controller.server


def seen_at(camera: Camera, point: np.ndarray) -> np.ndarray:
    """Return column and row, px, and depth, m, of a point in the world."""
    pose = np.asarray(camera.world_from_camera)
    x, y, z = pose[:3, :3].T @ (point - pose[:3, 3])
    return np.array([camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy, z])


def point_ahead(unity: UnityStandIn, offset: tuple[float, float, float]) -> np.ndarray:
    """Return a point in Unity's world, given in the frame of its camera: right, up, forward."""
    return unity.camera + unity_rotation(unity.yaw_deg, unity.horizon_deg) @ offset


@pytest.mark.parametrize(("yaw_deg", "horizon_deg"), POSES)
@pytest.mark.parametrize("offset", [(0, 0, 2.0), (0.7, 0.3, 2.5), (-1.1, -0.6, 3.0)])
def test_a_point_is_seen_where_unity_sees_it(
    controller: StandInController,
    unity: UnityStandIn,
    yaw_deg: float,
    horizon_deg: float,
    offset: tuple[float, float, float],
) -> None:
    unity.yaw_deg, unity.horizon_deg = yaw_deg, horizon_deg
    point = point_ahead(unity, offset)
    column, from_below, depth = unity.screen_point(point)
    in_world = thor_frame.in_world(dict(zip("xyz", point, strict=True)))
    seen = seen_at(camera_of(controller.step("Pass")), in_world)
    np.testing.assert_allclose(seen, (column, 48 - from_below, depth), atol=1e-9)


@pytest.mark.parametrize(("yaw_deg", "horizon_deg"), POSES)
def test_all_images_show_a_point_where_the_camera_puts_it(
    controller: StandInController, unity: UnityStandIn, yaw_deg: float, horizon_deg: float
) -> None:
    unity.yaw_deg, unity.horizon_deg = yaw_deg, horizon_deg
    point = point_ahead(unity, (0.61, 0.43, 2.2))
    unity.points["Mug|1"] = point
    event = controller.step("Pass")
    frame = frame_of(event)
    in_world = thor_frame.in_world(dict(zip("xyz", point, strict=True)))
    column, row, depth = seen_at(frame.camera, in_world)
    assert column > 32  # Unity's right is the image's right,
    assert row < 24  # and up is up.
    place = int(row), int(column)
    assert frame.rgb[place].tolist() == [255, 255, 255]
    assert np.count_nonzero(frame.rgb) == 3
    assert frame.depth[place] == pytest.approx(depth, rel=1e-6)
    assert np.count_nonzero(frame.depth) == 1  # The far plane is no measurement.
    objects = objects_of(event)
    instances = instances_of(event, objects)
    assert instances.dtype == np.int32
    assert objects[instances[place]].id == "Mug|1"
    assert np.count_nonzero(instances >= 0) == 1
    assert frame.time_s == 1.5


def test_near_is_measured_up_to_the_far_plane(
    controller: StandInController, unity: UnityStandIn
) -> None:
    for depth in (0.11, 1.0, 0.999 * FAR_M):
        unity.points["Mug|1"] = point_ahead(unity, (0, 0, depth))
        frame = frame_of(controller.step("Pass"))
        assert frame.depth.max() == pytest.approx(depth, rel=1e-6)


def test_the_field_of_view_is_vertical(controller: StandInController, unity: UnityStandIn) -> None:
    unity.fov_deg = 90.0
    camera = camera_of(controller.step("Pass"))
    assert (camera.fx, camera.fy) == pytest.approx((24, 24))
    assert (camera.cx, camera.cy, camera.width, camera.height) == (32, 24, 64, 48)


def test_conversions_round_trip() -> None:
    for point in np.random.default_rng(0).normal(size=(5, 3)):
        there = thor_frame.unity_from_world(point)
        np.testing.assert_array_equal(thor_frame.in_world(there), point)
    assert thor_frame.unity_from_world((1, 2, 3)) == {"x": 1, "y": 3, "z": 2}
    for yaw_deg, ahead in ((0, (0, 1)), (90, (1, 0)), (180, (0, -1)), (270, (-1, 0))):
        yaw = thor_frame.yaw_in_world(yaw_deg)
        np.testing.assert_allclose((np.cos(yaw), np.sin(yaw)), ahead, atol=1e-12)
    for yaw in np.linspace(-3.1, 3.1, 9):
        back = thor_frame.yaw_in_world(thor_frame.unity_yaw_from_world(yaw))
        assert back == pytest.approx(yaw)


def test_bad_points_are_named() -> None:
    with pytest.raises(ValueError, match=r"in_world: vector: .* got \{'x': 1.0\}"):
        thor_frame.in_world({"x": 1.0})
    with pytest.raises(ValueError, match=r"unity_from_world: point: expected three finite"):
        thor_frame.unity_from_world((1.0, np.nan, 0.0))


def test_objects_have_boxes_in_the_world(controller: StandInController) -> None:
    table, mug = ThorRobot(controller).objects()
    assert (table.id, table.type, table.visible, table.movable) == ("Table|1", "Table", False, True)
    assert (mug.id, mug.type, mug.visible, mug.movable) == ("Mug|1", "Mug", True, True)
    assert (table.parents, mug.parents) == ((), ("Table|1",))
    np.testing.assert_allclose(table.box, [(-1, 0.5, 0), (1, 1.5, 0.8)])
    np.testing.assert_allclose(mug.box, [(0.45, 1.19, 0.8), (0.55, 1.31, 1.0)])


def test_it_is_a_robot(controller: StandInController, unity: UnityStandIn) -> None:
    robot: Robot = ThorRobot(controller)
    assert robot.observe().rgb.shape == (48, 64, 3)
    np.testing.assert_allclose(robot.reachable_positions(), [(1, -2), (1.25, -2), (1, -1.75)])
    assert robot.move_towards(np.array([1.4, -2.1]), 0.0)
    assert unity.actions[-1] == {
        "action": "Teleport",
        "position": {"x": 1.25, "y": 0.9, "z": -2.0},
        "rotation": {"x": 0.0, "y": 90.0, "z": 0.0},
        "sequenceId": unity.sequence_id,
    }
    before = robot.pose()
    assert unity.actions[-1]["action"] == "Teleport", "no frame was taken"
    pose = robot.observe().camera.world_from_camera
    np.testing.assert_array_equal(before, pose)
    np.testing.assert_allclose(pose[:3, 3], (1.25, -2.0, 1.575))
    np.testing.assert_allclose(pose[:3, 2], (1, 0, 0), atol=1e-12)
    for pitch_rad, horizon in ((0.5, np.rad2deg(0.5)), (2.0, 60.0)):
        assert robot.move_towards(np.array([1.4, -2.1]), 0.0, pitch_rad)
        assert unity.actions[-1]["horizon"] == pytest.approx(horizon)


def test_a_robot_that_cannot_move_says_so(
    controller: StandInController, unity: UnityStandIn
) -> None:
    robot = ThorRobot(controller)
    unity.reachable = []
    assert robot.reachable_positions().shape == (0, 2)
    assert not robot.move_towards(np.zeros(2), 0.0)
    unity.failure = "the agent fell through the floor"
    with pytest.raises(RuntimeError, match="GetReachablePositions: the agent fell through"):
        robot.reachable_positions()


def test_changes_take_positions_in_the_world(
    controller: StandInController, unity: UnityStandIn
) -> None:
    robot = ThorRobot(controller)
    event = robot.step("PlaceObjectAtPoint", objectId="Mug|1", position=np.array([1.0, 2.0, 0.5]))
    assert event.metadata["lastActionSuccess"]
    assert unity.actions[-1]["position"] == {"x": 1.0, "y": 0.5, "z": 2.0}
    assert unity.actions[-1]["objectId"] == "Mug|1"
    robot.step("InitialRandomSpawn", randomSeed=3)
    assert unity.actions[-1]["randomSeed"] == 3
    unity.failure = "No object with ID Cup|9"
    event = robot.step("DisableObject", objectId="Cup|9")
    assert event is robot.last_event
    assert not event.metadata["lastActionSuccess"]
    unity.extra_metadata = {"errorCode": "InvalidArgument"}
    with pytest.raises(ValueError, match=r"No object with ID Cup\|9"):
        robot.step("EnableObject", objectId="Cup|9")


def test_actions_in_unitys_frame_are_rejected(controller: StandInController) -> None:
    robot = ThorRobot(controller)
    with pytest.raises(ValueError, match=r"one of InitialRandomSpawn, .*, got 'TeleportFull'"):
        robot.step("TeleportFull", x=1.0, y=0.9, z=2.0)
    with pytest.raises(ValueError, match=r"one of InitialRandomSpawn, .*, got 'ShiftObject'"):
        robot.step("ShiftObject", objectId="Mug|1", dx=0.1)
    with pytest.raises(ValueError, match="PlaceObjectAtPoint: rotation is not supported"):
        robot.step("PlaceObjectAtPoint", objectId="Mug|1", rotation=90.0)


def test_missing_metadata_of_an_event_is_named(
    controller: StandInController, unity: UnityStandIn
) -> None:
    unity.images = ("image", "image_ids")
    with pytest.raises(ValueError, match=r"lacks the depth image: .* renderDepthImage=True"):
        frame_of(controller.step("Pass"))
    unity.images = ("image_depth",)
    with pytest.raises(ValueError, match=r"lacks the colour image: .* renderImage=True"):
        frame_of(controller.step("Pass"))
    with pytest.raises(ValueError, match=r"instance image: .* renderInstanceSegmentation=True"):
        instances_of(controller.step("Pass"), [])
    for key, read in (("cameraPosition", camera_of), ("fov", camera_of), ("objects", objects_of)):
        unity.extra_metadata = {key: None}
        with pytest.raises(ValueError, match=f"lacks the metadata '{key}'"):
            read(controller.step("Pass"))


class NoNetwork(socket.socket):
    def __init__(self, *_: object, **__: object) -> None:
        raise ConnectionError("the test forbids the network")


@pytest.fixture
def home(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """Simulate a machine with Vulkan, without a build, a display or a network."""
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.setattr("socket.socket", NoNetwork)
    monkeypatch.setattr("ai2thor.platform.CloudRendering.validate", lambda _: [])
    return tmp_path


def build_in(home: Path) -> Path:
    from ai2thor.build import COMMIT_ID

    name = f"thor-CloudRendering-{COMMIT_ID}"
    folder = home / ".ai2thor" / "releases" / name
    folder.mkdir(parents=True)
    (folder / name).touch()
    (folder / "metadata.json").write_text('{"server_types": ["FIFO"]}')
    return folder


def test_without_a_build_the_error_names_the_folders(home: Path) -> None:
    with pytest.raises(FileNotFoundError) as caught:
        start_thor("FloorPlan1")
    message = str(caught.value)
    assert "there is no AI2-THOR build thor-CloudRendering-" in message
    assert str(home / ".ai2thor" / "releases") in message
    assert "download=True" in message
    assert "Invalid commit_id" not in message
    assert "\n" not in message
    assert list(home.iterdir()) == []


def test_a_build_that_cannot_be_fetched_is_named(home: Path) -> None:  # noqa: ARG001
    with pytest.raises(RuntimeError, match=r"cannot reach http.*/thor-CloudRendering-.*\.zip"):
        start_thor("FloorPlan1", download=True)


def test_half_a_build_is_named(home: Path) -> None:
    (build_in(home) / "metadata.json").unlink()
    with pytest.raises(FileNotFoundError, match=r"lacks metadata\.json: remove the folder"):
        start_thor("FloorPlan1")


def test_a_missing_screen_is_named(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    build_in(home)
    monkeypatch.setattr(
        "ai2thor.platform.CloudRendering.validate", lambda _: ["Vulkan API driver missing."]
    )
    with pytest.raises(RuntimeError, match=r"CloudRendering: Vulkan .* missing\. \(.*libvulkan1"):
        start_thor("FloorPlan1")


def test_bad_arguments_are_named(home: Path) -> None:
    with pytest.raises(ValueError, match="must be Linux64 or CloudRendering, got 'WebGL'"):
        start_thor("FloorPlan1", platform="WebGL")
    with pytest.raises(ValueError, match=r"must be Linux64 where an executable"):
        start_thor("FloorPlan1", platform="CloudRendering", executable=home / "thor")
    with pytest.raises(FileNotFoundError, match=r"executable: there is no file .*/thor"):
        start_thor("FloorPlan1", executable=home / "thor")


def test_without_the_package_it_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ai2thor.controller", None)
    with pytest.raises(ImportError, match="pip install --no-deps ai2thor"):
        start_thor("FloorPlan1")


def test_with_a_build_it_starts_with_all_images(
    home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    build_in(home)
    monkeypatch.setattr("ai2thor.controller.Controller", StandInController)
    robot = start_thor("FloorPlan1", width=64, height=48, fov_deg=70.0)
    assert robot.observe().rgb.shape == (48, 64, 3)
    actions = robot._controller.server.actions
    (reset,) = (action for action in actions if action["action"] == "Reset")
    assert reset["sceneName"] == "FloorPlan1_physics"
    (start,) = (action for action in actions if action["action"] == "Initialize")
    expected = {"fieldOfView": 70.0, "gridSize": 0.25, "snapToGrid": True}
    expected |= {"renderDepthImage": True, "renderInstanceSegmentation": True}
    assert expected.items() <= start.items()
