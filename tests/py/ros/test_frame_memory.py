"""Frames that lanes share, and changes that wait for views."""

import threading

import numpy as np
import pytest

from gslts.change.changes import Change
from gslts.change.confirmation import Report
from gslts.core.camera import camera_from_fov, look_at
from gslts.core.frame import RgbdFrame
from gslts.ros.constants import LEAVE_S, MAX_KEYFRAMES, MAX_WAIT_S
from gslts.ros.frame_memory import FrameMemory
from gslts.ros.waiting import WaitingChanges

TARGET = np.array([2.0, 0.0, 0.5])


def frame_at(y_m: float, time_s: float, fault: str | None = None) -> RgbdFrame:
    """A frame that shows the target."""
    camera = camera_from_fov(32, 24, 1.0, look_at(np.array([0.0, y_m, 1.0]), TARGET))
    rgb, depth = np.zeros((24, 32, 3), np.uint8), np.zeros((24, 32), np.float32)
    return RgbdFrame(rgb, depth, camera, time_s, fault=fault)


def test_keyframes_are_apart_and_without_a_fault() -> None:
    memory = FrameMemory()
    assert memory.add(frame_at(0, 1))
    assert not memory.add(frame_at(0.01, 2)), "too near"
    assert not memory.add(frame_at(0.5, 3, fault="lost"))
    assert memory.add(frame_at(0.5, 4))
    assert [frame.time_s for frame in memory.since(0)] == [1, 4]
    assert [frame.time_s for frame in memory.since(2)] == [4]
    memory.add(frame_at(0.51, 5))
    assert [frame.time_s for frame in memory.since(2)] == [4, 5], "the newest frame counts"


def test_memory_is_bounded() -> None:
    memory = FrameMemory()
    for number in range(3 * MAX_KEYFRAMES):
        memory.add(frame_at(0.5 * number, number))
    assert len(memory.since(0)) == MAX_KEYFRAMES


def test_a_lane_waits_for_a_frame_that_is_taken_from_now_on() -> None:
    memory = FrameMemory()
    memory.add(frame_at(0, 1))
    got: list[RgbdFrame | None] = []
    waiting = threading.Thread(target=lambda: got.append(memory.wait_after(lambda: 1.5, 20)))
    waiting.start()
    assert memory.wanted.wait(20)
    memory.add(frame_at(0, 1.4))
    memory.add(frame_at(0, 1.6))
    waiting.join()
    assert got[0] is not None
    assert got[0].time_s == 1.6
    assert not memory.wanted.is_set()
    assert memory.wait_after(lambda: 2.0, 0.01) is None


def test_frames_from_before_the_clock_was_set_back_are_forgotten() -> None:
    memory = FrameMemory()
    memory.add(frame_at(0, 1000))
    assert memory.wait_after(lambda: 900, 0.01) is None, "it was taken before"
    memory.add(frame_at(1, 901))
    assert [frame.time_s for frame in memory.since(0)] == [901]


def report(number: int, kind: str, times_s: tuple[float, ...], x_m: float = 2.0) -> Report:
    point = np.array([x_m, 0.0, 0.5])
    box = (point - 0.1, point + 0.1)
    boxes = (box, None) if kind == "removal" else (None, box)
    return Report(number, Change(kind, 0.9, point, boxes), times_s)  # type: ignore[arg-type]


def test_a_change_waits_until_enough_views_show_it() -> None:
    waiting, memory = WaitingChanges(3), FrameMemory()
    waiting.add([report(1, "removal", (10.0, 10.2))])
    memory.add(frame_at(-1, 9.0))
    for number, time_s in enumerate((10.0, 11.0)):
        memory.add(frame_at(number, time_s))
        assert waiting.take_ready(time_s, memory.since) == ([], [])
    memory.add(frame_at(2, 12.0))
    reports, frames = waiting.take_ready(12.0, memory.since)
    assert [r.number for r in reports] == [1]
    assert [frame.time_s for frame in frames] == [10, 11, 12], "none from before the change"
    assert waiting.take_ready(12.0, memory.since) == ([], [])


@pytest.mark.parametrize(("later_s", "ready"), [(LEAVE_S - 1, 0), (LEAVE_S + 1, 1)])
def test_a_change_that_the_robot_left_is_tried_with_its_views(later_s: float, ready: int) -> None:
    waiting, memory = WaitingChanges(9), FrameMemory()
    waiting.add([report(1, "removal", (10.0,))])
    memory.add(frame_at(0, 10.0))
    reports, _ = waiting.take_ready(10.0 + later_s, memory.since)
    assert len(reports) == ready


def test_no_change_waits_for_ever() -> None:
    waiting, memory = WaitingChanges(1000), FrameMemory()
    waiting.add([report(1, "removal", (10.0,))])
    memory.add(frame_at(0, 11 + MAX_WAIT_S))
    assert len(waiting.take_ready(11 + MAX_WAIT_S, memory.since)[0]) == 1


def test_a_change_waits_for_views_when_the_clock_was_set_back() -> None:
    waiting, memory = WaitingChanges(2), FrameMemory()
    waiting.add([report(1, "removal", (1000.0,))])
    memory.add(frame_at(0, 10.0))
    assert waiting.take_ready(10.0, memory.since) == ([], [])
    memory.add(frame_at(1, 11.0))
    reports, frames = waiting.take_ready(11.0, memory.since)
    assert [r.number for r in reports] == [1]
    assert [frame.time_s for frame in frames] == [10, 11]


def test_a_second_report_of_a_change_replaces_the_first() -> None:
    waiting = WaitingChanges(3)
    waiting.add([report(1, "removal", (10.0,)), report(2, "addition", (10.0,))])
    waiting.add([report(3, "removal", (20.0,), 2.1), report(4, "removal", (20.0,), 4.0)])
    assert sorted(r.number for r in waiting.take_all()) == [2, 3, 4]
    assert waiting.changes == []
