"""The library call that detects changes and publishes a version of a map."""

from pathlib import Path

import change_room
import numpy as np
import pytest
import sim_scenes
import update_room
from update_room import UPDATE

import gslts
from gslts.change.changes import Change
from gslts.core.robot import Robot
from gslts.store.causes import UpdateCause
from gslts.store.map_folder import open_map, read_map
from gslts.update import MapUpdate


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return the folder of a map of the room."""
    change_room.write_room_map(tmp_path / "map")
    return tmp_path / "map"


def update(folder: Path, robot: Robot, detected: list[Change] | None = None) -> MapUpdate:
    found: list[Change] = [] if detected is None else detected
    return gslts.update_map(
        folder, robot, UPDATE, detection=change_room.CONFIG, on_detected=found.extend
    )


def test_a_change_becomes_a_version(folder: Path) -> None:
    detected: list[Change] = []
    done = update(folder, update_room.robot_in(update_room.changed_home("removal")), detected)
    assert (done.status, done.reason, done.version.number) == ("updated", None, 2)
    assert [change.kind for change in detected] == ["removal"]
    assert done.result is not None
    assert [change.kind for change in done.result.changes] == ["removal"]
    assert update_room.opaque_in(read_map(folder), update_room.REMOVED, 0.04) == 0
    with open_map(folder) as store:
        assert store.version() == done.version
    assert isinstance(done.version.cause, UpdateCause)
    assert done.version.cause.record == done.result.record
    assert (folder / "updates" / "00002.jpg").exists()


def test_without_a_change_nothing_is_written(folder: Path) -> None:
    before = sorted(path.name for path in folder.rglob("*"))
    done = update(folder, update_room.robot_in(change_room.home()))
    assert (done.status, done.reason, done.version.number) == ("unchanged", None, 1)
    assert done.result is None
    with open_map(folder) as store:
        assert store.rejections() == []
    after = sorted(path.name for path in folder.rglob("*"))
    assert {*after} - {*before} <= {"writer.lock", "versions.sqlite-wal", "versions.sqlite-shm"}


def test_frames_that_do_not_fit_the_map_are_rejected(folder: Path) -> None:
    done = update(folder, update_room.robot_in(sim_scenes.simple_home()))
    assert (done.status, done.version.number) == ("rejected", 1)
    assert done.reason is not None
    with open_map(folder) as store:
        (rejection,) = store.rejections()
    assert rejection.cause.reason == done.reason


def test_an_unconfirmed_change_is_rejected_with_its_record(folder: Path) -> None:
    robot = update_room.Changing(update_room.changed_home("removal"), change_room.home(), 1)
    done = update(folder, robot)
    assert (done.status, done.version.number) == ("rejected", 1)
    assert done.result is not None
    np.testing.assert_array_equal(read_map(folder).ids, done.result.gaussian_map.ids)
    with open_map(folder) as store:
        (rejection,) = store.rejections()
    assert rejection.cause.record == done.result.record
    assert [change.kind for change in rejection.cause.changes] == ["removal"]
