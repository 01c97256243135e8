"""Reports that wait until the map shows their changes."""

from types import SimpleNamespace

import numpy as np

from gslts.change.changes import Change, Kind
from gslts.change.confirmation import Report
from gslts.keeper.report_queue import ReportQueue


def report(number: int, kind: Kind, x_m: float, replaces: int | None = None) -> Report:
    point = np.array([x_m, 0.0, 0.5])
    box = point - 0.1, point + 0.1
    boxes = {"removal": (box, None), "addition": (None, box), "relocation": (box, box)}[kind]
    return Report(number, Change(kind, 0.9, point=point, boxes=boxes), (1.0,), replaces)


def queue_of(*polls: list[Report]) -> ReportQueue:
    """A queue whose monitor confirms something at each poll."""
    left = list(polls)
    monitor = SimpleNamespace(poll=lambda: left.pop(0) if left else [])
    return ReportQueue(monitor)  # type: ignore[arg-type]


def test_reports_are_taken_once() -> None:
    first, second = report(1, "removal", 0), report(2, "addition", 2)
    queue = queue_of([first], [second])
    assert queue.take() == [first]
    assert queue.take() == [second]
    assert queue.take() == []


def test_what_was_put_back_comes_again_unless_a_new_report_replaces_it() -> None:
    first, again, other = (
        report(1, "removal", 0),
        report(3, "removal", 0.1),
        report(2, "addition", 2),
    )
    queue = queue_of([first, other], [again])
    queue.put_back(queue.take())
    assert queue.take() == [other, again]
    end, whole = report(1, "removal", 0), report(2, "relocation", 5, replaces=1)
    queue = queue_of([end], [whole])
    queue.put_back(queue.take())
    assert queue.take() == [whole]


def test_reports_of_what_the_map_shows_now_are_dropped() -> None:
    first, other = report(1, "removal", 0), report(2, "removal", 2)
    again = report(3, "removal", 0.1)  # Confirmed during the update that integrates the first.
    queue = queue_of([first, other], [again])
    queue.put_back(queue.take()[1:])
    queue.drop([first.change])
    assert queue.take() == [other]


def test_of_a_change_that_waits_already_nothing_is_put_back() -> None:
    first, other, again = (
        report(1, "removal", 0),
        report(2, "removal", 2),
        report(3, "removal", 2.1),
    )
    queue = queue_of([first, other], [again])
    taken = queue.take()
    queue.drop([first.change])
    queue.put_back(taken[1:])
    assert queue.take() == [again]
