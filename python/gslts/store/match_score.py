"""Scores of two reports of objects, from what a history keeps; does not import NumPy."""

from __future__ import annotations

import math
from functools import lru_cache

from gslts.store.causes import Appearance, Box

MAX_DISTANCE_M = 0.15
"""Maximum distance of the centre of one box from another box around the same object, m. Detections
of one object from several sides differ by about that much; 0.3 joins neighbours on a table."""
MIN_LENGTH_RATIO = 0.2
"""Minimum ratio of the lengths of one object at two positions: `kMinLengthRatio` of
`cpp/detect/constants.hpp`."""
OFFSET, COLORS_WEIGHT = 3.923, -8.102
"""`kMatchOffset` and `kMatchWeights` of `cpp/detect/constants.hpp`, of objects of one height."""
MIN_SCORE, MIN_SCORE_SAME_TYPE = 0.3, 0.1
"""Minimum score of two reports of one object, and if both have the same type, which alone makes it
likely that they are."""
UNKNOWN_SCORE = 0.5
"""Score of reports without appearance."""


def is_at(a: Box | None, b: Box | None, *, parts: bool = False) -> bool:
    """Return whether two boxes may be around one object that did not move.

    Args:
        a: Box, world, m; None is at no position.
        b: The other one.
        parts: They may be around the shade and the foot of a lamp, whose pole was not detected.
    """
    if a is None or b is None:
        return False
    if parts and _gap_m(a, b) <= MAX_DISTANCE_M:
        return True
    return _contains(a, b) or _contains(b, a)


def report_score(
    boxes: tuple[Box | None, Box | None],
    appearances: tuple[Appearance | None, Appearance | None],
    *,
    same_type: bool,
) -> float:
    """Score how alike two reports of objects at two positions are.

    Args:
        boxes: Of both, world, m; None if unknown.
        appearances: Of both; None if unknown.
        same_type: Both have the same known type.

    Returns:
        As `gslts.change` scores surfaces, 0 to 1; 0 if they are too different for one object.
    """
    if boxes[0] is not None and boxes[1] is not None:
        shorter, longer = sorted(math.dist(*box) for box in boxes if box is not None)
        if shorter < MIN_LENGTH_RATIO * longer:
            return 0.0
    a, b = appearances
    score = UNKNOWN_SCORE if a is None or b is None else match_score(a, b)
    return score if score >= (MIN_SCORE_SAME_TYPE if same_type else MIN_SCORE) else 0.0


def match_score(a: Appearance, b: Appearance) -> float:
    """Score how likely two surfaces are one object, as `match_score` of the detector.

    Args:
        a: One appearance.
        b: The other one.

    Returns:
        0 to 1.
    """
    roots_a, roots_b = _roots(a.colors), _roots(b.colors)
    norm = math.hypot(*roots_a.values()) * math.hypot(*roots_b.values())
    overlap = sum(root * roots_b.get(bin_, 0) for bin_, root in roots_a.items())
    colors = math.sqrt(max(0.0, 1 - overlap / norm)) if norm else 1.0
    return 1 / (1 + math.exp(-(OFFSET + COLORS_WEIGHT * colors)))


@lru_cache(maxsize=4096)
def _roots(text: str) -> dict[int, int]:
    """Return the square roots of the shares of colours, by the number of the bin."""
    return {int(text[k : k + 3], 16): int(text[k + 3 : k + 5], 16) for k in range(0, len(text), 5)}


def _contains(box: Box, other: Box) -> bool:
    """Return whether a box has the centre of another one in it, or within `MAX_DISTANCE_M`."""
    centre = [(low + high) / 2 for low, high in zip(*other, strict=True)]
    outside = [max(low - x, x - high, 0.0) for x, low, high in zip(centre, *box, strict=True)]
    return math.hypot(*outside) <= MAX_DISTANCE_M


def _gap_m(a: Box, b: Box) -> float:
    """Return the horizontal distance between two boxes, m."""
    gaps = (max(a[0][axis] - b[1][axis], b[0][axis] - a[1][axis], 0.0) for axis in (0, 1))
    return math.hypot(*gaps)
