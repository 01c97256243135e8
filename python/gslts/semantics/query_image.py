"""Image of the result of a query: relevance as a heat map, and the boxes of the objects."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from gslts.core.camera import Camera, downscale
from gslts.core.gaussian_map import GaussianMap
from gslts.core.se3 import inverse_transform
from gslts.io.images import RgbImage, draw_box, draw_text, heat_image, to_rgb8
from gslts.rendering.rasterizer import Rasterizer, RenderOptions
from gslts.semantics.queries import Instance
from gslts.types import Floats, Floats32

BOX_COLOR = (255, 255, 255)
"""RGB of boxes: white, which the heat map does not have."""
MAX_CANDIDATE_CAMERAS = 30
"""Number of the nearest cameras among which the best view is chosen; bounds time."""
CANDIDATE_WIDTH_PX = 160
"""Width of the images rendered to choose the view."""
LOWEST_SHARE = 0.8
"""Relevance at which the heat map begins, as a share of the lowest one of a match; it ends at the
highest one."""


def draw_query(
    gaussian_map: GaussianMap,
    relevance: Floats32,
    instances: Sequence[Instance],
    cameras: Iterable[Camera],
    threads: int = 0,
) -> RgbImage:
    """Draw the result of a query, from the camera that shows most of the best object.

    Args:
        gaussian_map: float32.
        relevance: [N] float32, relevance of its Gaussians.
        instances: Objects that match, at least one; the first one is the best.
        cameras: Candidate cameras, at least one, such as those the map was made from.
        threads: 0 uses one per hardware thread; does not change results.

    Returns:
        [H,W,3] uint8, sRGB.
    """
    rasterizer, options = Rasterizer(np.float32), RenderOptions(threads=threads)
    best_ids = gaussian_map.select(instances[0].rows).ids
    marked = gaussian_map.with_features(
        lambda ids: np.isin(ids, best_ids)[:, None].astype(np.float32)
    )

    def visibility(camera: Camera) -> float:
        """Share of the image that shows the object, less what touches the image border."""
        small = downscale(camera, max(1, camera.width // CANDIDATE_WIDTH_PX))
        mask = rasterizer.forward(marked, small, options).features[..., 0]
        border = mask[[0, -1]].sum() + mask[:, [0, -1]].sum()
        return float(mask.sum() / mask.size - border / sum(mask.shape))

    camera = max(_candidates(list(cameras), instances[0].center), key=visibility)
    matches = relevance[np.concatenate([instance.rows for instance in instances])]
    low, high = LOWEST_SHARE * matches.min(), matches.max()
    heat = (relevance[:, None] - low) / (high - low)
    heat_map = replace(gaussian_map, features=heat.clip(0, 1).astype(np.float32))
    images = rasterizer.forward(heat_map, camera, options)
    image = heat_image(to_rgb8(images.rgb), images.features[..., 0])
    for instance in instances:
        _draw_instance(image, instance, camera)
    return image


def _candidates(cameras: list[Camera], point: Floats) -> list[Camera]:
    """Return the nearest cameras that have a point in their image; all if there is none."""
    distances_m = {
        number: float(np.linalg.norm(camera.world_from_camera[:3, 3] - point))
        for number, camera in enumerate(cameras)
        if _project(point, camera) is not None
    }
    nearest = sorted(distances_m, key=lambda number: distances_m[number])
    return [cameras[number] for number in nearest[:MAX_CANDIDATE_CAMERAS]] or cameras


def _draw_instance(image: RgbImage, instance: Instance, camera: Camera) -> None:
    footprint = instance.corners[[0, 1, 3, 2]]  # Ends of an edge differ in one bit of the row.
    heights = np.repeat([instance.low[2], instance.high[2]], 4)[:, None]
    draw_box(image, np.hstack([np.tile(footprint, (2, 1)), heights]), camera, BOX_COLOR)
    pixel = _project(np.array([*instance.center[:2], instance.high[2]]), camera)
    if pixel is not None:
        draw_text(image, f"{instance.score:.2f}", (pixel[0], pixel[1] - 4), BOX_COLOR)


def _project(point: Floats, camera: Camera) -> tuple[int, int] | None:
    """Project a point (3,) in the world to column and row; None if it is not in the image."""
    x, y, z = inverse_transform(camera.world_from_camera, point)
    if z <= 0:
        return None
    column, row = camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy
    inside = 0 <= column < camera.width and 0 <= row < camera.height
    return (int(column), int(row)) if inside else None
