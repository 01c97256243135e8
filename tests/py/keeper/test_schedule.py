"""Changes that wait for a later round."""

import numpy as np

from gslts.change.changes import Change
from gslts.change.confirmation import Report
from gslts.keeper.schedule import DeferredChange, due_reports

A, B = np.array([1.0, 1.0, 0.5]), np.array([3.0, 1.0, 0.5])
BOX = np.full(3, 0.1)
MOVE = Change("relocation", 0.9, B, ((A - BOX, A + BOX), (B - BOX, B + BOX)))
REPORT = Report(1, MOVE, (0.0,))


def deferred(change: Change, retry_round: int) -> DeferredChange:
    x, y, z = change.point
    return DeferredChange(
        kind=change.kind, point=(x, y, z), reason="no view", attempts=1, retry_round=retry_round
    )


def test_of_a_relocation_with_a_deferred_end_the_other_end_is_due() -> None:
    gone, came = MOVE.end("before"), MOVE.end("after")
    (due,) = due_reports([deferred(gone, 2)], [REPORT], 1)
    assert (due.change.kind, due.number) == ("addition", 1)
    assert np.array_equal(due.change.point, B)
    (due,) = due_reports([deferred(came, 2)], [REPORT], 1)
    assert due.change.kind == "removal"
    assert due_reports([deferred(gone, 2), deferred(came, 2)], [REPORT], 1) == []


def test_a_deferred_change_is_due_in_its_round() -> None:
    assert due_reports([deferred(MOVE, 2)], [REPORT], 1) == []
    (due,) = due_reports([deferred(MOVE, 2)], [REPORT], 2)
    assert due.change is MOVE


def test_a_relocation_of_which_no_end_is_known_is_due() -> None:
    unknown = Report(1, Change("relocation", 0.9, B), (0.0,))
    (due,) = due_reports([], [unknown], 1)
    assert due.change is unknown.change
    assert due_reports([deferred(unknown.change, 2)], [unknown], 1) == []
