"""The library call that detects changes and publishes a version of a map."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import change_room
import cv2
import numpy as np
import pytest
import sim_scenes
import update_room
from update_room import UPDATE

import gslts
from gslts.change.changes import Change
from gslts.change.confirmation import MonitorConfig
from gslts.change.constants import MIN_RECORDED_CONFIDENCE
from gslts.core.frame import RgbdFrame
from gslts.core.robot import Robot
from gslts.rendering.rasterizer import render
from gslts.robots.recorded import RecordedRobot
from gslts.store.causes import UpdateCause
from gslts.store.map_folder import open_map, read_map
from gslts.update import MapUpdate
from gslts_sim.robot_body import Viewpoint


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


@pytest.mark.parametrize(
    ("usable", "reason"),
    [
        (0, "none of 4 frames can be compared with the map; gslts detect names the reasons"),
        (
            2,
            "only 2 of 4 frames can be compared with the map, 3 must show a change (--needed); "
            "gslts detect names the reasons",
        ),
        (3, None),
    ],
)
def test_too_few_frames_that_fit_the_map_are_rejected(
    folder: Path, usable: int, reason: str | None
) -> None:
    frame = update_room.robot_in(change_room.home()).observe()
    black = replace(frame, rgb=np.zeros_like(frame.rgb))
    frames = [*[frame] * usable, *[black] * (4 - usable)]
    done = gslts.update_map(
        folder, RecordedRobot(frames), UPDATE, detection=change_room.CONFIG, frames=frames
    )
    assert (done.status, done.reason) == ("rejected" if reason else "unchanged", reason)


def coarse(frame: RgbdFrame) -> RgbdFrame:
    """Return the frame with depth in steps of 4 cm."""
    return replace(frame, depth=(np.round(frame.depth / 0.04) * 0.04).astype(np.float32))


def update_by_recording(folder: Path, frames: list[RgbdFrame]) -> MapUpdate:
    """Update the map by a recording of few frames."""
    return gslts.update_map(
        folder,
        RecordedRobot(frames),
        UPDATE,
        detection=change_room.CONFIG,
        frames=frames,
        monitor=MonitorConfig(needed=1, confidence=MIN_RECORDED_CONFIDENCE),
    )


def test_objects_in_few_frames_of_coarse_depth_are_added(folder: Path) -> None:
    """Two views show each of two boxes: one is a training view, one a validation view."""
    home = change_room.home()
    boxes = [
        change_room.thing("Box|3", 2.6, 1.9, change_room.YELLOW, "Block|1"),
        change_room.thing("Box|4", 1.0, 2.6, change_room.BLUE, "Floor|1"),
    ]
    home = replace(home, objects=(*home.objects, *boxes))
    viewpoints = [Viewpoint(2.5, 0.5, 90, 30), Viewpoint(1.5, 0.75, 60, 30)]
    viewpoints += [Viewpoint(1.0, 1.0, 90, 30), Viewpoint(0.5, 1.25, 70, 30)]
    frames = [
        coarse(change_room.see(home, viewpoint, "kinect", seed))
        for seed, viewpoint in enumerate(viewpoints)
    ]
    before = read_map(folder)
    done = update_by_recording(folder, frames)
    assert done.status == "updated"
    assert done.result is not None
    assert {change.kind for change in done.result.changes} == {"addition"}
    after = read_map(folder)
    for box, viewpoint in zip(
        boxes, (Viewpoint(2.25, 0.5, 80, 30), Viewpoint(0.75, 1.0, 80, 30)), strict=True
    ):
        test = change_room.see(home, viewpoint)
        without = tuple(item for item in home.objects if item.id != box.id)
        shown = test.depth < change_room.see(replace(home, objects=without), viewpoint).depth - 0.01
        assert shown.sum() > 100
        errors = [
            np.mean((render(each, test.camera).rgb - test.rgb / 255)[shown] ** 2)
            for each in (before, after)
        ]
        assert 10 * np.log10(errors[0] / errors[1]) > 3


def mirror(image: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(image[:, ::-1])


@pytest.mark.parametrize(
    "spoil",
    [
        lambda frame: replace(frame, rgb=(0.02 * frame.rgb).astype(np.uint8)),
        lambda frame: replace(frame, rgb=cv2.GaussianBlur(frame.rgb, (0, 0), 6)),
        lambda frame: replace(frame, depth=np.zeros_like(frame.depth)),
        lambda frame: replace(frame, depth=np.float32(1.15) * frame.depth),
        lambda frame: replace(frame, rgb=mirror(frame.rgb), depth=mirror(frame.depth)),
    ],
    ids=["lights off", "smeared", "no depth", "wrong scale", "mirrored"],
)
@pytest.mark.parametrize("rounded", [False, True])
def test_a_spoiled_visit_gives_no_version(
    folder: Path, spoil: Callable[[RgbdFrame], RgbdFrame], *, rounded: bool
) -> None:
    home = update_room.changed_home("removal")
    frames = [
        change_room.see(home, viewpoint, "kinect")
        for viewpoint in update_room.viewpoints_of_the_change()
    ]
    frames = [spoil(coarse(frame) if rounded else frame) for frame in frames]
    done = update_by_recording(folder, frames)
    assert (done.status, done.version.number) == ("rejected", 1)
    assert done.reason is not None
    expected = (
        f"none of {len(frames)} frames can be compared with the map"
        if any((frame.depth > 0).any() for frame in frames)
        else "depth is measured in 0 % of the changed pixels"
    )
    assert expected in done.reason
