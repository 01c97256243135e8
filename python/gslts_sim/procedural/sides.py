"""Walls of a rectangular room, as furniture sees them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gslts.types import Floats


@dataclass(frozen=True, eq=False)
class Side:
    """The inner side of a wall.

    Args:
        start: (2,) its left corner, seen from inside, m.
        along: (2,) unit vector to the right.
        inward: (2,) unit vector into the room.
        length: m.
        yaw_rad: Yaw of an object with its back to the wall, rad.
    """

    start: Floats
    along: Floats
    inward: Floats
    length: float
    yaw_rad: float

    def point(self, along_m: float, out_m: float) -> Floats:
        """Return a point (2,) on the floor, m.

        Args:
            along_m: From the left corner, m.
            out_m: Off the wall, m.
        """
        at: Floats = self.start + self.along * along_m + self.inward * out_m
        return at


def sides(width: float, depth: float) -> tuple[Side, ...]:
    """Return the walls of a room: north (y = depth), east, south and west.

    Args:
        width: Along x, m.
        depth: Along y, m.
    """
    quarter = np.pi / 2
    return (
        Side(np.array([0, depth]), np.array([1.0, 0]), np.array([0, -1.0]), width, 0.0),
        Side(np.array([width, depth]), np.array([0, -1.0]), np.array([-1.0, 0]), depth, -quarter),
        Side(np.array([width, 0.0]), np.array([-1.0, 0]), np.array([0, 1.0]), width, 2 * quarter),
        Side(np.array([0.0, 0.0]), np.array([0, 1.0]), np.array([1.0, 0]), depth, quarter),
    )
