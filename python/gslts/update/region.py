"""Where in the world a change is."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from gslts._core import detect as _core
from gslts.change.changes import Change
from gslts.core.camera import Camera
from gslts.core.se3 import inverse_transform
from gslts.types import Bools, Floats

Side = Literal["before", "after"]

NEAR_M = 0.15
"""A surface so near to a region may be a part of it."""
CORNERS = np.array([[i >> 2 & 1, i >> 1 & 1, i & 1] for i in range(8)])


@dataclass(frozen=True, eq=False)
class Region:
    """A place where something is gone, or is new.

    Attributes:
        side: "before" where the map shows what is gone, "after" where frames show what is new.
        low, high: (3,) corners of the box around it, in the world, m.
    """

    side: Side
    low: Floats
    high: Floats

    @property
    def middle(self) -> Floats:
        """(3,) m."""
        middle: Floats = (self.low + self.high) / 2
        return middle

    def is_of(self, surface: _core.Surface) -> bool:
        """Whether a surface may be a part of what is seen here."""
        side = "before" if surface.side == _core.Side.BEFORE else "after"
        return side == self.side and bool(self.contains(surface.point, NEAR_M))

    def contains(self, points: Floats, margin_m: float | Floats) -> Bools:
        """[...] whether points [...,3] are in the box, or that near to it, each by its margin."""
        above, below = points >= self.low - margin_m, points <= self.high + margin_m
        return np.asarray(np.all(above & below, axis=-1), np.bool_)

    def middle_in(self, camera: Camera) -> tuple[float, float, float] | None:
        """Column and row, px, and depth, m, of the middle in an image; None where it is not."""
        x, y, z = inverse_transform(camera.world_from_camera, self.middle)
        if z <= 0:
            return None
        u, v = camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy
        inside = 0 <= u < camera.width and 0 <= v < camera.height
        return (float(u), float(v), float(z)) if inside else None

    def grown(self, margin_m: float) -> Region:
        """The region with a larger box."""
        return Region(self.side, self.low - margin_m, self.high + margin_m)

    def with_surfaces(self, surfaces: Iterable[_core.Surface]) -> Region:
        """The region with the boxes of surfaces that are parts of it."""
        boxes = [(one.low, one.high) for one in surfaces]
        low = np.min([self.low, *(low for low, _ in boxes)], axis=0)
        high = np.max([self.high, *(high for _, high in boxes)], axis=0)
        return Region(self.side, low, high)

    def rectangle(self, camera: Camera, margin_px: int) -> tuple[int, int, int, int] | None:
        """Columns [x0, x1) and rows [y0, y1) around the box in an image; None beside it."""
        corners = self.low + CORNERS * (self.high - self.low)
        x, y, z = inverse_transform(camera.world_from_camera, corners).T
        if np.any(z < 0.05):
            return None
        u, v = camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy
        x0, y0 = int(np.floor(u.min())) - margin_px, int(np.floor(v.min())) - margin_px
        x1, y1 = int(np.ceil(u.max())) + margin_px, int(np.ceil(v.max())) + margin_px
        x0, y0, x1, y1 = max(x0, 0), max(y0, 0), min(x1, camera.width), min(y1, camera.height)
        return (x0, y0, x1, y1) if x0 < x1 and y0 < y1 else None


def regions_of(change: Change) -> tuple[Region, ...]:
    """Where a change is to be looked at; none if only its pixels are known."""
    before, after = change.boxes
    regions = []
    if before is not None:
        regions.append(Region("before", *before))
    if after is not None:
        regions.append(Region("after", *after))
    return tuple(regions)
