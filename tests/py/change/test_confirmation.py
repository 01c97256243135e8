"""Confirmation of plain changes over frames: relocations, their ends, shifts, and few frames."""

from collections.abc import Sequence
from types import SimpleNamespace

import numpy as np
import pytest

from gslts.change.changes import Box, Change
from gslts.change.config import DetectionConfig, ObjectRule
from gslts.change.confirmation import ChangeConfirmation, MonitorConfig, Report
from gslts.change.detection import Detection
from gslts.change.monitor import confirm_changes
from gslts.core.camera import Camera
from gslts.core.frame import RgbdFrame


def point(x: float) -> np.ndarray:
    return np.array([x, 0.0, 1.0])


def box(x: float) -> Box:
    return point(x) - 0.05, point(x) + 0.05


RELOCATION = Change("relocation", 0.9, point(2.0), (box(0.0), box(2.0)))
REMOVAL = Change("removal", 0.9, point(0.0), (box(0.0), None))
ADDITION = Change("addition", 0.9, point(2.0), (None, box(2.0)))
BESIDE = Change("addition", 0.9, point(2.2), (None, box(2.2)))
SHIFT = Change("shift", 0.9, point(2.2), (box(2.2), box(2.2)), motion=np.eye(4))


def reports_of(*frames: Sequence[Change]) -> list[Report]:
    """Observe frames with these changes, and return all reports."""
    confirmation = ChangeConfirmation(MonitorConfig())
    return [
        report
        for number, changes in enumerate(frames)
        for report in confirmation.observe(number, float(number), changes, ObjectRule())
    ]


def summary(reports: Sequence[Report]) -> list[tuple[Change, int | None]]:
    return [(report.change, report.replaces) for report in reports]


@pytest.mark.parametrize("ends", [(REMOVAL, ADDITION), (ADDITION, REMOVAL)])
def test_both_ends_in_later_frames_are_the_reported_relocation(ends: tuple[Change, Change]) -> None:
    assert summary(reports_of(*[[RELOCATION]] * 3, *[ends] * 6)) == [(RELOCATION, None)]


def test_an_object_beside_both_ends_is_reported_too() -> None:
    later = (REMOVAL, ADDITION, BESIDE)
    found = summary(reports_of(*[[RELOCATION]] * 3, *[later] * 6))
    assert found == [(RELOCATION, None), (BESIDE, None)]


def test_a_shift_near_a_relocation_is_another_change() -> None:
    relocation, shift = [[RELOCATION]] * 3, [[SHIFT]] * 3
    both = [(RELOCATION, None), (SHIFT, None)]
    assert summary(reports_of(*relocation, *shift)) == both
    assert summary(reports_of(*shift, *relocation)) == both[::-1]


def test_frames_of_a_shift_confirm_no_relocation() -> None:
    assert reports_of([RELOCATION], [SHIFT], [SHIFT]) == []


@pytest.mark.parametrize("count", [0, 2])
def test_fewer_frames_than_must_show_a_change_are_rejected(count: int) -> None:
    camera = Camera(fx=8, fy=8, cx=4, cy=3, width=8, height=6, world_from_camera=np.eye(4))
    rgb, depth = np.zeros((6, 8, 3), np.uint8), np.ones((6, 8), np.float32)
    frames = [RgbdFrame(rgb, depth, camera)] * 3
    found = Detection((REMOVAL,), None, camera, rgb.astype(np.float32))
    detector = SimpleNamespace(config=DetectionConfig(), detect=lambda _: found)
    message = f"at least 3, as so many must show a change, got {count}; see --needed"
    with pytest.raises(ValueError, match=message):
        confirm_changes(detector, frames[:count])
    assert confirm_changes(detector, frames)[0] == [REMOVAL]
    assert confirm_changes(detector, frames[:1], MonitorConfig(needed=1))[0] == [REMOVAL]
