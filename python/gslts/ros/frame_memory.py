"""Frames that were placed in the map: the newest one, and keyframes along the path of the robot."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable

from gslts.core.frame import RgbdFrame
from gslts.core.se3 import pose_distance
from gslts.ros.constants import KEYFRAME_M, KEYFRAME_RAD, MAX_KEYFRAMES
from gslts.types import Floats


class FrameMemory:
    """Shares frames between the lane that judges them and the lane that updates the map.

    Attributes:
        wanted: Set while a lane waits for a new frame.
    """

    def __init__(self) -> None:
        self.wanted = threading.Event()
        self._newest: RgbdFrame | None = None
        self._keyframes: deque[RgbdFrame] = deque(maxlen=MAX_KEYFRAMES)
        self._new = threading.Condition()

    def add(self, frame: RgbdFrame) -> bool:
        """Add a frame.

        Args:
            frame: Placed in the map, or with a fault.

        Returns:
            True if it is a keyframe: it is without a fault, and the robot moved since the last one.
        """
        with self._new:
            if self._newest is not None and frame.time_s < self._newest.time_s:
                self._keyframes.clear()  # The clock was set back: their stamps mean nothing now.
            self._newest = frame
            pose = frame.camera.world_from_camera
            is_key = frame.fault is None and (
                not self._keyframes or has_moved(self._keyframes[-1].camera.world_from_camera, pose)
            )
            if is_key:
                self._keyframes.append(frame)
            self._new.notify_all()
            return is_key

    def wait_after(self, newest_s: Callable[[], float], timeout_s: float) -> RgbdFrame | None:
        """Wait for a frame that is taken from now on.

        Args:
            newest_s: Returns the stamp of the newest image so far, s.
            timeout_s: Maximum time to wait, s.

        Returns:
            The newest frame; None if none came.
        """
        self.wanted.set()
        try:
            time_s = newest_s()
            with self._new:
                before = self._newest  # Its stamp is a later one if the clock was set back.
                came = self._new.wait_for(
                    lambda: (
                        self._newest is not None
                        and self._newest is not before
                        and self._newest.time_s > time_s
                    ),
                    timeout_s,
                )
                return self._newest if came else None
        finally:
            self.wanted.clear()

    def since(self, time_s: float) -> list[RgbdFrame]:
        """Return the keyframes from a time on, and the newest frame if it has no fault.

        Args:
            time_s: Stamp, s.
        """
        with self._new:
            frames = [frame for frame in self._keyframes if frame.time_s >= time_s]
            newest = self._newest
        if newest is not None and newest.fault is None and newest.time_s >= time_s:
            frames += [] if frames and frames[-1] is newest else [newest]
        return frames


def has_moved(
    before: Floats, after: Floats, metres: float = KEYFRAME_M, radians: float = KEYFRAME_RAD
) -> bool:
    """Return whether a camera moved.

    Args:
        before: [4,4] world_from_camera, m.
        after: [4,4] world_from_camera, m.
        metres: Minimum motion, m.
        radians: Minimum turn, rad.
    """
    moved_m, turned_rad = pose_distance(before, after)
    return moved_m > metres or turned_rad > radians
