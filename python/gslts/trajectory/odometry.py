"""Odometry by keyframes: the motion of each frame since the last keyframe."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from gslts.core.se3 import pose_distance, product, relative
from gslts.trajectory.constants import GIVEN_POINTS, KEYFRAME_M, KEYFRAME_RAD, STEP_M, STEP_RAD
from gslts.trajectory.features import FrameFeatures
from gslts.trajectory.pose_graph import Edge
from gslts.trajectory.registration import Motion, register_frames
from gslts.types import Floats


@dataclass(eq=False)
class KeyframeOdometry:
    """Keyframes of a recording, and its frames relative to them.

    Attributes:
        keyframes: In the order of the recording.
        names: Names of the keyframes.
        edges: Motions between keyframes that follow each other; missing where they could not be
            found.
        anchors: By name of each frame, its keyframe, and keyframe_from_camera [4,4].
    """

    keyframes: list[FrameFeatures] = field(default_factory=list)
    names: list[str] = field(default_factory=list)
    edges: list[Edge] = field(default_factory=list)
    anchors: dict[str, tuple[int, Floats]] = field(default_factory=dict)
    _last: _Tracked | None = None
    _given_keyframe: Floats | None = None

    def add(self, name: str, frame: FrameFeatures, given: Floats | None = None) -> None:
        """Register a frame with the last keyframe; if it is far from it, it becomes the next one.

        Args:
            name: Unique name.
            frame: The frame after those that were added before.
            given: [4,4] world_from_camera by another odometry, m; None if unknown.
        """
        motion = self._motion(frame, given)
        if motion is not None and not _is_far(motion, KEYFRAME_M, KEYFRAME_RAD):
            self.anchors[name] = len(self.keyframes) - 1, motion.target_from_source
            self._last = _Tracked(frame, motion.target_from_source)
            return
        if motion is not None:
            count = len(self.keyframes)
            is_certain = motion.overlap == 0 or not _is_far(motion, STEP_M, STEP_RAD)
            self.edges.append(Edge(count, count - 1, motion, is_certain))
        self.keyframes.append(frame)
        self.names.append(name)
        self.anchors[name] = len(self.keyframes) - 1, np.eye(4)
        self._last, self._given_keyframe = _Tracked(frame, np.eye(4)), given

    def _motion(self, frame: FrameFeatures, given: Floats | None) -> Motion | None:
        """Return the motion to the last keyframe: directly, over the frame before, or as given."""
        if self._last is None:
            return None
        guess = None
        if given is not None and self._given_keyframe is not None:
            guess = relative(self._given_keyframe, given)
        motion = register_frames(frame, self.keyframes[-1], guess)
        if motion is not None:
            return motion
        step = register_frames(frame, self._last.frame)
        if step is not None:
            chained = product(self._last.keyframe_from_camera, step.target_from_source)
            return Motion(chained, step.information, step.overlap)
        return None if guess is None else Motion(guess, GIVEN_POINTS * np.eye(6), 0.0)


@dataclass(frozen=True, eq=False)
class _Tracked:
    """The last frame, and its pose relative to its keyframe."""

    frame: FrameFeatures
    keyframe_from_camera: Floats


def _is_far(motion: Motion, far_m: float, far_rad: float) -> bool:
    metres, turn_rad = pose_distance(np.eye(4), motion.target_from_source)
    return metres > far_m or turn_rad > far_rad
