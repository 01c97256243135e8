"""Farthest point sampling."""

from __future__ import annotations

import numpy as np

from gslts.types import Floats, Floats32


def farthest_points(points: Floats | Floats32, count: int, apart: float = 0.0) -> list[int]:
    """Select points as different as possible, by farthest point sampling (Gonzalez 1985).

    Args:
        points: [P,D], such as positions, m.
        count: Maximum number of selected points.
        apart: Minimum distance between them, in the unit of the points.

    Returns:
        Their rows; the first one is 0.
    """
    squares = np.full(len(points), np.inf)  # Of the distance to the nearest chosen point.
    chosen: list[int] = []
    while len(chosen) < min(count, len(points)):
        best = int(np.argmax(squares))
        if squares[best] < apart**2:
            break
        chosen.append(best)
        steps = points - points[best]
        np.minimum(squares, np.einsum("pd,pd->p", steps, steps), out=squares)
        squares[best] = -1  # Below 0, that of others at the same position.
    return chosen
