"""Moving and fixed frames of ROS (tf2): where one is in another at a time."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gslts.datasets.poses import between, inverse, pose_of
from gslts.types import Floats

MOST_APART_NS = 100_000_000
"""Poses that are farther apart in time say nothing about what is between them."""
MOST_LINKS = 100
"""Longer chains of frames are loops."""


@dataclass
class Track:
    """A pose at some times.

    Attributes:
        times_ns: Whole numbers, in any order.
        numbers: For each, x y z, m, and the quaternion x y z w.
    """

    times_ns: list[int] = field(default_factory=list)
    numbers: list[tuple[float, ...]] = field(default_factory=list)
    _sorted: tuple[NDArray[np.int64], Floats] | None = None

    def add(self, time_ns: int, translation: Any, rotation: Any) -> None:
        """Adds a pose of two ROS messages with x y z and x y z w."""
        self.times_ns.append(time_ns)
        numbers = [getattr(translation, name) for name in "xyz"]
        self.numbers.append((*numbers, *(getattr(rotation, name) for name in "xyzw")))
        self._sorted = None

    def at(self, time_ns: int) -> Floats:
        """[4,4] between the two neighbours in time.

        Raises:
            ValueError: They are too far apart, or there is none on one side, or one is no pose.
        """
        times, numbers = self._in_order()
        after = int(np.searchsorted(times, time_ns))
        if after < len(times) and times[after] == time_ns:
            return _pose(numbers[after])
        if after in (0, len(times)) or times[after] - times[after - 1] > MOST_APART_NS:
            raise ValueError(
                f"there are no two poses around it at most {MOST_APART_NS / 1e9:g} s apart"
            )
        share = (time_ns - times[after - 1]) / (times[after] - times[after - 1])
        return between(_pose(numbers[after - 1]), _pose(numbers[after]), float(share))

    def _in_order(self) -> tuple[NDArray[np.int64], Floats]:
        if self._sorted is None:
            times, first = np.unique(np.array(self.times_ns, np.int64), return_index=True)
            self._sorted = times, np.array(self.numbers, np.float64).reshape(-1, 7)[first]
        return self._sorted


def _pose(numbers: Floats) -> Floats:
    x, y, z, w = numbers[3:]
    return pose_of((w, x, y, z), numbers[:3])


class FrameTree:
    """Which frame hangs at which, and where.

    Names are taken without the slash that old bags have before them.
    """

    def __init__(self) -> None:
        self._parents: dict[str, tuple[str, Track, bool]] = {}
        self._doubtful: dict[str, str] = {}

    def add(self, transform: Any, fixed: bool) -> None:
        """Adds a TransformStamped.

        Args:
            transform: The message.
            fixed: Whether it holds for all times, as those of /tf_static.
        """
        header = transform.header
        child = plain(transform.child_frame_id)
        parent = plain(header.frame_id)
        at, track, was_fixed = self._parents.setdefault(child, (parent, Track(), fixed))
        if (at, was_fixed) != (parent, fixed):
            self._doubtful[child] = (
                f"the frame {child} hangs at {at} ({'fixed' if was_fixed else 'moving'}) and at "
                f"{parent} ({'fixed' if fixed else 'moving'})"
            )
            return
        moved = transform.transform
        if fixed and track.times_ns:  # The last one holds.
            track.times_ns.clear()
            track.numbers.clear()
        track.add(0 if fixed else time_of(header), moved.translation, moved.rotation)

    def ancestors(self, frame: str) -> list[str]:
        """The frame itself, the one at which it hangs, and so on.

        Raises:
            ValueError: They form a loop, or one hangs at several.
        """
        names = [plain(frame)]
        while names[-1] in self._parents:
            if names[-1] in self._doubtful:
                raise ValueError(self._doubtful[names[-1]])
            names.append(self._parents[names[-1]][0])
            if len(names) > MOST_LINKS:
                raise ValueError(f"the frames above {frame} form a loop")
        return names

    def moves(self, frame: str) -> bool:
        """Whether a frame moves in the topmost one above it."""
        return any(not self._parents[name][2] for name in self.ancestors(frame)[:-1])

    def find(self, target: str, source: str, time_ns: int) -> Floats:
        """[4,4] target_from_source at a time.

        Raises:
            ValueError: The frames are not connected, or their poses at that time are not known.
        """
        targets, sources = self.ancestors(target), self.ancestors(source)
        shared = next((name for name in sources if name in targets), None)
        if shared is None:
            raise ValueError(f"the frames {target} and {source} are not connected")
        return inverse(self._up(targets, shared, time_ns)) @ self._up(sources, shared, time_ns)

    def _up(self, names: list[str], top: str, time_ns: int) -> Floats:
        """[4,4] top_from_frame of the first of some ancestors."""
        pose = np.eye(4)
        for name in names[: names.index(top)]:
            parent, track, fixed = self._parents[name]
            try:
                pose = track.at(0 if fixed else time_ns) @ pose
            except ValueError as error:
                raise ValueError(f"{parent} to {name}: {error}") from None
        return pose


def plain(frame: str) -> str:
    """The name of a frame without a slash before it."""
    return str(frame).removeprefix("/")


def time_of(header: Any) -> int:
    """Time of a message's header, ns."""
    stamp = header.stamp
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)
