"""Search for keyframes that show the same place."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gslts._core import reloc as _core
from gslts.core.in_threads import map_in_threads
from gslts.trajectory.constants import LOOP_CANDIDATES, MIN_VOTES, VOTE_NEIGHBOURS, VOTE_STEP
from gslts.trajectory.features import FrameFeatures


def find_loops(keyframes: Sequence[FrameFeatures], threads: int = 0) -> list[tuple[int, int]]:
    """Find pairs of keyframes that share many keypoints, beside those that follow each other.

    Args:
        keyframes: In the order of the recording.
        threads: Number of threads; 0 uses all hardware threads. The result is the same for any.

    Returns:
        Pairs of indices, the later one first, without repetition.
    """
    voters = [np.ascontiguousarray(frame.descriptors[::VOTE_STEP]) for frame in keyframes]
    owners = np.repeat(np.arange(len(voters), dtype=np.int32), [len(found) for found in voters])
    if len(owners) == 0:
        return []
    points = np.concatenate([frame.points[::VOTE_STEP] for frame in keyframes])
    index = _core.LandmarkIndex(points, np.concatenate(voters), owners)
    pairs: set[tuple[int, int]] = set()
    matches = map_in_threads(lambda found: index.match(found, VOTE_NEIGHBOURS + 1), voters, threads)
    for k, (rows, _) in enumerate(matches):
        votes = np.bincount(owners[rows[rows >= 0]], minlength=len(keyframes))
        votes[max(0, k - 1) : k + 2] = 0
        best = np.argsort(-votes, kind="stable")[:LOOP_CANDIDATES]
        pairs |= {(max(k, int(j)), min(k, int(j))) for j in best if votes[j] >= MIN_VOTES}
    return sorted(pairs)
