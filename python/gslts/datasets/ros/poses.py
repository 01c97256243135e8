"""Coordinate frames of ROS (tf2): the transform between two of them at a time."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from typing import Any

import numpy as np

from gslts.datasets.poses import interpolate_pose, inverse, pose_from_numbers
from gslts.types import Floats

MAX_GAP_NS = 100_000_000
"""Maximum time between two poses to interpolate; odometry comes at 20 Hz or more."""
MAX_LINKS = 100
"""Maximum depth of the tree of frames; longer chains are loops."""


class Track:
    """Poses of one frame in the order of their times; of several at one time, the first one."""

    def __init__(self) -> None:
        self._times_ns: list[int] = []
        self._numbers: list[tuple[float, ...]] = []

    def add(self, time_ns: int, translation: Any, rotation: Any) -> None:
        """Add a pose.

        Args:
            time_ns: Its time, ns.
            translation: ROS message with x y z, m.
            rotation: ROS message with x y z w.
        """
        row = bisect_left(self._times_ns, time_ns)
        if self._times_ns[row : row + 1] == [time_ns]:
            return
        position = (translation.x, translation.y, translation.z)
        quaternion = (rotation.x, rotation.y, rotation.z, rotation.w)
        self._times_ns.insert(row, time_ns)
        self._numbers.insert(row, position + quaternion)

    def keep(self, first_ns: int, last_ns: int) -> None:
        """Forget the poses outside a time, but for the newest one before it if none is in it.

        Args:
            first_ns: Start of the time, ns.
            last_ns: End of the time, ns.
        """
        end = bisect_right(self._times_ns, last_ns)
        start = min(bisect_left(self._times_ns, first_ns), max(end - 1, 0))
        for rows in (self._times_ns, self._numbers):
            del rows[end:], rows[:start]

    def newest_ns(self) -> int:
        """Return the time of the newest pose, ns.

        Raises:
            ValueError: There is no pose.
        """
        if not self._times_ns:
            raise ValueError("there is no pose yet")
        return self._times_ns[-1]

    def at(self, time_ns: int, max_gap_ns: int = MAX_GAP_NS) -> Floats:
        """Interpolate the pose between its two neighbours in time.

        Args:
            time_ns: Time, ns.
            max_gap_ns: Maximum time between the neighbours, ns.

        Returns:
            [4,4] rigid transform.

        Raises:
            ValueError: A neighbour is missing or damaged, or they are too far apart in time.
        """
        times = self._times_ns
        after = bisect_left(times, time_ns)
        if times[after : after + 1] == [time_ns]:
            return self._pose(after)
        if after in (0, len(times)) or times[after] - times[after - 1] > max_gap_ns:
            raise ValueError(
                f"there are no two poses around it at most {max_gap_ns / 1e9:g} s apart"
            )
        share = (time_ns - times[after - 1]) / (times[after] - times[after - 1])
        return interpolate_pose(self._pose(after - 1), self._pose(after), share)

    def _pose(self, row: int) -> Floats:
        return pose_from_numbers(np.array(self._numbers[row], np.float64))


class FrameTree:
    """Tree of coordinate frames, with the transform of each to its parent.

    Names are used without the leading slash that old bags have.

    Args:
        reparent: True moves a frame to the parent of its last transform, as tf2 does; False makes
            the use of a frame with two parents an error.
    """

    def __init__(self, *, reparent: bool = False) -> None:
        self._reparent = reparent
        self._parents: dict[str, tuple[str, Track, bool]] = {}
        self._conflicts: dict[str, str] = {}

    def add(self, transform: Any, fixed: bool) -> str | None:
        """Add a transform.

        Args:
            transform: A TransformStamped.
            fixed: True if it holds for all times, as those of /tf_static.

        Returns:
            Line that names the other parent of the frame before; None if it is the same.
        """
        child = frame_name(transform.child_frame_id)
        parent, conflict = frame_name(transform.header.frame_id), None
        known, track, was_fixed = self._parents.get(child, (parent, Track(), fixed))
        if (known, was_fixed) != (parent, fixed):
            conflict = (
                f"the frame {child} has two parents: {known} "
                f"({'fixed' if was_fixed else 'moving'}) and {parent} "
                f"({'fixed' if fixed else 'moving'})"
            )
            if not self._reparent:
                self._conflicts[child] = conflict
                return conflict
        if fixed or conflict:
            track = Track()
        pose = transform.transform
        track.add(0 if fixed else time_of(transform.header), pose.translation, pose.rotation)
        self._parents[child] = parent, track, fixed
        return conflict

    def keep(self, first_ns: int, last_ns: int) -> None:
        """Forget moving transforms outside a time; see `Track.keep`.

        Args:
            first_ns: Start of the time, ns.
            last_ns: End of the time, ns.
        """
        for _, track, fixed in self._parents.values():
            if not fixed:
                track.keep(first_ns, last_ns)

    def newest_ns(self, target: str, source: str) -> int:
        """Return the newest time at which the transform between two frames is known, ns.

        Args:
            target: Name of a frame.
            source: Name of a frame.

        Raises:
            ValueError: The frames are not connected, or one has no transform yet.
        """
        targets, sources, shared = self._common(target, source)
        names = [*targets[: targets.index(shared)], *sources[: sources.index(shared)]]
        moving = [self._parents[name][1] for name in names if not self._parents[name][2]]
        return min((track.newest_ns() for track in moving), default=0)

    def ancestors(self, frame: str) -> list[str]:
        """List a frame, its parent, and so on up to the root.

        Args:
            frame: Name of the frame.

        Raises:
            ValueError: The frames form a loop, or a frame has two parents.
        """
        names = [frame_name(frame)]
        while names[-1] in self._parents:
            if names[-1] in self._conflicts:
                raise ValueError(self._conflicts[names[-1]])
            names.append(self._parents[names[-1]][0])
            if len(names) > MAX_LINKS:
                raise ValueError(f"the frames above {frame} form a loop")
        return names

    def moves(self, frame: str) -> bool:
        """Return True if a frame moves relative to the root above it.

        Args:
            frame: Name of the frame.

        Raises:
            ValueError: See `ancestors`.
        """
        return any(not self._parents[name][2] for name in self.ancestors(frame)[:-1])

    def find(self, target: str, source: str, time_ns: int, max_gap_ns: int = MAX_GAP_NS) -> Floats:
        """Return the transform between two frames at a time.

        Args:
            target: Name of a frame.
            source: Name of a frame.
            time_ns: Time, ns.
            max_gap_ns: Maximum time between two transforms to interpolate, ns.

        Returns:
            [4,4] target_from_source, m.

        Raises:
            ValueError: The frames are not connected, or their poses at that time are not known.
        """
        targets, sources, shared = self._common(target, source)
        up = [self._up(names, shared, time_ns, max_gap_ns) for names in (targets, sources)]
        return inverse(up[0]) @ up[1]

    def _common(self, first: str, second: str) -> tuple[list[str], list[str], str]:
        """Return the ancestors of two frames, and the first one that they share."""
        firsts, seconds = self.ancestors(first), self.ancestors(second)
        shared = next((name for name in seconds if name in firsts), None)
        if shared is None:
            raise ValueError(f"the frames {first} and {second} are not connected")
        return firsts, seconds, shared

    def _up(self, names: list[str], top: str, time_ns: int, max_gap_ns: int) -> Floats:
        """Return top_from_frame [4,4] for the first of some ancestors."""
        pose = np.eye(4)
        for name in names[: names.index(top)]:
            parent, track, fixed = self._parents[name]
            try:
                pose = track.at(0 if fixed else time_ns, max_gap_ns) @ pose
            except ValueError as error:
                raise ValueError(f"{parent} to {name}: {error}") from None
        return pose


def frame_name(frame: str) -> str:
    """Return the name of a frame without a leading slash.

    Args:
        frame: Name as in a message.
    """
    return str(frame).removeprefix("/")


def time_of(header: Any) -> int:
    """Return the time stamp of a header, ns.

    Args:
        header: A std_msgs Header.
    """
    stamp = header.stamp
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)
