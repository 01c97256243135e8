"""Updates for shifted furniture: its Gaussians move with all that stands on it."""

import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import change_room
import numpy as np
import update_room

from gslts.core.gaussian_map import GaussianMap
from gslts.rendering.metrics import psnr_from_mse_db
from gslts.rendering.rasterizer import render
from gslts.store.causes import UpdateCause
from gslts.store.describe import describe_versions
from gslts.store.map_folder import open_map, write_map_folder
from gslts.update.integrate import UpdateResult, integrate_changes
from gslts.update.publish import publish
from gslts_sim.home import Home

BLOCK = (np.array([2.0, 1.5, 0.0]), np.array([3.2, 2.3, 1.05]))
"""Corners of the block with what stands on it, m."""


@cache
def shifted() -> UpdateResult:
    """Return the update after the block was shifted."""
    return update_room.run_update(update_room.robot_in(update_room.changed_home("shift")), "shift")


def psnr_db(gaussian_map: GaussianMap, home: Home) -> float:
    errors = []
    for viewpoint in change_room.VIEWPOINTS:
        frame = change_room.see(home, viewpoint)
        rgb = render(gaussian_map, frame.camera).rgb
        errors.append(np.mean((rgb.clip(0, 1) - frame.rgb / 255) ** 2))
    return psnr_from_mse_db(float(np.mean(errors)))


def test_the_map_shows_the_block_at_its_new_position() -> None:
    before, _ = change_room.mapped()
    home, result = update_room.changed_home("shift"), shifted()
    assert result.rejected is None
    assert [change.kind for change in result.changes] == ["shift"]
    true = home["Block|1"].world_from_object @ np.linalg.inv(
        change_room.home()["Block|1"].world_from_object
    )
    (motion,) = (change.motion for change in result.changes)
    assert motion is not None
    center = np.array([*(BLOCK[0] + BLOCK[1]) / 2, 1])
    assert np.linalg.norm((motion - true) @ center) < 0.02
    assert psnr_db(result.gaussian_map, home) > psnr_db(before, home) + 3


def test_the_block_and_what_stands_on_it_keep_their_gaussians() -> None:
    before, _ = change_room.mapped()
    result = shifted()
    low, high = BLOCK
    # Not the lowest ones, which the floor has as well.
    inside = ((before.means > low + np.array([0, 0, 0.05])) & (before.means < high)).all(axis=1)
    kept = np.isin(before.ids[inside], result.gaussian_map.ids)
    assert kept.mean() > 0.8
    (rows,) = result.moved
    # In this rough map, the floor lies about a centimetre below its true height.
    assert not rows[before.means[:, 2] < -0.005].any()
    assert rows[inside].mean() > 0.8


def test_without_rigid_motion_the_block_is_removed_and_added() -> None:
    gaussian_map, cameras = change_room.mapped()
    edit = update_room.SMALL.model_copy(update={"rigid": False})
    result = integrate_changes(
        gaussian_map,
        list(cameras.values()),
        [update_room.detected("shift")],
        update_room.robot_in(update_room.changed_home("shift")),
        update_room.UPDATE.model_copy(update={"edit": edit}),
        detector=change_room.detector(),
    )
    assert result.rejected is None
    assert not np.any(result.moved)
    assert result.record.removed > shifted().record.removed
    home = update_room.changed_home("shift")
    assert psnr_db(shifted().gaussian_map, home) > psnr_db(result.gaussian_map, home)


def test_a_shift_that_did_not_happen_is_rejected() -> None:
    before, _ = change_room.mapped()
    result = update_room.run_update(update_room.robot_in(change_room.home()), "shift")
    assert result.gaussian_map is before
    assert result.rejected is not None
    assert result.rejected.startswith("only 0 of ")
    assert result.rejected.endswith(" views show the same shift there")


def test_the_same_shift_is_not_made_twice() -> None:
    change = update_room.detected("shift")
    robot = update_room.robot_in(update_room.changed_home("shift"))
    result = update_room.run_updates(robot, [change, replace(change, confidence=0.6)])
    assert [change.kind for change in result.changes] == ["shift"]
    assert [reason for _, reason in result.rejected_changes] == ["it is a part of another shift"]


def test_the_history_tells_the_shift(tmp_path: Path) -> None:
    before, cameras = change_room.mapped()
    write_map_folder(tmp_path / "map", before, {}, {})
    with open_map(tmp_path / "map", writable=True) as store:
        version = publish(store, before, cameras.values(), shifted(), update_room.UPDATE)
        assert version is not None
        assert isinstance(version.cause, UpdateCause)
        (change,), (event,) = version.cause.changes, store.events()
        assert change.motion == event.motion is not None
        low, high = (np.array(corner) for corner in event.boxes[0])
        assert np.linalg.norm(low[:2] - BLOCK[0][:2]) < 0.15
        assert np.linalg.norm(high[:2] - BLOCK[1][:2]) < 0.15
        (line,) = describe_versions(store)[2]
    shift = re.fullmatch(r"(\w+) shifted by (\d+) cm and (\d)°", line)
    assert shift is not None
    assert shift[1] == event.type
    assert abs(int(shift[2]) - 10) <= 2
    assert abs(int(shift[3]) - 2) <= 1
