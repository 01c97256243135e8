"""Object navigation while the map is kept up to date."""

from dataclasses import replace
from pathlib import Path

import change_room
import numpy as np
import pytest
import update_room
from semantic_room import embedded_map, map_semantics
from update_room import LOOP

from gslts.change.confirmation import Report
from gslts.core.frame import RgbdFrame
from gslts.core.robot_body import RobotBody
from gslts.keeper.errand import WatchedRobot, drive_to, run_errand
from gslts.keeper.keeper import MapKeeper, StoppedError
from gslts.store.map_folder import read_map, write_map_folder
from gslts_sim.controller import Controller
from gslts_sim.home import Home
from gslts_sim.robot_body import Viewpoint

FAR, NEAR = Viewpoint(0.75, 0.5, 45.0, 30.0), Viewpoint(2.5, 0.25, 90.0, 30.0)
"""From the first one, a box hides most of another one; from the second one, both are in view."""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return the folder of a map with semantics."""
    gaussian_map, _ = embedded_map()
    write_map_folder(tmp_path / "map", gaussian_map, {}, change_room.mapped()[1])
    return tmp_path / "map"


def robot_in(home: Home, viewpoint: Viewpoint = FAR) -> Controller:
    robot = Controller(home, **change_room.SIZE)
    robot.go(viewpoint)
    return robot


@pytest.mark.smoke
def test_a_change_on_the_path_is_integrated_and_the_robot_arrives(folder: Path) -> None:
    said: list[str] = []
    moves: list[int] = []
    home = update_room.changed_home("removal")
    with MapKeeper(folder, LOOP, log=said.append) as keeper:
        _, result = run_errand(
            keeper, map_semantics(), robot_in(home), "block", lambda: moves.append(1)
        )
        assert (result.status, result.reason) == ("reached", "")
        assert keeper.version.number > 1
    assert said[0].startswith("removal at (2.")
    assert update_room.opaque_in(read_map(folder), update_room.REMOVED, 0.04) == 0
    assert len(moves) == len(result.path) - 1


def test_a_relocated_object_is_found_in_the_updated_map(folder: Path) -> None:
    home = update_room.changed_home("relocation").without(["Box|1"])
    with MapKeeper(folder, LOOP) as keeper:
        navigator, result = run_errand(keeper, map_semantics(), robot_in(home, NEAR), "box")
        assert keeper.version.number > 1
    assert result.status == "reached", result.reason
    low, high = update_room.ADDED
    boxes = [found.center for found in navigator.queries.find("box")]
    assert any(((box > low) & (box < high)).all() for box in boxes)


def test_a_robot_that_is_too_large_does_not_drive(folder: Path) -> None:
    box = (2.0, 1.6, 0.75), (2.4, 2.0, 1.05)
    with MapKeeper(folder, LOOP) as keeper:
        robot = robot_in(change_room.home())
        assert drive_to(keeper, robot, "box", box).status == "reached"
        result = drive_to(keeper, robot, "box", box, RobotBody(radius_m=1.5))
    assert result.status != "reached"


def test_nothing_is_reached_on_lost_frames(folder: Path) -> None:
    class Lost(Controller):
        def observe(self) -> RgbdFrame:
            return replace(super().observe(), fault="lost: 3 matches")

    robot = Lost(change_room.home(), **change_room.SIZE)
    robot.go(FAR)
    with MapKeeper(folder, LOOP) as keeper:
        result = drive_to(keeper, robot, "box", ((2.0, 1.6, 0.75), (2.4, 2.0, 1.05)))
    assert result.status != "reached"


def test_a_robot_stays_where_it_has_reached_an_object(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Views of what was confirmed in the last frames wait: it would drive away for them."""
    robot, watched = robot_in(change_room.home()), []
    change = Report(1, update_room.detected("removal"), (1.0,))
    with MapKeeper(folder, LOOP) as keeper:
        monkeypatch.setattr(keeper, "watch", watched.append)
        monkeypatch.setattr(keeper, "integrate", lambda *_: watched.clear())
        monkeypatch.setattr(keeper.monitor, "poll", lambda: [change] if watched else [])
        result = drive_to(keeper, robot, "box", ((2.0, 1.6, 0.75), (2.4, 2.0, 1.05)))
        assert result.status == "reached"
        np.testing.assert_allclose(robot.pose()[:2, 3], result.path[-1], atol=0.05)
        assert watched
        assert [report.number for report in keeper.reports()] == [change.number]


def test_without_a_change_the_map_is_unchanged(folder: Path) -> None:
    with MapKeeper(folder, LOOP) as keeper:
        _, result = run_errand(keeper, map_semantics(), robot_in(change_room.home()), "block")
        assert result.status == "reached"
        assert keeper.version.number == 1


def test_a_stopped_robot_does_not_move(folder: Path) -> None:
    moves = []

    class Robot(Controller):
        def move_towards(self, *where: object) -> bool:
            moves.append(where)
            return super().move_towards(*where)  # type: ignore[arg-type]

    robot = Robot(update_room.changed_home("removal"), **change_room.SIZE)
    robot.go(change_room.VIEWPOINTS[0])
    with MapKeeper(folder, LOOP, should_stop=lambda: True) as keeper:
        watched = WatchedRobot(robot, keeper)
        for _ in range(3):
            watched.observe()
        with pytest.raises(StoppedError):
            watched.move_towards(np.array([1.0, 1.0]), 0.0)
    assert moves == []


def test_a_watched_robot_is_a_robot(folder: Path) -> None:
    robot = robot_in(change_room.home())
    with MapKeeper(folder, LOOP) as keeper:
        watched = WatchedRobot(robot, keeper)
        frame: RgbdFrame = watched.observe()
        np.testing.assert_array_equal(frame.rgb, robot.observe().rgb)
        np.testing.assert_array_equal(watched.reachable_positions(), robot.reachable_positions())
        assert watched.move_towards(np.array([1.0, 1.0]), 0.5, 0.2)
        np.testing.assert_array_equal(watched.pose(), robot.pose())
        eye = robot.observe().camera.world_from_camera[:2, 3]
        assert np.linalg.norm(eye - (1.0, 1.0)) < 0.2
