"""Confirmed changes that the map does not show yet."""

from __future__ import annotations

from collections.abc import Sequence

from gslts.change.changes import Change
from gslts.change.confirmation import Report, latest_reports
from gslts.change.monitor import ChangeMonitor
from gslts.keeper.schedule import is_same_change


class ReportQueue:
    """Reports of a monitor, with those that an error kept from being integrated.

    Args:
        monitor: Confirms changes.
    """

    def __init__(self, monitor: ChangeMonitor) -> None:
        self._monitor = monitor
        self._waiting: list[Report] = []

    def take(self) -> list[Report]:
        """Return all reports, once. A new report of a waiting change replaces the old one.

        Raises:
            RuntimeError: The monitor has failed.
        """
        reports, self._waiting = self._all(), []
        return reports

    def put_back(self, reports: Sequence[Report]) -> None:
        """Keep reports for the next `take`, unless later ones of the same changes wait.

        Args:
            reports: Taken before.
        """
        waiting = [report.change for report in self._waiting]
        self._waiting += _of_others(reports, waiting)

    def drop(self, changes: Sequence[Change]) -> None:
        """Drop the reports of changes that the map shows now.

        Frames that were taken during the update may have confirmed them again.

        Args:
            changes: As integrated.

        Raises:
            RuntimeError: The monitor has failed.
        """
        self._waiting = _of_others(self._all(), changes)

    def _all(self) -> list[Report]:
        new = self._monitor.poll()
        waiting = _of_others(self._waiting, [report.change for report in new])
        return latest_reports([*waiting, *new])


def _of_others(reports: Sequence[Report], changes: Sequence[Change]) -> list[Report]:
    """Return the reports of other changes."""
    return [
        report
        for report in reports
        if not any(is_same_change(report.change, change) for change in changes)
    ]
