"""Regions of the world in which an object was removed or added."""

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

MAX_REGION_DISTANCE_M = 0.15
"""Maximum distance from a region to a surface that belongs to it, m. Covers the error of one frame
in depth and pose."""
MIN_DEPTH_M = 0.05
"""A box with a corner nearer to the camera plane than this is not projected, m."""
CORNERS = np.array([[i >> 2 & 1, i >> 1 & 1, i & 1] for i in range(8)])
"""[8,3] corners of the unit cube."""


@dataclass(frozen=True, eq=False)
class Region:
    """Axis-aligned box around an object that was removed or added.

    Attributes:
        side: "before" where the map shows an object that was removed, "after" where frames show one
            that was added.
        low, high: (3,) corners in the world frame, m.
    """

    side: Side
    low: Floats
    high: Floats

    @property
    def center(self) -> Floats:
        """(3,) in the world frame, m."""
        center: Floats = (self.low + self.high) / 2
        return center

    def matches(self, surface: _core.Surface) -> bool:
        """Return whether a detected surface may belong to the region.

        Args:
            surface: From `Detection.surfaces`.

        Returns:
            True if it has the side of the region and is near to it.
        """
        near = self.contains(surface.point, MAX_REGION_DISTANCE_M)
        return self.has_side_of(surface) and bool(near)

    def has_side_of(self, surface: _core.Surface) -> bool:
        """Return whether a detected surface has the side of the region.

        Args:
            surface: From `Detection.surfaces`.
        """
        return self.side == ("before" if surface.side == _core.Side.BEFORE else "after")

    def contains(self, points: Floats, margin_m: float | Floats) -> Bools:
        """Return which points lie in the box.

        Args:
            points: [...,3] in the world frame, m.
            margin_m: Enlarges the box on all sides, m; a number, or one per point.

        Returns:
            [...] bool.
        """
        above, below = points >= self.low - margin_m, points <= self.high + margin_m
        return np.asarray(np.all(above & below, axis=-1), np.bool_)

    def project_center(self, camera: Camera) -> tuple[float, float, float] | None:
        """Project the centre of the box into an image.

        Args:
            camera: Of the image.

        Returns:
            Column and row, px, and depth, m; None if the centre is outside of the image.
        """
        x, y, z = inverse_transform(camera.world_from_camera, self.center)
        if z <= 0:
            return None
        u, v = camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy
        inside = 0 <= u < camera.width and 0 <= v < camera.height
        return (float(u), float(v), float(z)) if inside else None

    def project_box(self, camera: Camera, margin_px: int) -> tuple[int, int, int, int] | None:
        """Return the bounding rectangle of the box in an image.

        Args:
            camera: Of the image.
            margin_px: Enlarges the rectangle on all sides.

        Returns:
            Columns [x0, x1) and rows [y0, y1); None if the box is outside of the image.
        """
        corners = self.low + CORNERS * (self.high - self.low)
        x, y, z = inverse_transform(camera.world_from_camera, corners).T
        if np.any(z < MIN_DEPTH_M):
            return None
        u, v = camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy
        x0, y0 = int(np.floor(u.min())) - margin_px, int(np.floor(v.min())) - margin_px
        x1, y1 = int(np.ceil(u.max())) + margin_px, int(np.ceil(v.max())) + margin_px
        x0, y0, x1, y1 = max(x0, 0), max(y0, 0), min(x1, camera.width), min(y1, camera.height)
        return (x0, y0, x1, y1) if x0 < x1 and y0 < y1 else None

    def expand(self, margin_m: float) -> Region:
        """Return the region with a larger box.

        Args:
            margin_m: Enlarges the box on all sides, m.
        """
        return Region(self.side, self.low - margin_m, self.high + margin_m)

    def include(self, lows: Iterable[Floats], highs: Iterable[Floats]) -> Region:
        """Return the region with a box that contains other boxes as well.

        Args:
            lows: (3,) lower corners, m.
            highs: (3,) upper corners, m.
        """
        return Region(
            self.side, np.min([self.low, *lows], axis=0), np.max([self.high, *highs], axis=0)
        )


def regions_of(change: Change) -> tuple[Region, ...]:
    """Return the regions of a change.

    Args:
        change: As detected.

    Returns:
        "before" and "after" of a relocation, one of them for other changes; none if the detector
        gave no boxes.
    """
    before, after = change.boxes
    regions = []
    if before is not None:
        regions.append(Region("before", *before))
    if after is not None:
        regions.append(Region("after", *after))
    return tuple(regions)
