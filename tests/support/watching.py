"""Detectors and clocks for tests of the monitor, driven by the test alone."""

import threading

from gslts.change.detection import Detection
from gslts.change.detector import ChangeDetector
from gslts.change.monitor import ChangeMonitor
from gslts.core.frame import RgbdFrame

LONG_S = 60.0
"""Timeout of a test, s; nothing here takes as long."""


class Clock:
    """A clock that stands still until its time is set."""

    def __init__(self) -> None:
        self.time_s = 0.0

    def __call__(self) -> float:
        return self.time_s


class Gated:
    """A detector that processes a frame only when the test lets it through."""

    def __init__(self, detector: ChangeDetector) -> None:
        self._detector, self.config = detector, detector.config
        self._allowed, self._done = threading.Semaphore(0), threading.Semaphore(0)

    def detect(self, frame: RgbdFrame) -> Detection:
        assert self._allowed.acquire(timeout=LONG_S)
        try:
            return self._detector.detect(frame)
        finally:
            self._done.release()

    def let_through(self) -> None:
        """Let one frame through and wait until it was processed."""
        self._allowed.release()
        assert self._done.acquire(timeout=LONG_S)

    def open(self, frames: int) -> None:
        """Let a number of further frames through, now or later."""
        self._allowed.release(frames)


def close(monitor: ChangeMonitor) -> None:
    """Close a monitor; fail if that does not end in time."""
    closing = threading.Thread(target=monitor.close, daemon=True)
    closing.start()
    closing.join(LONG_S)
    assert not closing.is_alive()
