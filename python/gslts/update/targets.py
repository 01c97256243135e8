"""Images that the refined map should show: new views, and renderings of the map before the edit."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from gslts.core.camera import Camera
from gslts.core.farthest_points import farthest_points
from gslts.core.gaussian_map import GaussianMap
from gslts.rendering.losses import Exposure
from gslts.rendering.rasterizer import Rasterizer, RenderOptions
from gslts.rendering.view_range import view_range_m
from gslts.types import Bools, Floats32
from gslts.update.config import RefineConfig
from gslts.update.region import Region
from gslts.update.views import View

MAX_EDIT_DIFFERENCE = 0.02
"""Colour difference, 0 to 1, above which a pixel counts as edited and is not replayed."""
EDIT_WINDOW_PX = 5
"""Window around an edited pixel that is not replayed either, px."""
MIN_DEPTH_ALPHA = 0.5
"""Minimum opacity of a rendered pixel whose depth is replayed."""


@dataclass(frozen=True, eq=False)
class Target:
    """An image that the map should show.

    Attributes:
        camera: Of the image.
        colors: [H,W,3] float32 sRGB, 0 to 1.
        exposure: Maps rendered colours to these.
        depth: [H,W] float32, m; 0 where it is unknown.
        mask: [H,W] bool, compared pixels; None means all.
        visits: Number of steps per round of all targets.
    """

    camera: Camera
    colors: Floats32
    exposure: Exposure
    depth: Floats32
    mask: Bools | None
    visits: int = 1

    @property
    def range_m(self) -> float:
        """Distance beyond which the map is not compared with the image, m."""
        return view_range_m(self.depth)


def view_targets(
    views: Iterable[View], regions: Sequence[Region], config: RefineConfig
) -> list[Target]:
    """Return the targets of new views.

    Args:
        views: Training views of the changes.
        regions: Regions of the changes.
        config: Settings; with the scope "region" only pixels near the regions are compared.

    Returns:
        One target per view; none for a view that shows no region.
    """
    targets = []
    for view in views:
        mask = view.frame.mask
        if config.scope == "region":
            mask = region_pixels(view, regions, config.margin_px)
            if not mask.any():
                continue
        observed = view.frame.rgb.astype(np.float32) / np.float32(255)
        targets.append(
            Target(view.camera, observed, view.exposure, view.depth, mask, config.new_visits)
        )
    return targets


def replay_targets(
    before: GaussianMap,
    edited: GaussianMap,
    cameras: Sequence[Camera],
    regions: Sequence[Region],
    config: RefineConfig,
    *,
    range_m: float = np.inf,
    threads: int = 0,
) -> list[Target]:
    """Return renderings of the old map around a change, so that its surroundings stay as they were.

    Args:
        before: Map before the edit.
        edited: Map after the edit.
        cameras: Training cameras of the map.
        regions: Regions of the changes.
        config: Settings.
        range_m: Far plane of the renderings, m.
        threads: 0 uses all hardware threads.

    Returns:
        At most `config.replay_views` targets; edited pixels are masked out.
    """
    rasterizer = Rasterizer(np.float32)
    before, edited = before.without_features(), edited.without_features()
    options = RenderOptions(far_m=range_m, threads=threads)
    targets = []
    for camera in spread_cameras(cameras, regions, config.replay_views):
        mask = region_mask(camera, regions, config.margin_px)
        new = rasterizer.forward(edited, camera, options, mask=mask)
        old = rasterizer.forward(before, camera, options, mask=mask)
        is_edited = np.abs(new.rgb - old.rgb).max(axis=2) > MAX_EDIT_DIFFERENCE
        window = np.ones((EDIT_WINDOW_PX, EDIT_WINDOW_PX))
        mask &= cv2.dilate(is_edited.astype(np.uint8), window) == 0
        if mask.any():
            depth = np.where(old.alpha > MIN_DEPTH_ALPHA, old.depth, 0).astype(np.float32)
            colors = np.asarray(old.rgb, np.float32)
            targets.append(Target(camera, colors, Exposure(), depth, mask))
    return targets


def spread_cameras(
    cameras: Sequence[Camera], regions: Sequence[Region], count: int
) -> list[Camera]:
    """Select cameras that see a region, from positions as different as possible.

    Args:
        cameras: To select from.
        regions: A camera must see the centre of one of them.
        count: Maximum number.

    Returns:
        The cameras, by farthest point sampling of their positions.
    """
    seeing = [
        camera
        for camera in cameras
        if any(region.project_center(camera) is not None for region in regions)
    ]
    positions = np.array([camera.world_from_camera[:3, 3] for camera in seeing]).reshape(-1, 3)
    return [seeing[row] for row in farthest_points(positions, count)]


def region_pixels(view: View, regions: Sequence[Region], margin_px: int) -> Bools:
    """Return the pixels of a view around the regions.

    Args:
        view: Of the changes.
        regions: Regions of the changes.
        margin_px: Enlarges the bounding rectangles of the regions on all sides.

    Returns:
        [H,W] bool.
    """
    mask = region_mask(view.camera, regions, margin_px)
    return mask if view.frame.mask is None else mask & view.frame.mask


def region_mask(camera: Camera, regions: Iterable[Region], margin_px: int) -> Bools:
    """Return the pixels in the bounding rectangles of regions.

    Args:
        camera: Of the image.
        regions: Regions of the changes.
        margin_px: Enlarges the rectangles on all sides.

    Returns:
        [H,W] bool.
    """
    mask = np.zeros((camera.height, camera.width), np.bool_)
    for region in regions:
        rectangle = region.project_box(camera, margin_px)
        if rectangle is not None:
            x0, y0, x1, y1 = rectangle
            mask[y0:y1, x0:x1] = True
    return mask
