"""Confirms changes over several frames, in a thread of its own."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from gslts.change.changes import Change
from gslts.change.detector import ChangeDetector, Detection
from gslts.change.rules import relocation_of
from gslts.core.frame import RgbdFrame


@dataclass(frozen=True)
class MonitorConfig:
    """Settings of the confirmation of changes.

    Args:
        rate_hz: Maximum number of frames per second that are compared with the map.
        queue: Maximum number of frames that wait; the oldest are dropped.
        window: Number of last frames that count.
        needed: Number of these frames that must show a change, so that people who walk through
            the view are not reported.
        confidence: Minimum confidence that these frames give together, in [0, 1): the product of
            their odds, as if each erred by itself.
        near_m: Maximum distance of two observations of one change, m.

    Raises:
        ValueError: A setting is out of range.
    """

    rate_hz: float = 2.0
    queue: int = 4
    window: int = 6
    needed: int = 3
    confidence: float = 0.0
    near_m: float = 0.3

    def __post_init__(self) -> None:
        if not (self.rate_hz > 0 and self.queue >= 1 and self.near_m > 0):
            raise ValueError("MonitorConfig: rate_hz, queue and near_m must be positive")
        if not 1 <= self.needed <= self.window:
            raise ValueError(
                f"MonitorConfig: needed must be in 1..{self.window}, got {self.needed}"
            )
        if not 0 <= self.confidence < 1:
            raise ValueError(f"MonitorConfig: confidence must be in [0, 1), got {self.confidence}")


@dataclass(frozen=True, eq=False)
class Report:
    """A confirmed change.

    Attributes:
        number: Number of the report, from 1.
        change: The change as last observed.
        times_s: `RgbdFrame.time_s` of the frames that show it.
        replaces: Number of the report of its other end, if a removal and an addition observed in
            different frames turn out to be one relocation.
    """

    number: int
    change: Change
    times_s: tuple[float, ...]
    replaces: int | None = None


@dataclass(frozen=True)
class Counts:
    """Numbers of frames so far.

    Attributes:
        offered: Frames given to the monitor.
        dropped: Frames dropped because newer ones came.
        processed: Frames compared with the map.
        unreliable: Processed frames that cannot be compared.
    """

    offered: int = 0
    dropped: int = 0
    processed: int = 0
    unreliable: int = 0


@dataclass(eq=False)
class _Candidate:
    """A change observed in some of the last frames.

    Attributes:
        change: The change as last observed.
        frames: Number, time, s, and confidence of the frames that show it.
        reported: Number of its report; None if there is none yet.
    """

    change: Change
    frames: list[tuple[int, float, float]] = field(default_factory=list)
    reported: int | None = None


class ChangeMonitor:
    """Detects and confirms changes in a thread of its own; use it in a `with` statement.

    Args:
        detector: Detector for the current version of the map.
        config: Settings; None means the defaults.
        localize: Corrects the pose of each frame first, such as
            `gslts.localization.localizer.Localizer.localize_frame`; None keeps its pose.
        clock: Returns the time, s, by which the rate is kept.
    """

    def __init__(
        self,
        detector: ChangeDetector,
        config: MonitorConfig | None = None,
        *,
        localize: Callable[[RgbdFrame], RgbdFrame] | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.config = MonitorConfig() if config is None else config
        self._detector, self._localize, self._clock = detector, localize, clock
        self._frames: deque[RgbdFrame] = deque(maxlen=self.config.queue)
        self._candidates: list[_Candidate] = []
        self._reports: deque[Report] = deque()
        self._counts = Counts()
        self._last_number = 0
        self._failure: Exception | None = None
        self._closing = False
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._work, name="gslts-changes", daemon=True)
        self._thread.start()

    def __enter__(self) -> ChangeMonitor:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def offer(self, frame: RgbdFrame) -> None:
        """Queue a frame and return at once; the oldest frame that waits may be dropped.

        Args:
            frame: Next frame of the robot.

        Raises:
            RuntimeError: The monitor is closed, or has failed.
        """
        with self._changed:
            self._require_open()
            full = len(self._frames) == self.config.queue
            self._frames.append(frame)
            counts = self._counts
            self._counts = replace(
                counts, offered=counts.offered + 1, dropped=counts.dropped + full
            )
            self._changed.notify_all()

    def poll(self) -> list[Report]:
        """Return the changes confirmed since the last call.

        Raises:
            RuntimeError: The monitor has failed.
        """
        with self._changed:
            self._require_working()
            reports = list(self._reports)
            self._reports.clear()
            return reports

    def resolve(self, report: Report) -> None:
        """Forget a change: if it is still observed, it will be reported again.

        Args:
            report: Report of the change.
        """
        with self._changed:
            self._candidates = [
                candidate for candidate in self._candidates if candidate.reported != report.number
            ]

    def publish(self, detector: ChangeDetector) -> None:
        """Use the detector of a new version of the map from the next frame on.

        Observations against the old version are forgotten; a frame that is being processed still
        belongs to the old version and does not count.

        Args:
            detector: Detector for the new version.
        """
        with self._changed:
            self._detector = detector
            self._candidates = []

    @property
    def counts(self) -> Counts:
        """Numbers of frames so far."""
        with self._changed:
            return self._counts

    @property
    def is_pending(self) -> bool:
        """True if the last frame shows a change that is not confirmed yet."""
        with self._changed:
            number = self._counts.processed
            return any(
                candidate.reported is None and candidate.frames[-1][0] == number
                for candidate in self._candidates
            )

    def wait(self, timeout_s: float | None = None) -> bool:
        """Wait until all frames are processed or dropped.

        Args:
            timeout_s: Maximum time, s; None means no limit.

        Returns:
            False if the time ran out.

        Raises:
            RuntimeError: The monitor has failed.
        """
        with self._changed:
            idle = self._changed.wait_for(
                lambda: self._is_idle() or self._failure is not None, timeout_s
            )
            self._require_working()
            return idle

    def close(self) -> None:
        """Stop after the frame that is being processed; frames that wait are dropped."""
        with self._changed:
            self._closing = True
            waiting = len(self._frames)
            self._frames.clear()
            self._counts = replace(self._counts, dropped=self._counts.dropped + waiting)
            self._changed.notify_all()
        self._thread.join()

    def _is_idle(self) -> bool:
        counts = self._counts
        return counts.offered == counts.dropped + counts.processed

    def _require_working(self) -> None:
        if self._failure is not None:
            raise RuntimeError(f"ChangeMonitor: it has stopped: {self._failure}") from self._failure

    def _require_open(self) -> None:
        self._require_working()
        if self._closing:
            raise RuntimeError("ChangeMonitor: it is closed")

    def _work(self) -> None:
        next_s = -np.inf
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._closing or self._frames)
                # A pause keeps to the rate; only `close` cuts it short.
                while not self._closing and (pause_s := next_s - self._clock()) > 0:
                    self._changed.wait(pause_s)
                if self._closing:
                    return
                frame, detector = self._frames.popleft(), self._detector
            next_s = self._clock() + 1 / self.config.rate_hz
            try:
                if self._localize is not None:
                    frame = self._localize(frame)
                self._add(detector, frame, detector.detect(frame))
            except Exception as error:  # Raised in the thread of the caller.
                with self._changed:
                    self._failure = error
                    self._changed.notify_all()
                return

    def _add(self, detector: ChangeDetector, frame: RgbdFrame, detection: Detection) -> None:
        """Count a processed frame, and its changes unless the map has changed meanwhile."""
        with self._changed:
            counts = self._counts
            number = counts.processed + 1
            unreliable = counts.unreliable + (detection.unreliable is not None)
            self._counts = replace(counts, processed=number, unreliable=unreliable)
            if detector is self._detector:
                self._observe(number, frame.time_s, detection.changes)
            self._changed.notify_all()

    def _observe(self, number: int, time_s: float, changes: tuple[Change, ...]) -> None:
        """Match the changes of a frame with candidates, and report those with enough frames."""
        for change, candidate in self._match(changes):
            if candidate.change.kind == change.kind:  # An end tells less than a relocation.
                candidate.change = change
            if not candidate.frames or candidate.frames[-1][0] != number:  # A frame counts once.
                candidate.frames.append((number, time_s, change.confidence))
        first = number - self.config.window + 1
        for candidate in list(self._candidates):
            candidate.frames = [frame for frame in candidate.frames if frame[0] >= first]
            if candidate.reported is None and self._is_confirmed(candidate):
                self._report(candidate)
        self._candidates = [
            candidate
            for candidate in self._candidates
            if candidate.frames or candidate.reported is not None
        ]

    def _is_confirmed(self, candidate: _Candidate) -> bool:
        if len(candidate.frames) < self.config.needed:
            return False
        confidences = np.array([confidence for _, _, confidence in candidate.frames])
        # Of the product of the odds: p / (p + q).
        true, false = np.prod(confidences), np.prod(1 - confidences)
        return bool(true >= self.config.confidence * (true + false))

    def _report(self, candidate: _Candidate) -> None:
        other = self._join(candidate)
        if other is not None:
            self._candidates.remove(other)
        self._last_number += 1
        candidate.reported = self._last_number
        times_s = tuple(time_s for _, time_s, _ in candidate.frames)
        replaces = None if other is None else other.reported
        self._reports.append(Report(self._last_number, candidate.change, times_s, replaces))

    def _join(self, candidate: _Candidate) -> _Candidate | None:
        """Return the reported end that a candidate includes; make it a relocation if they join."""
        for other in self._candidates:
            if other.reported is None or other is candidate:
                continue
            if self._is_end(other.change, candidate.change):
                return other
            ends = {end.change.kind: end.change for end in (candidate, other)}
            if set(ends) == {"removal", "addition"}:
                rule = self._detector.config.objects
                whole = relocation_of(ends["removal"], ends["addition"], rule)
                if whole is not None:
                    candidate.change = whole
                    return other
        return None

    def _match(self, changes: Sequence[Change]) -> list[tuple[Change, _Candidate]]:
        """Return the candidate of each change of a frame.

        It is the nearest one of the same kind, and each candidate has at most one of them, as two
        objects may stand side by side; or a relocation of which the change is an end; or a new one.
        """
        pairs = sorted(
            (float(np.linalg.norm(candidate.change.point - change.point)), row, column)
            for row, change in enumerate(changes)
            for column, candidate in enumerate(self._candidates)
            if candidate.change.kind == change.kind
        )
        matched: dict[int, _Candidate] = {}
        taken: set[int] = set()
        for distance_m, row, column in pairs:
            if distance_m <= self.config.near_m and row not in matched and column not in taken:
                matched[row] = self._candidates[column]
                taken.add(column)
        for row, change in enumerate(changes):
            if row not in matched:
                matched[row] = self._whole_of(change) or _Candidate(change)
            if matched[row] not in self._candidates:
                self._candidates.append(matched[row])
        return [(change, matched[row]) for row, change in enumerate(changes)]

    def _whole_of(self, change: Change) -> _Candidate | None:
        """Return a relocation of which a change is an end; None if there is none."""
        wholes = (
            candidate for candidate in self._candidates if self._is_end(change, candidate.change)
        )
        return next(wholes, None)

    def _is_end(self, change: Change, whole: Change) -> bool:
        """Test if a removal or an addition is one end of a relocation."""
        if whole.kind != "relocation" or change.kind == "relocation":
            return False
        end = whole.end_point("before" if change.kind == "removal" else "after")
        return end is not None and float(np.linalg.norm(end - change.point)) <= self.config.near_m


def confirm_changes(
    detector: ChangeDetector, frames: Sequence[RgbdFrame], config: MonitorConfig | None = None
) -> tuple[list[Change], Counts]:
    """Confirm changes over recorded frames; all frames are processed.

    Args:
        detector: Detector for the map.
        frames: Frames in the order in which they were taken.
        config: Settings of the confirmation; None means the defaults.

    Returns:
        Confirmed changes, by falling confidence, and the numbers of frames.

    Raises:
        RuntimeError: A frame could not be processed.
    """
    config = replace(config or MonitorConfig(), rate_hz=1e6, queue=max(1, len(frames)))
    with ChangeMonitor(detector, config) as monitor:
        for frame in frames:
            monitor.offer(frame)
        monitor.wait()
        reports, counts = monitor.poll(), monitor.counts
    return sorted(latest_changes(reports), key=lambda change: -change.confidence), counts


def latest_changes(reports: Sequence[Report]) -> list[Change]:
    """Return the changes of reports that no later one replaces.

    Args:
        reports: Reports of one monitor, in their order.
    """
    replaced = {report.replaces for report in reports}
    return [report.change for report in reports if report.number not in replaced]
