"""Placement of keyframes that a single motion connects with the others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

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
    while len(placed) > before:
        before = len(placed)
        for edge in edges:
            found = _put(edge, placed)
            if found is not None and _fits(keyframes[found[0]], found[1], placed, keyframes):
                placed[found[0]] = found[1]
    return placed


def _put(edge: Edge, placed: Mapping[int, Floats]) -> tuple[int, Floats] | None:
    """Return the node that a motion puts beside a placed one, and its pose; None otherwise."""
    motion = edge.motion.target_from_source
    if edge.target in placed and edge.source not in placed:
        return edge.source, product(placed[edge.target], motion)
    if edge.source in placed and edge.target not in placed:
        return edge.target, product(placed[edge.source], inverse(motion))
    return None


def _fits(
    frame: FrameFeatures,
    pose: Floats,
    placed: Mapping[int, Floats],
    keyframes: Sequence[FrameFeatures],
) -> bool:
    """Test a pose [4,4] by the points that the frame and the placed ones see of each other."""
    counts = np.array(
        [count_seen(frame, keyframes[node], relative(at, pose)) for node, at in placed.items()]
    )
    through, seen = counts.sum(axis=0)
    witnesses = int((counts[:, 1] > MIN_SHARED_POINTS).sum())
    return bool(through <= MAX_SEEN_THROUGH * seen and witnesses >= MIN_WITNESSES)
