"""Updates from detection to verification, and reasons why a map stays as it was."""

import re
from collections.abc import Callable
from dataclasses import replace

import change_room
import numpy as np
import pytest
import update_room
from update_room import REMOVED, UPDATE, Changing, run_update, run_updates

from gslts.change.detector import ChangeDetector
from gslts.core.camera import at_pose
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.rendering.metrics import psnr_from_mse_db
from gslts.rendering.rasterizer import render
from gslts.update.refine import Refined
from gslts.update.updater import Update, _moved_once, _refine_until_settled, update, updated_with
from gslts_sim.controller import Controller
from gslts_sim.home import Home


class Spoilt:
    """A robot whose frames are changed before they are seen."""

    def __init__(self, robot: Controller, spoil: Callable[[int, RgbdFrame], RgbdFrame]) -> None:
        self._robot, self._spoil, self._number = robot, spoil, 0

    def observe(self) -> RgbdFrame:
        self._number += 1
        return self._spoil(self._number, self._robot.observe())

    def pose(self) -> np.ndarray:
        return self._robot.pose()

    def reachable_positions(self) -> np.ndarray:
        return self._robot.reachable_positions()

    def move_towards(
        self, position: np.ndarray, yaw_rad: float, pitch_rad: float | None = None
    ) -> bool:
        return self._robot.move_towards(position, yaw_rad, pitch_rad)


def rejected(result: Update) -> str:
    """The reason, after a check that the map is as it was."""
    before, _ = change_room.mapped()
    assert result.gaussian_map is before
    assert result.record.rejected is not None
    return result.record.rejected


def psnr_db(gaussian_map: GaussianMap, home: Home) -> float:
    errors = []
    for look in change_room.LOOKS:
        frame = change_room.see(home, look)
        rgb = render(gaussian_map, frame.camera).rgb
        errors.append(np.mean((rgb.clip(0, 1) - frame.rgb / 255) ** 2))
    return psnr_from_mse_db(float(np.mean(errors)))


@pytest.mark.smoke
@pytest.mark.parametrize("kind", ["removal", "addition", "relocation"])
def test_the_updated_map_shows_the_change(kind: str) -> None:
    before, _ = change_room.mapped()
    home = update_room.changed_home(kind)
    result = run_update(update_room.robot_in(home, "kinect"), kind)
    record = result.record
    assert record.rejected is None
    assert record.kinds == (kind,)
    assert record.psnr_after_db > record.psnr_before_db + 3
    assert psnr_db(result.gaussian_map, home) > psnr_db(before, home) + 1
    assert record.removed >= (0 if kind == "addition" else 20)
    assert record.added >= (0 if kind == "removal" else 20)
    assert record.refined > record.added
    assert list(record.seconds) == ["collecting", "editing", "refining", "verifying"]
    used, held_back = record.training_views, record.validation_views
    assert len(result.views) == used + held_back >= 8
    assert result.gaussian_map.size == before.size - record.removed + record.added


def test_no_gaussian_is_left_where_the_object_was() -> None:
    result = run_update(update_room.robot_in(update_room.changed_home("removal")))
    assert update_room.opaque_in(result.gaussian_map, REMOVED, 0.03) == 0


def test_added_and_removed_again_it_is_as_it_was() -> None:
    home = change_room.home()
    before, cameras = change_room.mapped()
    known = list(cameras.values())
    added = run_update(update_room.robot_in(update_room.changed_home("addition")), "addition")
    detector = ChangeDetector(added.gaussian_map, change_room.CONFIG, cameras=known)
    robot = update_room.robot_in(home)
    (change, *_) = detector.detect(robot.observe()).changes
    assert change.kind == "removal"
    back = update(added.gaussian_map, known, [change], robot, UPDATE, detector=detector)
    assert back.record.rejected is None
    assert psnr_db(back.gaussian_map, home) > psnr_db(before, home) - 0.3


def test_a_change_that_cannot_be_reached_is_left() -> None:
    nowhere = Spoilt(update_room.robot_in(update_room.changed_home("removal")), lambda _, f: f)
    nowhere.reachable_positions = lambda: np.zeros((0, 2))  # type: ignore[method-assign]
    assert (
        rejected(run_update(nowhere))
        == "0 view(s) show the change, 2 are needed: no place around it is reachable"
    )


def test_dark_frames_are_no_views() -> None:
    def darken(number: int, frame: RgbdFrame) -> RgbdFrame:
        return replace(frame, rgb=np.zeros_like(frame.rgb)) if number > 1 else frame

    robot = Spoilt(update_room.robot_in(update_room.changed_home("removal")), darken)
    result = run_update(robot)
    assert rejected(result).startswith("0 view(s) show the change, 2 are needed: frame 2: ")
    assert "black" in rejected(result)
    assert len(result.record.skipped) >= 8


def test_a_false_alarm_changes_nothing() -> None:
    reason = rejected(run_update(update_room.robot_in(change_room.home())))
    assert re.fullmatch(r"only 0 of \d+ views show something gone there", reason)


def test_a_false_alarm_beside_a_change_is_left() -> None:
    alarm, change = update_room.detected("removal"), update_room.detected("addition")
    home = update_room.changed_home("addition")
    result = run_updates(update_room.robot_in(home), [alarm, change])
    assert result.record.rejected is None
    assert result.changes == (change,)
    ((left, why),) = result.left
    assert left is alarm
    assert "views show something gone there" in why
    before, _ = change_room.mapped()
    assert update_room.opaque_in(result.gaussian_map, REMOVED, -0.03) > 20
    assert psnr_db(result.gaussian_map, home) > psnr_db(before, home) + 1


def test_what_left_and_is_not_where_it_was_seen_is_gone() -> None:
    home = change_room.home().without(["Box|2"])
    result = run_update(update_room.robot_in(home), "relocation")
    assert [change.kind for change in result.changes] == ["removal"]
    assert result.record.kinds == ("removal",)
    assert result.changes[0].boxes[1] is None
    before, _ = change_room.mapped()
    assert psnr_db(result.gaussian_map, home) > psnr_db(before, home) + 1


def test_what_came_and_left_nothing_behind_is_new() -> None:
    """What looks like it may still be where it was."""
    blue = update_room.changed_home("relocation").objects[-1]
    home = change_room.home()
    home = replace(home, objects=(*home.objects, replace(blue, id="Box|9")))
    result = run_update(update_room.robot_in(home), "relocation")
    assert [change.kind for change in result.changes] == ["addition"]
    before, _ = change_room.mapped()
    assert psnr_db(result.gaussian_map, home) > psnr_db(before, home) + 1


def test_what_moved_to_where_no_view_can_be_had_is_left() -> None:
    """The map would lose the object, and nobody would look for it."""
    change = update_room.detected("relocation")
    after = change.after
    assert after is not None

    class Outside:
        low, high = after.low + np.array([9, 0, 0]), after.high + np.array([9, 0, 0])

    robot = update_room.robot_in(update_room.changed_home("relocation"))
    reason = rejected(run_update(robot, change=replace(change, after=Outside())))  # type: ignore[arg-type]
    assert reason == "0 view(s) show the change, 2 are needed: no place around it is reachable"


def test_a_change_without_a_place_changes_nothing() -> None:
    change = replace(update_room.detected("removal"), before=None)
    robot = update_room.robot_in(update_room.changed_home("removal"))
    assert rejected(run_update(robot, change=change)) == "its place is not known"


def test_without_depth_in_what_changed_nothing_is_done() -> None:
    low, high = update_room.ADDED

    def hide(_: int, frame: RgbdFrame) -> RgbdFrame:
        """As glass does, which the beam of the sensor goes through."""
        camera = frame.camera
        rows, columns = np.indices(frame.depth.shape) + 0.5
        x = (columns - camera.cx) / camera.fx * frame.depth
        y = (rows - camera.cy) / camera.fy * frame.depth
        pose = camera.world_from_camera
        points = np.stack([x, y, frame.depth], axis=-1) @ pose[:3, :3].T + pose[:3, 3]
        inside = ((points > low - 0.03) & (points < high + 0.03)).all(axis=-1)
        return replace(frame, depth=np.where(inside, 0, frame.depth).astype(np.float32))

    robot = Spoilt(update_room.robot_in(update_room.changed_home("addition")), hide)
    reason = rejected(run_update(robot, "addition"))
    assert re.fullmatch("depth is measured in [0-9] % of what changed", reason)


@pytest.mark.parametrize("frames", [6, 7])
def test_an_object_that_moves_again_meanwhile_is_left(frames: int) -> None:
    robot = Changing(update_room.changed_home("addition"), change_room.home(), frames)
    reason = rejected(run_update(robot, "addition"))
    assert re.fullmatch(r"\d\d % of what changed moved again while it was looked at", reason)


def test_what_moved_once_is_told_from_errors_of_single_views() -> None:
    seen = {
        "moved": "nnnTTTTT",
        "moved late": "nnnnnnTT",
        "moved, one view errs": "nnnnTTTTTTnT",
        "there": "nnnnnnnn",
        "errors": "nTTnnTnn",
        "one view alone": "nTTTTTTT",
        "not seen": "        ",
    }
    for name, views in seen.items():
        on, through = (np.array([[view == sign] for view in views], np.int32) for sign in "nT")
        expected = name.startswith("moved")
        assert bool(_moved_once(on, through)[0]) == expected, name
        assert not _moved_once(through, on)[0]


@pytest.mark.parametrize(
    ("doubts", "times"), [((0.1,), 1), ((0.9, 0.1), 2), ((0.9, 0.9), 2), ((0.9, 0.8, 0.7), 3)]
)
def test_a_refinement_is_repeated_while_that_helps(doubts: tuple[float, ...], times: int) -> None:
    before, _ = change_room.mapped()
    left = iter(doubts)
    refined = _refine_until_settled(
        before, lambda of: Refined(of, 10, ()), lambda _: next(left), 0.25
    )
    assert refined.iterations == 10 * times
    assert next(left, None) is None


def test_one_wrong_pose_does_no_harm() -> None:
    """It is corrected, or the view is left out."""

    def shift(number: int, frame: RgbdFrame) -> RgbdFrame:
        if number != 4:
            return frame
        pose = frame.camera.world_from_camera
        pose[:3, 3] += (0.04, 0.03, 0.0)
        return replace(frame, camera=at_pose(frame.camera, pose))

    home = update_room.changed_home("removal")
    good = run_update(update_room.robot_in(home))
    bad = run_update(Spoilt(update_room.robot_in(home), shift))
    assert bad.record.rejected is None
    assert psnr_db(bad.gaussian_map, home) > psnr_db(good.gaussian_map, home) - 0.3


def test_an_update_that_fits_no_better_is_rejected() -> None:
    """All that is new in the frames that are used is an error of theirs."""
    found = update_room.collected("addition")
    before, cameras = change_room.mapped()
    # Held back are views of the room as the map shows it already.
    seen = [
        view
        if k % 4 != 2
        else replace(view, frame=change_room.see(change_room.home(), change_room.LOOKS[0]))
        for k, view in enumerate(found.views)
    ]
    result, record = updated_with(
        before, list(cameras.values()), replace(found, views=tuple(seen)), UPDATE
    )
    assert result is before
    assert record.rejected is not None
    assert record.rejected.startswith("views held back fit no better: ")
