"""Detection of changes in a thread of its own, and over recorded frames."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gslts.change.changes import Change
from gslts.change.confirmation import (
    ChangeConfirmation,
    MonitorConfig,
    Report,
    latest_reports,
)
from gslts.change.detection import Detection
from gslts.change.detector import ChangeDetector
from gslts.core.frame import RgbdFrame


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
        self._confirmation = ChangeConfirmation(self.config)
        self._reports: deque[Report] = deque()
        self._counts = Counts()
        self._fault: str | None = None
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
            self._confirmation.forget(report)

    def publish(self, detector: ChangeDetector) -> None:
        """Use the detector of a new version of the map from the next frame on.

        Observations against the old version are forgotten; a frame that is being processed still
        belongs to the old version and does not count.

        Args:
            detector: Detector for the new version.
        """
        with self._changed:
            self._detector = detector
            self._confirmation.forget_all()

    @property
    def counts(self) -> Counts:
        """Numbers of frames so far."""
        with self._changed:
            return self._counts

    @property
    def fault(self) -> str | None:
        """Reason why the last frame cannot be compared; None if it can."""
        with self._changed:
            return self._fault

    @property
    def is_pending(self) -> bool:
        """True if the last frame shows a change that is not confirmed yet."""
        with self._changed:
            return self._confirmation.is_pending(self._counts.processed)

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
            self._fault = detection.unreliable
            if detector is self._detector:
                rule = detector.config.objects
                self._reports += self._confirmation.observe(
                    number, frame.time_s, detection.changes, rule
                )
            self._changed.notify_all()


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
        ValueError: There are fewer frames than must show a change.
        RuntimeError: A frame could not be processed.
    """
    config = config or MonitorConfig()
    if len(frames) < config.needed:
        raise ValueError(
            f"confirm_changes: frames: expected at least {config.needed}, as so many must show a "
            f"change, got {len(frames)}; see --needed"
        )
    config = replace(config, rate_hz=1e6, queue=len(frames))
    with ChangeMonitor(detector, config) as monitor:
        for frame in frames:
            monitor.offer(frame)
        monitor.wait()
        reports, counts = monitor.poll(), monitor.counts
    changes = [report.change for report in latest_reports(reports)]
    return sorted(changes, key=lambda change: -change.confidence), counts
