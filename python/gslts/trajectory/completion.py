"""Placement of keyframes that a single motion connects with the others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import islice

from gslts.core.se3 import product, relative
from gslts.datasets.poses import inverse
from gslts.trajectory.constants import MAX_SEEN_THROUGH, MIN_SHARED_POINTS, MIN_WITNESSES
from gslts.trajectory.features import FrameFeatures
from gslts.trajectory.pose_graph import Edge
from gslts.trajectory.registration import count_seen
from gslts.types import Floats


def place_rest(
    poses: Mapping[int, Floats], edges: Sequence[Edge], keyframes: Sequence[FrameFeatures]
) -> dict[int, Floats]:
    """Place further keyframes where the frames placed before do not contradict.

    A motion that no third frame supports may be wrong. At a wrong place, a keyframe shows surfaces
    where others saw through, or the other way round.

    Args:
        poses: World_from_camera [4,4] of placed keyframes, m, by index.
        edges: Motions between all keyframes.
        keyframes: All keyframes.

    Returns:
        Poses of these and of further keyframes.
    """
    placed, before = dict(poses), 0
    trials: dict[Edge, _Trial] = {}
    left = list(edges)
    while len(placed) > before:
        before = len(placed)
        for edge in left:
            trial = trials.get(edge) or _put(edge, placed)
            if trial is None or trial.node in placed:
                continue
            trials[edge] = trial
            trial.compare(placed, keyframes)
            if trial.fits():
                placed[trial.node] = trial.pose
        left = [edge for edge in left if edge.source not in placed or edge.target not in placed]
    return placed


@dataclass(eq=False)
class _Trial:
    """A keyframe beside a placed one, and the points that it and placed ones see of each other.

    Attributes:
        node: Its index.
        pose: World_from_camera [4,4], m.
        compared: Number of placed ones that it was compared with.
        through: Number of points through which the other one saw.
        seen: Number of points that the other one could see.
        witnesses: Number of placed ones that share enough points with it.
    """

    node: int
    pose: Floats
    compared: int = 0
    through: int = 0
    seen: int = 0
    witnesses: int = 0

    def compare(self, placed: Mapping[int, Floats], keyframes: Sequence[FrameFeatures]) -> None:
        """Compare it with those that were placed since the last time."""
        for node, at in islice(placed.items(), self.compared, None):
            motion = relative(at, self.pose)
            through, seen = count_seen(keyframes[self.node], keyframes[node], motion)
            self.through += through
            self.seen += seen
            self.witnesses += seen > MIN_SHARED_POINTS
        self.compared = len(placed)

    def fits(self) -> bool:
        """Return True if enough placed ones see it, and they do not contradict."""
        is_free = self.through <= MAX_SEEN_THROUGH * self.seen
        return is_free and self.witnesses >= MIN_WITNESSES


def _put(edge: Edge, placed: Mapping[int, Floats]) -> _Trial | None:
    """Put the node beside a placed one to which a motion connects it; None if there is none."""
    motion = edge.motion.target_from_source
    if edge.target in placed and edge.source not in placed:
        return _Trial(edge.source, product(placed[edge.target], motion))
    if edge.source in placed and edge.target not in placed:
        return _Trial(edge.target, product(placed[edge.source], inverse(motion)))
    return None
