"""Comparison of frames with what a map knows: new, poorly known and changed places."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from gslts.change.visibility import Visibility, VisibilityCounts
from gslts.core.camera import unproject
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import FloatArray, GaussianMap
from gslts.core.surface_margin import surface_margin_m
from gslts.extension.constants import (
    GRID_COLUMNS,
    MAX_FARTHER,
    MIN_CELLS,
    MIN_COLOR_CHANGE,
    MIN_EXPOSURE_SHARE,
    MIN_KNOWN_ALPHA,
    MIN_NEAR,
    MIN_SEEN,
)
from gslts.rendering.losses import Exposure, apply_exposure, fit_exposure
from gslts.rendering.rasterizer import Images, Rasterizer, RenderOptions
from gslts.types import Bools, Floats32, Indices


@dataclass(frozen=True, eq=False)
class FrameSpace:
    """Pixels [H,W] of a frame by what the map knows there; all others agree with the map.

    Attributes:
        new: The map has no surface there, or one that too few of its training cameras saw.
        poor: What the map shows there is wrong, or its training cameras saw it from farther away.
        changed: Many saw the place from as near, and it looked different.
    """

    new: Bools
    poor: Bools
    changed: Bools

    @property
    def better(self) -> Bools:
        """Pixels [H,W] that tell the map something."""
        return self.new | self.poor


class KnownSpace:
    """The space that a map knows: what its training cameras saw.

    Args:
        gaussian_map: float32.
        visibility: Of the training cameras of the map.
        threads: Number of threads; 0 means all.
    """

    def __init__(self, gaussian_map: GaussianMap, visibility: Visibility, threads: int = 0) -> None:
        self._map, self._visibility, self._threads = gaussian_map, visibility, threads
        self._rasterizer, self._options = Rasterizer(np.float32), RenderOptions(threads=threads)

    def compare(self, frame: RgbdFrame) -> FrameSpace:
        """Compare a frame with the map, on a grid of `GRID_COLUMNS`.

        A surface that only one of them shows is a change if many training cameras saw its place,
        and new otherwise. Without measured depth, a pixel is new where the map shows nothing.
        Pixels outside the mask of the frame are nothing of these.

        Args:
            frame: At its pose in the map; registered depth.
        """
        images = self._rasterizer.forward(self._map, frame.camera, self._options)
        height, width = frame.depth.shape
        cell_px = max(1, width // GRID_COLUMNS)
        grid = np.ix_(_grid_lines(height, cell_px), _grid_lines(width, cell_px))
        seen = np.True_ if frame.mask is None else frame.mask[grid]
        measured = np.where(seen, frame.depth[grid], np.float32(0))
        depth = images.depth[grid].astype(np.float32)
        known = images.alpha[grid] >= MIN_KNOWN_ALPHA
        margin_m = surface_margin_m(measured.astype(np.float64))
        differs = (measured > 0) & (~known | (np.abs(depth - measured) > margin_m))
        recolored = self._color_changes(frame, images, (measured > 0) & ~differs, cell_px)[grid]
        nearer = np.where(known, np.minimum(depth, measured), measured)
        doubtful = differs & (recolored > MIN_COLOR_CHANGE)
        changed = doubtful.copy()
        changed[doubtful] = self._is_well_seen(frame, grid, doubtful, nearer[doubtful])
        changed = _without_edges(changed)
        new = _without_edges((differs & ~changed) | ((measured == 0) & ~known & seen))
        poor = known & ~differs & ~changed & seen
        poor[poor] = self._is_coarse(frame, grid, poor, depth[poor])
        # What lies behind a new surface is hidden by it: a wall may be seen from its back.
        poor |= new & (depth > 0) & (depth < measured)
        return FrameSpace(
            *(_enlarge(cells, frame.depth.shape, cell_px) for cells in (new, poor, changed))
        )

    def _color_changes(
        self, frame: RgbdFrame, images: Images, agrees: Bools, cell_px: int
    ) -> FloatArray:
        """Return the colour change [H,W], summed over the channels, from 0 to 3.

        Args:
            frame: At its pose in the map.
            images: Rendering of the map there.
            agrees: Cells of the grid whose depths agree: the exposure is fitted to them.
            cell_px: Edge of a cell, px.
        """
        observed: Floats32 = frame.rgb.astype(np.float32) / np.float32(255)
        exposure = Exposure()
        if agrees.mean() > MIN_EXPOSURE_SHARE:
            mask = _enlarge(agrees, frame.depth.shape, cell_px)
            exposure = fit_exposure(images.rgb, observed, mask=mask, threads=self._threads)
        difference = np.abs(apply_exposure(images.rgb, exposure) - observed).sum(axis=2)
        return np.asarray(cv2.blur(difference.astype(np.float32), (cell_px, cell_px)))

    def _is_well_seen(
        self, frame: RgbdFrame, grid: tuple[Indices, ...], where: Bools, depths_m: Floats32
    ) -> Bools:
        """Return [P] whether enough training cameras saw points, or through them, from as near."""
        counts = self._counts(frame, grid, where, depths_m, 1.0)
        return np.asarray(counts.through + counts.on >= MIN_SEEN)

    def _is_coarse(
        self, frame: RgbdFrame, grid: tuple[Indices, ...], where: Bools, depths_m: Floats32
    ) -> Bools:
        """Return [P] whether too few training cameras saw a surface at points from as near."""
        counts = self._counts(frame, grid, where, depths_m, MAX_FARTHER)
        return np.asarray(counts.on < MIN_NEAR)

    def _counts(
        self,
        frame: RgbdFrame,
        grid: tuple[Indices, ...],
        where: Bools,
        depths_m: Floats32,
        farther: float,
    ) -> VisibilityCounts:
        """Count the training cameras that saw points from at most so many times as far."""
        if not self._visibility.has_cameras or len(depths_m) == 0:
            none = np.zeros(len(depths_m), np.int64)
            return VisibilityCounts(none, none)
        rows, columns = np.broadcast_arrays(*grid)
        pixels = np.stack([columns[where] + 0.5, rows[where] + 0.5], axis=1)
        depths = depths_m.astype(np.float64)
        points = unproject(frame.camera, pixels, depths)
        return self._visibility.counts(points, farther * depths)


def _grid_lines(length: int, cell_px: int) -> Indices:
    """Return the middle pixels of cells; the last cell may be cut off."""
    starts = np.arange(0, length, cell_px)
    return (starts + np.minimum(starts + cell_px, length)) // 2


def _enlarge(cells: Bools, shape: tuple[int, ...], cell_px: int) -> Bools:
    """Return the cell of each pixel."""
    whole = cells.repeat(cell_px, axis=0).repeat(cell_px, axis=1)
    return np.ascontiguousarray(whole[: shape[0], : shape[1]])


def _without_edges(cells: Bools) -> Bools:
    """Return the cells that are part of a square of `MIN_CELLS`."""
    square = np.ones((MIN_CELLS, MIN_CELLS), np.uint8)
    opened = cv2.morphologyEx(cells.astype(np.uint8), cv2.MORPH_OPEN, square)
    return np.asarray(opened, np.bool_)
