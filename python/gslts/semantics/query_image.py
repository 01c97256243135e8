"""A picture of what a query found: how well each Gaussian fits, and the boxes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gslts.core.camera import Camera, downscale
from gslts.core.gaussian_map import GaussianMap
from gslts.core.se3 import inverse_transform
from gslts.io.images import RgbImage, draw_box, draw_text, heat_image, to_rgb8
from gslts.rendering.rasterizer import Rasterizer, RenderOptions
from gslts.semantics.queries import Instance
from gslts.types import Floats

BOX_COLOR = (255, 255, 255)
MOST_TRIED = 30
SMALL_PX = 160
"""Width of the images in which the best view is looked for."""
COLDEST, HOTTEST = 0.5, 0.75
"""Relevance of what fits no better than anything, and about that of what fits."""


def draw_query(
    gaussian_map: GaussianMap,
    relevance: NDArray[np.float32],
    instances: Sequence[Instance],
    cameras: Iterable[Camera],
    threads: int = 0,
) -> RgbImage:
    """The map from the camera that shows most of the first instance whole.

    Args:
        gaussian_map: float32.
        relevance: [N] of its Gaussians.
        instances: What was found, at least one.
        cameras: From where the map may be shown, at least one.
        threads: 0 means one a hardware thread.
    """
    rasterizer, options = Rasterizer(np.float32), RenderOptions(threads=threads)
    is_first = np.zeros((gaussian_map.size, 1), np.float32)
    is_first[instances[0].rows] = 1
    marked = replace(gaussian_map, features=is_first)

    def shown(camera: Camera) -> float:
        """Pixels of the instance; those at the edge, where it may be cut off, count against it."""
        small = downscale(camera, max(1, camera.width // SMALL_PX))
        seen = rasterizer.forward(marked, small, options).features[..., 0]
        edge = seen[[0, -1]].sum() + seen[:, [0, -1]].sum()
        return float(seen.sum() / seen.size - edge / sum(seen.shape))

    camera = max(_facing(list(cameras), instances[0].middle), key=shown)
    heat = (relevance[:, None] - COLDEST) / (HOTTEST - COLDEST)
    hot = replace(gaussian_map, features=heat.clip(0, 1).astype(np.float32))
    images = rasterizer.forward(hot, camera, options)
    picture = heat_image(to_rgb8(images.rgb), images.features[..., 0])
    for one in instances:
        sides = one.corners[[0, 1, 3, 2]]  # Around the box; those of an edge differ in one bit.
        heights = np.repeat([one.low[2], one.high[2]], 4)[:, None]
        draw_box(picture, np.hstack([np.tile(sides, (2, 1)), heights]), camera, BOX_COLOR)
        _write_score(picture, one, camera)
    return picture


def _facing(cameras: list[Camera], point: Floats) -> list[Camera]:
    """The nearest of those whose image holds a point; all if none does."""
    metres = {
        number: float(np.linalg.norm(camera.world_from_camera[:3, 3] - point))
        for number, camera in enumerate(cameras)
        if _place_of(point, camera) is not None
    }
    nearest = sorted(metres, key=lambda number: metres[number])[:MOST_TRIED]
    return [cameras[number] for number in nearest] or cameras


def _write_score(picture: RgbImage, one: Instance, camera: Camera) -> None:
    place = _place_of(np.array([*one.middle[:2], one.high[2]]), camera)
    if place is not None:
        draw_text(picture, f"{one.score:.2f}", (place[0], place[1] - 4), BOX_COLOR)


def _place_of(point: Floats, camera: Camera) -> tuple[int, int] | None:
    """Column and row of a point in the image of a camera."""
    x, y, z = inverse_transform(camera.world_from_camera, point)
    if z <= 0:
        return None
    column, row = camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy
    inside = 0 <= column < camera.width and 0 <= row < camera.height
    return (int(column), int(row)) if inside else None
