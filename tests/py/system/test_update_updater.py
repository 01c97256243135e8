"""Integration of changes into a map, and the reasons for rejecting an update."""

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
from gslts.update.evidence import is_visible
from gslts.update.integrate import (
    UpdateResult,
    integrate_changes,
    integrate_views,
)
from gslts.update.refine import Refinement
from gslts.update.settle import refine_until_settled
from gslts.update.steadiness import changes_once
from gslts.update.verify import error_in_regions, split_views
from gslts_sim.controller import Controller
from gslts_sim.home import Home


class Disturbed:
    """A robot whose frames are modified."""

    def __init__(self, robot: Controller, modify: Callable[[int, RgbdFrame], RgbdFrame]) -> None:
        self._robot, self._modify, self._number = robot, modify, 0

    def observe(self) -> RgbdFrame:
        self._number += 1
        return self._modify(self._number, self._robot.observe())

    def pose(self) -> np.ndarray:
        return self._robot.pose()

    def reachable_positions(self) -> np.ndarray:
        return self._robot.reachable_positions()

    def move_towards(
        self, position: np.ndarray, yaw_rad: float, pitch_rad: float | None = None
    ) -> bool:
        return self._robot.move_towards(position, yaw_rad, pitch_rad)


def rejection_of(result: UpdateResult) -> str:
    """Return the reason, and check that the map is unchanged."""
    before, _ = change_room.mapped()
    assert result.gaussian_map is before
    assert result.rejected is not None
    return result.rejected


def psnr_db(gaussian_map: GaussianMap, home: Home) -> float:
    errors = []
    for viewpoint in change_room.VIEWPOINTS:
        frame = change_room.see(home, viewpoint)
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
    training, validation = record.training_views, record.validation_views
    assert len(result.views) == training + validation >= 8
    assert result.gaussian_map.size == before.size - record.removed + record.added


def test_removal_leaves_no_gaussian_of_the_object() -> None:
    result = run_update(update_room.robot_in(update_room.changed_home("removal")))
    assert update_room.opaque_in(result.gaussian_map, REMOVED, 0.03) == 0


def test_addition_and_removal_cancel() -> None:
    home = change_room.home()
    before, cameras = change_room.mapped()
    known = list(cameras.values())
    added = run_update(update_room.robot_in(update_room.changed_home("addition")), "addition")
    detector = ChangeDetector(added.gaussian_map, change_room.CONFIG, cameras=known)
    robot = update_room.robot_in(home)
    (change, *_) = detector.detect(robot.observe()).changes
    assert change.kind == "removal"
    back = integrate_changes(added.gaussian_map, known, [change], robot, UPDATE, detector=detector)
    assert back.record.rejected is None
    assert psnr_db(back.gaussian_map, home) > psnr_db(before, home) - 0.3


def test_a_removal_whose_gaussians_stay_is_rejected() -> None:
    """The views show an error of the map then."""
    keeping = UPDATE.edit.model_copy(update={"vote_share": 1.0, "carve": False})
    before, cameras = change_room.mapped()
    result = integrate_changes(
        before,
        list(cameras.values()),
        [update_room.detected("removal")],
        update_room.robot_in(update_room.changed_home("removal")),
        UPDATE.model_copy(update={"edit": keeping}),
        detector=change_room.detector(),
    )
    told = re.fullmatch(
        r"its views show only (\d+) of (\d+) Gaussians as gone", rejection_of(result)
    )
    assert told is not None
    gone, count = map(int, told.groups())
    assert 4 * gone <= count
    assert count > 50


def test_an_unreachable_change_is_rejected() -> None:
    nowhere = Disturbed(update_room.robot_in(update_room.changed_home("removal")), lambda _, f: f)
    nowhere.reachable_positions = lambda: np.zeros((0, 2))  # type: ignore[method-assign]
    assert (
        rejection_of(run_update(nowhere))
        == "0 view(s) show the change, 2 are needed: no position around it is reachable"
    )


def test_dark_frames_are_skipped() -> None:
    def darken(number: int, frame: RgbdFrame) -> RgbdFrame:
        return replace(frame, rgb=np.zeros_like(frame.rgb)) if number > 1 else frame

    robot = Disturbed(update_room.robot_in(update_room.changed_home("removal")), darken)
    result = run_update(robot)
    assert rejection_of(result).startswith("0 view(s) show the change, 2 are needed: frame 2: ")
    assert "black" in rejection_of(result)
    assert len(result.record.skipped) >= 8


def test_a_false_alarm_is_rejected() -> None:
    reason = rejection_of(run_update(update_room.robot_in(change_room.home())))
    assert re.fullmatch(r"only 0 of \d+ views show a removed object there", reason)


def test_a_false_alarm_beside_a_change_is_rejected() -> None:
    alarm, change = update_room.detected("removal"), update_room.detected("addition")
    home = update_room.changed_home("addition")
    result = run_updates(update_room.robot_in(home), [alarm, change])
    assert result.rejected is None
    assert result.changes == (change,)
    ((rejected, reason),) = result.rejected_changes
    assert rejected is alarm
    assert "views show a removed object there" in reason
    before, _ = change_room.mapped()
    assert update_room.opaque_in(result.gaussian_map, REMOVED, -0.03) > 20
    assert psnr_db(result.gaussian_map, home) > psnr_db(before, home) + 1


def test_a_relocation_without_destination_becomes_a_removal() -> None:
    home = change_room.home().without(["Box|2"])
    result = run_update(update_room.robot_in(home), "relocation")
    assert [change.kind for change in result.changes] == ["removal"]
    assert result.record.kinds == ("removal",)
    assert result.changes[0].boxes[1] is None
    before, _ = change_room.mapped()
    assert psnr_db(result.gaussian_map, home) > psnr_db(before, home) + 1


def test_a_relocation_without_source_becomes_an_addition() -> None:
    """A second object looks the same."""
    blue = update_room.changed_home("relocation").objects[-1]
    home = change_room.home()
    home = replace(home, objects=(*home.objects, replace(blue, id="Box|9")))
    result = run_update(update_room.robot_in(home), "relocation")
    assert [change.kind for change in result.changes] == ["addition"]
    before, _ = change_room.mapped()
    assert psnr_db(result.gaussian_map, home) > psnr_db(before, home) + 1


def test_a_relocation_to_an_unreachable_region_is_rejected() -> None:
    """Otherwise the map would lose the object."""
    change = update_room.detected("relocation")
    before, after = change.boxes
    assert after is not None
    outside = tuple(corner + np.array([9, 0, 0]) for corner in after)
    robot = update_room.robot_in(update_room.changed_home("relocation"))
    reason = rejection_of(run_update(robot, change=replace(change, boxes=(before, outside))))
    assert reason == "0 view(s) show the change, 2 are needed: no position around it is reachable"


def test_a_change_without_region_is_rejected() -> None:
    change = replace(update_room.detected("removal"), boxes=(None, None))
    robot = update_room.robot_in(update_room.changed_home("removal"))
    assert rejection_of(run_update(robot, change=change)) == "its region is unknown"


def test_a_change_without_measured_depth_is_rejected() -> None:
    low, high = update_room.ADDED

    def hide(_: int, frame: RgbdFrame) -> RgbdFrame:
        """Remove depth, as glass does."""
        camera = frame.camera
        rows, columns = np.indices(frame.depth.shape) + 0.5
        x = (columns - camera.cx) / camera.fx * frame.depth
        y = (rows - camera.cy) / camera.fy * frame.depth
        pose = camera.world_from_camera
        points = np.stack([x, y, frame.depth], axis=-1) @ pose[:3, :3].T + pose[:3, 3]
        inside = ((points > low - 0.03) & (points < high + 0.03)).all(axis=-1)
        return replace(frame, depth=np.where(inside, 0, frame.depth).astype(np.float32))

    robot = Disturbed(update_room.robot_in(update_room.changed_home("addition")), hide)
    reason = rejection_of(run_update(robot, "addition"))
    assert re.fullmatch("depth is measured in [0-9] % of the changed pixels", reason)


@pytest.mark.parametrize("frames", [6, 7])
def test_an_object_that_moves_during_the_collection_is_rejected(frames: int) -> None:
    robot = Changing(update_room.changed_home("addition"), change_room.home(), frames)
    reason = rejection_of(run_update(robot, "addition"))
    assert re.fullmatch(r"\d\d % of what changed moved again during the collection", reason)


def test_a_move_is_separated_from_errors_of_single_views() -> None:
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
        assert bool(changes_once(on, through)[0]) == expected, name
        assert not changes_once(through, on)[0]


@pytest.mark.parametrize(
    ("confidences", "times"), [((0.1,), 1), ((0.9, 0.1), 2), ((0.9, 0.9), 2), ((0.9, 0.8, 0.7), 3)]
)
def test_refinement_is_repeated_while_confidence_falls(
    confidences: tuple[float, ...], times: int
) -> None:
    before, _ = change_room.mapped()
    left = iter(confidences)
    refined = refine_until_settled(
        before, lambda of: Refinement(of, 10, ()), lambda _: next(left), 0.25
    )
    assert refined.iterations == 10 * times
    assert next(left, None) is None


def test_one_wrong_pose_does_not_degrade_the_map() -> None:
    """It is corrected, or the view is skipped."""

    def shift(number: int, frame: RgbdFrame) -> RgbdFrame:
        if number != 4:
            return frame
        pose = frame.camera.world_from_camera
        pose[:3, 3] += (0.04, 0.03, 0.0)
        return replace(frame, camera=at_pose(frame.camera, pose))

    home = update_room.changed_home("removal")
    good = run_update(update_room.robot_in(home))
    bad = run_update(Disturbed(update_room.robot_in(home), shift))
    assert bad.record.rejected is None
    assert psnr_db(bad.gaussian_map, home) > psnr_db(good.gaussian_map, home) - 0.3


def test_an_update_that_does_not_fit_validation_views_is_rejected() -> None:
    """The training views show an object that the validation views do not."""
    found = update_room.collected("addition")
    before, cameras = change_room.mapped()
    # The validation views show the room as the map does.
    seen = [
        view
        if k % 4 != 2
        else replace(view, frame=change_room.see(change_room.home(), change_room.VIEWPOINTS[0]))
        for k, view in enumerate(found.views)
    ]
    result, _, record = integrate_views(
        before, list(cameras.values()), replace(found, views=tuple(seen)), UPDATE
    )
    assert result is before
    assert record.rejected is not None
    assert record.rejected.startswith("validation views do not fit better: ")


@pytest.mark.parametrize(("count", "all_views"), [(2, True), (8, False)])
def test_few_views_all_train_once_the_change_is_verified(count: int, all_views: bool) -> None:
    before, cameras = change_room.mapped()
    found = update_room.collected("addition")
    (region,) = found.regions
    seeing = [view for view in found.views if is_visible(view.frame, region)]
    some = replace(found, views=tuple(seeing[:count]))
    updated, _, record = integrate_views(before, list(cameras.values()), some, UPDATE)
    _, validation = split_views(some.views, some.regions_by_change, UPDATE.collect.validation_every)
    assert (record.training_views, record.validation_views) == (
        count - len(validation),
        count // 4 or 1,
    )
    error = error_in_regions(updated, validation, some.regions)
    assert error is not None
    assert record.psnr_after_db is not None
    assert (psnr_from_mse_db(error) > record.psnr_after_db + 1) == all_views
    assert updated.size == before.size - record.removed + record.added
