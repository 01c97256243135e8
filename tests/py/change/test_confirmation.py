"""Confirmation of plain changes over frames: relocations, their ends, and shifts beside them."""

from collections.abc import Sequence

import numpy as np
import pytest

from gslts.change.changes import Box, Change
from gslts.change.config import ObjectRule
from gslts.change.confirmation import ChangeConfirmation, MonitorConfig, Report


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
