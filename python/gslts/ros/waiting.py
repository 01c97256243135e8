"""Confirmed changes that wait until a robot on its own errands has seen enough of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from gslts.change.changes import Change
from gslts.change.confirmation import Report
from gslts.core.frame import RgbdFrame
from gslts.keeper.schedule import is_same_change
from gslts.ros.constants import LEAVE_S, MAX_WAIT_S
from gslts.update.evidence import is_visible
from gslts.update.region import regions_of


class WaitingChanges:
    """Keeps reports of changes until the frames since then show them from enough positions.

    Args:
        views: Number of views that an update wants of a region.
    """

    def __init__(self, views: int) -> None:
        self._views = views
        self._waiting: list[tuple[Report, float]] = []

    @property
    def changes(self) -> list[Change]:
        """The waiting changes."""
        return [report.change for report, _ in self._waiting]

    def add(self, reports: Sequence[Report]) -> None:
        """Add reports; a new report of a waiting change replaces the old one.

        Args:
            reports: Of the monitor.
        """
        for report in reports:
            since_s = min(report.times_s)
            for entry in list(self._waiting):
                if is_same_change(entry[0].change, report.change):
                    since_s = min(since_s, entry[1])
                    self._waiting.remove(entry)
            self._waiting.append((report, since_s))

    def take_ready(
        self, now_s: float, frames_since: Callable[[float], Sequence[RgbdFrame]]
    ) -> tuple[list[Report], list[RgbdFrame]]:
        """Take the changes that have enough views, or that the robot no longer sees.

        Args:
            now_s: Stamp of the newest frame, s.
            frames_since: Returns the frames in memory since a time, s.

        Returns:
            The reports, and the frames since the last of these changes was first seen: earlier
            frames may show the state before it.
        """
        # Where the clock was set back, a change is as new as the newest frame.
        self._waiting = [(report, min(since_s, now_s)) for report, since_s in self._waiting]
        ready = [
            (report, since_s)
            for report, since_s in self._waiting
            if self._is_ready(report.change, since_s, now_s, frames_since(since_s))
        ]
        self._waiting = [entry for entry in self._waiting if entry not in ready]
        if not ready:
            return [], []
        frames = list(frames_since(max(since_s for _, since_s in ready)))
        return [report for report, _ in ready], frames

    def take_all(self) -> list[Report]:
        """Take all reports: the robot itself drives to where it sees more."""
        reports = [report for report, _ in self._waiting]
        self._waiting = []
        return reports

    def _is_ready(
        self, change: Change, since_s: float, now_s: float, frames: Sequence[RgbdFrame]
    ) -> bool:
        if now_s - since_s > MAX_WAIT_S:
            return True
        for region in regions_of(change):
            shown = [frame for frame in frames if is_visible(frame, region)]
            last_s = shown[-1].time_s if shown else since_s
            if len(shown) < self._views and now_s - last_s < LEAVE_S:
                return False
        return True
