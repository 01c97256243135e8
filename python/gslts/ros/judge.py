"""Lane that judges the newest frame: places it in the map, and looks for changes in it."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gslts.core.frame import RgbdFrame
from gslts.localization.localizer import Localizer
from gslts.localization.relocalizer import Localization
from gslts.ros.constants import STILL_M, STILL_PERIOD_S, STILL_RAD, WATCH_M, WATCH_RAD
from gslts.ros.frame_memory import FrameMemory, has_moved
from gslts.ros.intake import Intake
from gslts.types import Floats

WAIT_S = 0.1
"""Maximum time to wait for an image before a stop is noticed, s."""
PAUSE_S = 0.05
"""Time between two tests if a robot that stands still moves on, s."""


@dataclass(frozen=True, eq=False)
class Judged:
    """Result for one frame.

    Attributes:
        frame: Placed in the map, or with a fault.
        found: Its localization; None if frames are not localized.
        latency_s: Time from its stamp to the result, s.
        map_from_odometry: [4,4] correction of the odometry by the last localized frame, m.
    """

    frame: RgbdFrame
    found: Localization | None
    latency_s: float
    map_from_odometry: Floats


class Judge:
    """Judges frames in a thread of its own; use it in a `with` statement.

    Args:
        intake: Source of the frames.
        memory: Gets the placed frames.
        rate_hz: Maximum number of frames per second.
        now_s: Returns the time of the stamps, s.
        localizer: Places frames in the map; None keeps their poses.
        watch: Looks for changes in a placed frame; None if there is no map yet.
        on_judged: Called with each result; second, True if the frame is a keyframe.
    """

    def __init__(
        self,
        intake: Intake,
        memory: FrameMemory,
        rate_hz: float,
        now_s: Callable[[], float],
        *,
        localizer: Localizer | None = None,
        watch: Callable[[RgbdFrame], None] | None = None,
        on_judged: Callable[[Judged, bool], None],
    ) -> None:
        self._intake, self._memory, self._now_s = intake, memory, now_s
        self._period_s, self._localizer = 1 / rate_hz, localizer
        self._watch, self._on_judged = watch, on_judged
        self._correction: Floats = np.eye(4)
        self._last_pose: Floats | None = None
        self._watched_pose: Floats | None = None
        self._failure: Exception | None = None
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._work, name="gslts-judge", daemon=True)

    def __enter__(self) -> Judge:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()

    def map_from_odometry(self) -> Floats:
        """Return the [4,4] correction of the odometry by the last localized frame."""
        return self._correction

    def require_working(self) -> None:
        """Raise the error that ended the lane, if there is one.

        Raises:
            RuntimeError: The lane has failed.
        """
        if self._failure is not None:
            raise RuntimeError(f"frames are not judged: {self._failure}") from self._failure

    def _work(self) -> None:
        next_s = last_s = 0.0
        try:
            while not self._stop.is_set():
                now_s = time.monotonic()
                rests = now_s - last_s < STILL_PERIOD_S and self._rests()
                if now_s < next_s or rests:
                    self._stop.wait(PAUSE_S if rests else next_s - now_s)
                    continue
                frame = self._intake.take(WAIT_S)
                if frame is not None:
                    last_s, next_s = now_s, now_s + self._period_s
                    self._judge(frame)
        except Exception as error:  # Raised in the main thread.
            self._failure = error

    def _rests(self) -> bool:
        """Return True if the robot stands where it stood, and nobody waits for a frame."""
        if self._last_pose is None or self._memory.wanted.is_set():
            return False
        try:
            pose = self._intake.latest_pose()
        except ValueError:
            return False
        return not has_moved(self._last_pose, pose, STILL_M, STILL_RAD)

    def _judge(self, frame: RgbdFrame) -> None:
        self._last_pose = frame.camera.world_from_camera
        found, placed = None, frame
        if self._localizer is not None:
            found = self._localizer.localize(frame)
            placed = self._localizer.placed(frame, found)
            if self._localizer.world_from_odometry is not None:
                self._correction = self._localizer.world_from_odometry
        if self._watch is not None and not self._memory.wanted.is_set():
            # A lane that waits for this frame watches it itself.
            self._watch_if_moved(self._watch, placed)
        latency_s = self._now_s() - frame.time_s
        is_key = self._memory.add(placed)
        self._on_judged(Judged(placed, found, latency_s, self._correction), is_key)

    def _watch_if_moved(self, watch: Callable[[RgbdFrame], None], frame: RgbdFrame) -> None:
        pose, last = frame.camera.world_from_camera, self._watched_pose
        if last is None or has_moved(last, pose, WATCH_M, WATCH_RAD):
            self._watched_pose = pose
            watch(frame)
