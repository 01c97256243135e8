"""Recording of the keyframes of a running robot, in a thread of its own."""

from __future__ import annotations

import queue
import threading
from pathlib import Path

from gslts.core.frame import RgbdFrame
from gslts.datasets.recording import RecordingWriter
from gslts.ros.constants import MAX_RECORDS_WAITING
from gslts.ros.problems import Problems


class Recorder:
    """Writes frames as a data set that `gslts map` takes; the robot never waits for the disk.

    Args:
        folder: Of the data set; new, empty, or a recording to continue.
        problems: Gets what goes wrong.

    Raises:
        OSError: The folder cannot be written.
        ValueError: The folder holds something else.
    """

    def __init__(self, folder: Path, problems: Problems) -> None:
        self._writer = RecordingWriter(folder)
        self._problems = problems
        self._frames: queue.Queue[RgbdFrame | None] = queue.Queue(MAX_RECORDS_WAITING)
        self._thread = threading.Thread(target=self._work, name="gslts-recorder", daemon=True)
        self._thread.start()

    @property
    def count(self) -> int:
        """Number of frames on the disk."""
        return self._writer.count

    def add(self, frame: RgbdFrame) -> None:
        """Queue a frame and return at once; without room it is dropped, and a problem reported.

        Args:
            frame: At the pose that the robot believes.
        """
        try:
            self._frames.put_nowait(frame)
        except queue.Full:
            self._problems.report("recording", "the disk is too slow: a frame was dropped")

    def close(self) -> None:
        """Write what waits, and the list of the frames."""
        self._frames.put(None)
        self._thread.join()

    def _work(self) -> None:
        while (frame := self._frames.get()) is not None:
            try:
                self._writer.add(frame)
            except (OSError, ValueError) as error:
                self._problems.report("recording", str(error))
        self._writer.keep_complete_frames()
