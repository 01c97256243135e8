"""What a frame shows of space that a map does not know."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gslts.change.visibility import Visibility
from gslts.core.camera import unproject
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.extension.constants import GRID_PX, MIN_KNOWN_ALPHA, MIN_SEEN
from gslts.rendering.rasterizer import Rasterizer, RenderOptions
from gslts.store.unmeasured import surface_margin_m
from gslts.types import Bools


@dataclass(frozen=True, eq=False)
class FrameSpace:
    """Pixels [H,W] of a frame by what the map knows there; all others agree with the map.

    Attributes:
        new: The surface is where too few training cameras of the map saw anything.
        changed: The map knows the place and shows something else.
    """

    new: Bools
    changed: Bools

    @property
    def new_share(self) -> float:
        """Share of the pixels that show new space."""
        return float(self.new.mean())


class KnownSpace:
    """The space that a map knows: what its training cameras saw.

    Args:
        gaussian_map: float32.
        visibility: Of the training cameras of the map.
        threads: Number of threads; 0 means all.
    """

    def __init__(self, gaussian_map: GaussianMap, visibility: Visibility, threads: int = 0) -> None:
        self._map, self._visibility = gaussian_map, visibility
        self._rasterizer, self._options = Rasterizer(np.float32), RenderOptions(threads=threads)

    def compare(self, frame: RgbdFrame) -> FrameSpace:
        """Compare a frame with the map.

        Pixels are compared on a grid of `GRID_PX`. Without measured depth, a pixel is new where the
        map shows nothing.

        Args:
            frame: At its pose in the map; registered depth.
        """
        images = self._rasterizer.forward(self._map, frame.camera, self._options)
        height, width = frame.depth.shape
        grid = np.ix_(_grid_lines(height), _grid_lines(width))
        measured, alpha, depth = frame.depth[grid], images.alpha[grid], images.depth[grid]
        margin_m = surface_margin_m(measured)
        known = alpha >= MIN_KNOWN_ALPHA
        differs = (measured > 0) & (~known | (np.abs(depth - measured) > margin_m))
        new = (measured == 0) & ~known
        new[differs] = self._is_unseen(frame, grid, differs)
        return FrameSpace(*(_enlarge(part, (height, width)) for part in (new, differs & ~new)))

    def _is_unseen(self, frame: RgbdFrame, grid: tuple[np.ndarray, ...], where: Bools) -> Bools:
        """Return for each chosen point of the grid if too few training cameras saw it."""
        rows, columns = np.broadcast_arrays(*grid)
        pixels = np.stack([columns[where] + 0.5, rows[where] + 0.5], axis=1)
        depths_m = frame.depth[grid][where].astype(np.float64)
        if not self._visibility.has_cameras or len(depths_m) == 0:
            return np.ones(len(depths_m), np.bool_)
        counts = self._visibility.counts(unproject(frame.camera, pixels, depths_m))
        return counts.through + counts.on < MIN_SEEN


def _grid_lines(length: int) -> np.ndarray:
    """Return the middle pixels of cells of `GRID_PX`; the last cell may be cut off."""
    starts = np.arange(0, length, GRID_PX)
    return (starts + np.minimum(starts + GRID_PX, length)) // 2


def _enlarge(cells: Bools, shape: tuple[int, int]) -> Bools:
    """Return the cell of each pixel."""
    whole = cells.repeat(GRID_PX, axis=0).repeat(GRID_PX, axis=1)
    return np.ascontiguousarray(whole[: shape[0], : shape[1]])
