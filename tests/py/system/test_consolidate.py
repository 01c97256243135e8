"""Consolidation of a map: a robot that has time refines what updates changed."""

import shutil
from dataclasses import replace
from pathlib import Path

import change_room
import numpy as np
import pytest
import sim_scenes
import update_room
from command import gslts as run
from update_room import LOOP, UPDATE

import gslts
import gslts.consolidation.consolidate as consolidate_module
from gslts.consolidation.fit import refine_regions
from gslts.consolidation.pipeline import MapConsolidation
from gslts.core.gaussian_map import GaussianMap
from gslts.core.robot import Robot
from gslts.keeper.keeper import MapKeeper, StoppedError
from gslts.mapping.observation import Observation
from gslts.rendering.losses import fit_exposure
from gslts.rendering.metrics import psnr_db
from gslts.rendering.rasterizer import render
from gslts.robots.recorded import RecordedRobot
from gslts.store.causes import ConsolidationCause
from gslts.store.delta import map_to_arrays
from gslts.store.map_folder import open_map, read_map
from gslts.update.region import Region
from gslts_sim.capture import capture
from gslts_sim.controller import Controller
from gslts_sim.robot_body import Viewpoint

AFTER = update_room.changed_home("addition")
NEW_VIEWPOINTS = [
    Viewpoint(x, y, yaw, 30.0)
    for x, y, yaw in ((2.5, 0.75, 90.0), (3.75, 1.75, 180.0), (1.25, 2.0, 0.0), (2.5, 3.25, 270.0))
]
"""Viewpoints all around the box that was added; nothing is fitted to their frames."""


@pytest.fixture(scope="module")
def updated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a map to which an update added a box."""
    folder = tmp_path_factory.mktemp("consolidation") / "map"
    change_room.write_room_map(folder)
    robot = update_room.robot_in(AFTER)
    done = gslts.update_map(folder, robot, UPDATE, detection=change_room.CONFIG)
    assert done.status == "updated"
    return folder


@pytest.fixture
def folder(updated: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(updated, tmp_path / "map"))


def consolidate(folder: Path, robot: Robot, threads: int = 0) -> MapConsolidation:
    return gslts.consolidate_map(folder, robot, detection=change_room.CONFIG, threads=threads)


def added_region() -> Region:
    return Region("after", *update_room.ADDED)


def mean_psnr_db(gaussian_map: GaussianMap) -> float:
    values = []
    for viewpoint in NEW_VIEWPOINTS:
        frame = change_room.see(AFTER, viewpoint)
        rgb = render(gaussian_map, frame.camera).rgb
        photo = frame.rgb.astype(np.float32) / np.float32(255)
        x0, y0, x1, y1 = added_region().project_box(frame.camera, 10) or (0, 0, 0, 0)
        part = np.s_[y0:y1, x0:x1]
        exposure = fit_exposure(rgb, photo)
        values.append(psnr_db(gslts.losses.apply_exposure(rgb, exposure)[part], photo[part]))
    return float(np.mean(values))


@pytest.mark.smoke
def test_a_consolidation_becomes_a_version_that_fits_better(folder: Path) -> None:
    before = read_map(folder)
    done = consolidate(folder, update_room.robot_in(AFTER), threads=2)
    after = read_map(folder)
    assert (done.version.number, done.reason) == (3, None)
    assert isinstance(done.version.cause, ConsolidationCause)
    record, cause = done.record, done.version.cause
    assert record is not None
    assert cause.record == record
    assert (cause.since, len(cause.frames)) == (1, record.views)
    assert record.psnr_before_db is not None
    assert record.psnr_after_db is not None
    assert record.psnr_after_db > record.psnr_before_db
    assert mean_psnr_db(after) > mean_psnr_db(before)
    with open_map(folder) as store:
        assert store.find_problems() == []
        assert len(store.events()) == 1, "it shows no change of an object"


def test_gaussians_away_from_the_changes_stay_bit_by_bit(folder: Path) -> None:
    before = read_map(folder)
    consolidate(folder, update_room.robot_in(AFTER))
    after = read_map(folder)
    assert np.isin(after.ids, before.ids).all(), "none is added"
    far = ~added_region().contains(before.means, 0.8)
    assert far.sum() > before.size / 4
    kept = after.select(np.isin(after.ids, before.ids[far]))
    for name, array in map_to_arrays(before.select(far)).items():
        np.testing.assert_array_equal(map_to_arrays(kept)[name], array, err_msg=name)
    near = before.select(np.isin(before.ids, after.ids) & ~far)
    refined = after.select(np.isin(after.ids, near.ids))
    assert not np.array_equal(near.sh, refined.sh)


def test_what_changed_since_is_left_to_updates(folder: Path) -> None:
    """The red box is gone when the robot takes the views; the map still shows it afterwards."""
    before = update_room.opaque_in(read_map(folder), update_room.REMOVED, 0.02)
    gone = replace(AFTER, objects=AFTER.without(["Box|1"]).objects)
    consolidate(folder, update_room.robot_in(gone))
    after = update_room.opaque_in(read_map(folder), update_room.REMOVED, 0.02)
    assert before > 20
    assert after > 0.9 * before


def test_another_home_leaves_the_map(folder: Path) -> None:
    done = consolidate(folder, update_room.robot_in(sim_scenes.simple_home()))
    assert done.reason is not None
    assert done.reason.startswith("validation views do not fit better: ")
    with open_map(folder) as store:
        assert store.version().number == 2


def test_a_home_with_many_changes_leaves_the_map(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The room has few objects: a single change is too much here."""
    monkeypatch.setattr(consolidate_module, "MAX_UNKNOWN_CHANGES", 0)
    gone = replace(AFTER, objects=AFTER.without(["Box|1"]).objects)
    with pytest.raises(ValueError, match=r"^the views show [12] changes that the map does not"):
        consolidate(folder, update_room.robot_in(gone))
    with open_map(folder) as store:
        assert store.version().number == 2


def test_a_map_is_consolidated_once(folder: Path) -> None:
    robot = update_room.robot_in(AFTER)
    assert consolidate(folder, robot).version.number == 3
    again = consolidate(folder, robot)
    assert (again.version.number, again.record) == (3, None)
    assert again.reason == "nothing changed since the last consolidation"


def test_the_result_does_not_depend_on_the_number_of_threads() -> None:
    gaussian_map, _ = change_room.mapped()
    seen = [change_room.see(AFTER, viewpoint) for viewpoint in NEW_VIEWPOINTS]
    first, second = (
        refine_regions(gaussian_map, [Observation.of(frame) for frame in seen], [added_region()], n)
        for n in (1, 2)
    )
    assert first.iterations == second.iterations > 0
    for name, array in map_to_arrays(first.after).items():
        np.testing.assert_array_equal(array, map_to_arrays(second.after)[name], err_msg=name)
    assert not np.array_equal(first.before.sh, first.after.sh)


class Standing(Controller):
    """A robot that does not move."""

    def move_towards(self, *_: object) -> bool:
        return False


def standing() -> Standing:
    return Standing(AFTER, **change_room.SIZE, noise="none")


def test_a_robot_that_reaches_too_few_views_leaves_the_map(folder: Path) -> None:
    with pytest.raises(ValueError, match=r"^0 usable views show what changed, 10 are needed: let"):
        consolidate(folder, standing())
    dark = [
        replace(frame, rgb=np.zeros_like(frame.rgb), depth=np.zeros_like(frame.depth))
        for frame in (update_room.robot_in(AFTER).observe() for _ in range(12))
    ]
    with pytest.raises(ValueError, match="usable views show what changed"):
        consolidate(folder, RecordedRobot(dark))
    with open_map(folder) as store:
        assert store.version().number == 2


def test_a_keeper_consolidates(folder: Path) -> None:
    lines: list[str] = []
    with MapKeeper(folder, LOOP, log=lines.append) as keeper:
        keeper.consolidate(update_room.robot_in(AFTER))
        keeper.consolidate(standing())
        assert keeper.version.number == 3
        assert keeper.gaussian_map.size == keeper.version.gaussians
    assert lines[0].startswith("version 3: ")
    assert lines[1] == "not consolidated: nothing changed since the last consolidation"


def test_a_stop_leaves_the_map(folder: Path) -> None:
    with MapKeeper(folder, LOOP, should_stop=lambda: True) as keeper:
        with pytest.raises(StoppedError):
            keeper.consolidate(update_room.robot_in(AFTER))
        assert keeper.version.number == 2


@pytest.mark.usefixtures("folder")
def test_recorded_frames_consolidate_on_the_command_line(tmp_path: Path) -> None:
    robot = update_room.robot_in(AFTER)
    viewpoints = change_room.viewpoints_all_around("change_room", change_room.home(), 48)
    capture(robot, viewpoints, tmp_path / "visit")
    done = run("consolidate", "map", "--frames", "visit", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("version 3 of map: ")
    log = run("log", "map", cwd=tmp_path)
    assert "consolidated since version 1" in log.stdout
    again = run("consolidate", "map", "--frames", "visit", cwd=tmp_path)
    assert again.returncode == 0
    assert again.stdout == "map is unchanged: nothing changed since the last consolidation\n"
    neither = run("consolidate", "map", cwd=tmp_path)
    assert neither.returncode != 0
    assert neither.stderr.splitlines()[-1].endswith("give either --robot or --frames")
