"""Odometry by keyframes: the motion of each frame since the last keyframe."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from gslts.core.se3 import pose_distance, product, relative
from gslts.trajectory.constants import GIVEN_POINTS, KEYFRAME_M, KEYFRAME_RAD, STEP_M, STEP_RAD
from gslts.trajectory.drift import may_drift
from gslts.trajectory.features import FrameFeatures
from gslts.trajectory.pose_graph import Edge
from gslts.trajectory.registration import Motion, register_frames, register_points
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
    _given: _GivenPath | None = None

    def add(self, name: str, frame: FrameFeatures, given: Floats | None = None) -> None:
        """Register a frame with the last keyframe; if it is far from it, it becomes the next one.

        Args:
            name: Unique name.
            frame: The frame after those that were added before.
            given: [4,4] world_from_camera by another odometry, m; None if unknown.
        """
        guess = None
        if given is not None and self._given is not None:
            guess = self._given.move_to(given)
        motion, is_certain = self._motion(frame, guess)
        if motion is not None and not _is_far(motion, KEYFRAME_M, KEYFRAME_RAD):
            self.anchors[name] = len(self.keyframes) - 1, motion.target_from_source
            self._last = _Tracked(frame, motion.target_from_source)
            return
        if motion is not None:
            count = len(self.keyframes)
            self.edges.append(Edge(count, count - 1, motion, is_certain))
        for keyframe in self.keyframes[-1:]:
            keyframe.drop_index()
        self.keyframes.append(frame)
        self.names.append(name)
        self.anchors[name] = len(self.keyframes) - 1, np.eye(4)
        self._last = _Tracked(frame, np.eye(4))
        self._given = None if given is None else _GivenPath(given, given)

    def _motion(self, frame: FrameFeatures, guess: Floats | None) -> tuple[Motion | None, bool]:
        """Return the motion to the last keyframe, by images or as given, and if it is certain.

        Images of tiles or shelves fit at several positions: that at the guess is used. If they do
        not fit there, the other odometry jumped, or the images match something else.
        """
        motion = self._motion_of_images(frame, guess)
        if guess is None or self._given is None:
            return motion, motion is not None and not _is_far(motion, STEP_M, STEP_RAD)
        if motion is None:
            return Motion(guess, GIVEN_POINTS * np.eye(6), 0.0), True
        if not self._given.allows(motion):
            at_guess = register_points(frame, self.keyframes[-1], guess)
            if at_guess is None or not self._given.allows(at_guess):
                return motion, False
            motion = at_guess
        return motion, not _is_far(motion, STEP_M, STEP_RAD)

    def _motion_of_images(self, frame: FrameFeatures, guess: Floats | None) -> Motion | None:
        """Return the motion to the last keyframe: directly, or over the frame before."""
        if self._last is None:
            return None
        motion = register_frames(frame, self.keyframes[-1], guess)
        if motion is not None:
            return motion
        step = register_frames(frame, self._last.frame)
        if step is None:
            return None
        chained = product(self._last.keyframe_from_camera, step.target_from_source)
        return Motion(chained, step.information, step.overlap)


@dataclass(eq=False)
class _GivenPath:
    """Path of another odometry since the last keyframe.

    Attributes:
        first: World_from_camera [4,4] of the keyframe, m.
        last: That of the last frame.
        path_m: Length of the path, m.
        turned_rad: Sum of all turns, rad.
    """

    first: Floats
    last: Floats
    path_m: float = 0.0
    turned_rad: float = 0.0

    def move_to(self, pose: Floats) -> Floats:
        """Add a pose [4,4], and return the motion [4,4] since the keyframe."""
        metres, turn_rad = pose_distance(self.last, pose)
        self.last = pose
        self.path_m += metres
        self.turned_rad += turn_rad
        return relative(self.first, pose)

    def allows(self, motion: Motion) -> bool:
        """Test if a motion since the keyframe is that of the path, up to drift."""
        given = relative(self.first, self.last)
        return may_drift(given, motion.target_from_source, self.path_m, self.turned_rad)


@dataclass(frozen=True, eq=False)
class _Tracked:
    """The last frame, and its pose relative to its keyframe."""

    frame: FrameFeatures
    keyframe_from_camera: Floats


def _is_far(motion: Motion, far_m: float, far_rad: float) -> bool:
    metres, turn_rad = pose_distance(np.eye(4), motion.target_from_source)
    return metres > far_m or turn_rad > far_rad
