"""Standing watch for changes while other work goes on."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from gslts.change.changes import Change, joined
from gslts.change.detector import ChangeDetector, Detection
from gslts.core.frame import RgbdFrame


@dataclass(frozen=True)
class MonitorConfig:
    """When a change is believed.

    Attributes:
        rate_hz: Frames that are looked at, at most.
        queue: Frames that wait, at most; the oldest are dropped.
        window: Of the last so many frames that were looked at,
        needed: so many must show a change: who walks through is gone by then.
        near_m: Sightings of one kind within this distance are one change.
    """

    rate_hz: float = 2.0
    queue: int = 4
    window: int = 6
    needed: int = 3
    near_m: float = 0.3

    def __post_init__(self) -> None:
        if not (self.rate_hz > 0 and self.queue >= 1 and self.near_m > 0):
            raise ValueError("MonitorConfig: rate_hz, queue and near_m must be positive")
        if not 1 <= self.needed <= self.window:
            raise ValueError(
                f"MonitorConfig: needed must be in 1..{self.window}, got {self.needed}"
            )


@dataclass(frozen=True, eq=False)
class Report:
    """A change that was seen often enough.

    Attributes:
        number: Of the report, from 1.
        change: As last seen.
        frames: When it was seen, `RgbdFrame.time_s`.
        replaces: Number of the report of its other end, if a removal and an addition that were seen
            in different frames are one relocation.
    """

    number: int
    change: Change
    frames: tuple[float, ...]
    replaces: int | None = None


@dataclass(frozen=True)
class Counts:
    """Frames so far: offered, dropped because others were newer, looked at, and unreliable."""

    offered: int = 0
    dropped: int = 0
    looked_at: int = 0
    unreliable: int = 0


@dataclass(eq=False)
class _Suspicion:
    """A change as it was seen so far."""

    change: Change
    seen: list[tuple[int, float]] = field(default_factory=list)  # Number and time of the frame.
    reported: int | None = None


class ChangeMonitor:
    """Looks for changes in a thread of its own; use it in a `with` statement.

    Args:
        detector: Of the map as it is.
        config: Settings.
        locate: Puts a frame where it was taken before it is looked at, such as
            `gslts.localization.localizer.Localizer.located`; None means that it says itself where.
        clock: Returns the time in s by which the rate is kept.
    """

    def __init__(
        self,
        detector: ChangeDetector,
        config: MonitorConfig | None = None,
        *,
        locate: Callable[[RgbdFrame], RgbdFrame] | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.config = MonitorConfig() if config is None else config
        self._detector, self._locate, self._clock = detector, locate, clock
        self._frames: deque[RgbdFrame] = deque(maxlen=self.config.queue)
        self._suspicions: list[_Suspicion] = []
        self._reports: deque[Report] = deque()
        self._counts = Counts()
        self._numbered = 0
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
        """Gives a frame to look at and returns at once; the oldest that waits may be dropped.

        Raises:
            RuntimeError: The monitor is closed, or has failed.
        """
        with self._changed:
            self._refuse_stopped()
            full = len(self._frames) == self.config.queue
            self._frames.append(frame)
            counts = self._counts
            self._counts = replace(
                counts, offered=counts.offered + 1, dropped=counts.dropped + full
            )
            self._changed.notify_all()

    def poll(self) -> list[Report]:
        """Changes that were confirmed since the last call.

        Raises:
            RuntimeError: The monitor has failed.
        """
        with self._changed:
            self._refuse_failed()
            reports = list(self._reports)
            self._reports.clear()
            return reports

    def resolve(self, report: Report) -> None:
        """Forgets a change: if it is still seen, it will be reported again."""
        with self._changed:
            self._suspicions = [one for one in self._suspicions if one.reported != report.number]

    def publish(self, detector: ChangeDetector) -> None:
        """From the next frame on, looks with the detector of a new version of the map.

        What was seen against the old one is forgotten; a frame that is being looked at now still
        belongs to the old version and is not counted.
        """
        with self._changed:
            self._detector = detector
            self._suspicions = []

    @property
    def counts(self) -> Counts:
        """Frames so far."""
        with self._changed:
            return self._counts

    @property
    def is_suspicious(self) -> bool:
        """Whether something was seen in the last frame that is not certain yet."""
        with self._changed:
            number = self._counts.looked_at
            return any(
                one.reported is None and one.seen[-1][0] == number for one in self._suspicions
            )

    def wait(self, timeout_s: float | None = None) -> bool:
        """Waits until no frame waits or is looked at; whether that came true in time.

        Raises:
            RuntimeError: The monitor has failed.
        """
        with self._changed:
            idle = self._changed.wait_for(
                lambda: self._idle() or self._failure is not None, timeout_s
            )
            self._refuse_failed()
            return idle

    def close(self) -> None:
        """Stops after the frame that is being looked at; what waits is dropped."""
        with self._changed:
            self._closing = True
            waiting = len(self._frames)
            self._frames.clear()
            self._counts = replace(self._counts, dropped=self._counts.dropped + waiting)
            self._changed.notify_all()
        self._thread.join()

    def _idle(self) -> bool:
        counts = self._counts
        return counts.offered == counts.dropped + counts.looked_at

    def _refuse_failed(self) -> None:
        if self._failure is not None:
            raise RuntimeError(f"ChangeMonitor: it has stopped: {self._failure}") from self._failure

    def _refuse_stopped(self) -> None:
        self._refuse_failed()
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
                if self._locate is not None:
                    frame = self._locate(frame)
                self._take(detector, frame, detector.detect(frame))
            except Exception as error:  # It is raised where the frames come from.
                with self._changed:
                    self._failure = error
                    self._changed.notify_all()
                return

    def _take(self, detector: ChangeDetector, frame: RgbdFrame, detection: Detection) -> None:
        with self._changed:
            counts = self._counts
            number = counts.looked_at + 1
            unreliable = counts.unreliable + (detection.unreliable is not None)
            self._counts = replace(counts, looked_at=number, unreliable=unreliable)
            if detector is self._detector:
                self._note(number, frame.time_s, detection.changes)
            self._changed.notify_all()

    def _note(self, number: int, time_s: float, changes: tuple[Change, ...]) -> None:
        first = number - self.config.window + 1
        for change in changes:
            known = self._like(change)
            if known is None:
                known = _Suspicion(change)
                self._suspicions.append(known)
            if known.change.kind == change.kind:  # An end tells less than the whole.
                known.change = change
            if not known.seen or known.seen[-1][0] != number:  # A frame counts once.
                known.seen.append((number, time_s))
        for one in list(self._suspicions):
            one.seen = [seen for seen in one.seen if seen[0] >= first]
            if one.reported is None and len(one.seen) >= self.config.needed:
                self._report(one)
        self._suspicions = [one for one in self._suspicions if one.seen or one.reported is not None]

    def _report(self, one: _Suspicion) -> None:
        other = self._joined(one)
        if other is not None:
            self._suspicions.remove(other)
        self._numbered += 1
        one.reported = self._numbered
        times_s = tuple(time_s for _, time_s in one.seen)
        replaces = None if other is None else other.reported
        self._reports.append(Report(self._numbered, one.change, times_s, replaces))

    def _joined(self, one: _Suspicion) -> _Suspicion | None:
        """The reported change that is part of one that is to be reported, which may grow by it."""
        for other in self._suspicions:
            if other.reported is None or other is one:
                continue
            if self._is_end(other.change, one.change):
                return other
            ends = {end.change.kind: end.change for end in (one, other)}
            if set(ends) == {"removal", "addition"}:
                rule = self._detector.config.objects
                whole = joined(ends["removal"], ends["addition"], rule)
                if whole is not None:
                    one.change = whole
                    return other
        return None

    def _like(self, change: Change) -> _Suspicion | None:
        """The nearest of a change's kind, or a relocation of which it is an end."""
        near = [
            (float(np.linalg.norm(one.change.point - change.point)), k, one)
            for k, one in enumerate(self._suspicions)
            if one.change.kind == change.kind
        ]
        distance_m, _, nearest = min(near, default=(np.inf, 0, None))
        if distance_m <= self.config.near_m:
            return nearest
        whole = (one for one in self._suspicions if self._is_end(change, one.change))
        return next(whole, None)

    def _is_end(self, change: Change, whole: Change) -> bool:
        """Whether a removal or an addition is an end of a relocation."""
        if whole.kind != "relocation" or change.kind == "relocation":
            return False
        end = whole.before if change.kind == "removal" else whole.after
        if end is None:
            return False
        return float(np.linalg.norm(end.point - change.point)) <= self.config.near_m


def confirmed(
    detector: ChangeDetector, frames: Sequence[RgbdFrame], config: MonitorConfig | None = None
) -> tuple[list[Change], Counts]:
    """The changes that a monitor reports of frames, the most certain first.

    Args:
        detector: Of the map.
        frames: In the order in which they were taken; each is looked at.
        config: When a change is believed; None means the defaults.

    Raises:
        RuntimeError: A frame could not be looked at.
    """
    config = replace(config or MonitorConfig(), rate_hz=1e6, queue=max(1, len(frames)))
    with ChangeMonitor(detector, config) as monitor:
        for frame in frames:
            monitor.offer(frame)
        monitor.wait()
        reports, counts = monitor.poll(), monitor.counts
    replaced = {report.replaces for report in reports}
    changes = [report.change for report in reports if report.number not in replaced]
    return sorted(changes, key=lambda change: -change.confidence), counts
