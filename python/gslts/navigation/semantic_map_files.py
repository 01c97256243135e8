"""Semantic maps as images, and as files of the map_server of ROS."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from gslts.io.atomic_files import write_atomic
from gslts.io.images import RgbImage, draw_text
from gslts.navigation.grid import Grid
from gslts.navigation.semantic_map import SemanticMap
from gslts.types import Floats

OCCUPIED, FREE, UNKNOWN = 0, 254, 205
"""Pixel values of the trinary mode of map_server."""
OCCUPIED_THRESH, FREE_THRESH = 0.65, 0.196
"""Default thresholds of map_server; (255 - 205) / 255 is between them."""
GREYS = {"unknown": 150, "free": 255, "obstacle": 70}
"""Grey of each kind of cell in the image; all three differ from text and path."""
CELL_PX, MAX_SIDE_PX = 6, 4096
"""Side of a cell in the image, px, so that a path across single cells is visible, and maximum side
of the map there, px, which bounds memory: cells of larger maps are smaller."""
LINE_PX = 18
"""Height of a line of the legend, px: that of its text."""
START_COLOR, PATH_COLOR = (0, 130, 0), (220, 0, 0)
"""RGB of the start and of the path."""


def write_map_server(semantic_map: SemanticMap, folder: Path) -> None:
    """Write map.pgm and map.yaml for map_server, each atomically, the image first.

    Args:
        semantic_map: Its obstacles and explored area are written.
        folder: Existing folder.

    Raises:
        OSError: A file cannot be written.
    """
    values = np.full(semantic_map.obstacles.shape, UNKNOWN, np.uint8)
    values[semantic_map.explored] = FREE
    values[semantic_map.obstacles] = OCCUPIED
    rows = values[::-1]  # The first row of the image has the largest y.
    size = len(rows)
    grid = semantic_map.grid
    (x, y), cell_m = grid.origin.tolist(), float(grid.cell_m)
    description = (
        f"image: map.pgm\nresolution: {cell_m!r}\norigin: [{x!r}, {y!r}, 0.0]\nnegate: 0\n"
        f"occupied_thresh: {OCCUPIED_THRESH}\nfree_thresh: {FREE_THRESH}\n"
    )
    write_atomic(folder / "map.pgm", f"P5\n{size} {size}\n255\n".encode() + rows.tobytes())
    write_atomic(folder / "map.yaml", description.encode())


def draw_semantic_map(
    semantic_map: SemanticMap, path: Floats | None = None, categories: Sequence[str] | None = None
) -> RgbImage:
    """Draw a semantic map, y upwards, with a legend at its right.

    Args:
        semantic_map: The map.
        path: [P,2] path of a robot, x and y in the world, m; None for none.
        categories: Names of the layers to draw; None for all.

    Returns:
        [H,W,3] uint8, sRGB.
    """
    names = semantic_map.categories if categories is None else tuple(categories)
    cells = np.full((*semantic_map.obstacles.shape, 3), GREYS["unknown"], np.uint8)
    cells[semantic_map.explored] = GREYS["free"]
    cells[semantic_map.obstacles] = GREYS["obstacle"]
    colors = _colors(len(names))
    for name, color in zip(names, colors, strict=True):
        cells[semantic_map.category(name)] = color
    cell_px = max(1, min(CELL_PX, MAX_SIDE_PX // semantic_map.grid.size))
    image = np.ascontiguousarray(cells[::-1].repeat(cell_px, 0).repeat(cell_px, 1))
    if path is not None and len(path):
        _draw_path(image, semantic_map.grid, path, cell_px)
    entries = [(name, (grey, grey, grey)) for name, grey in GREYS.items()]
    entries += list(zip(names, colors, strict=True))
    if path is not None:
        entries += [("start", START_COLOR), ("path, end", PATH_COLOR)]
    return _add_legend(image, entries)


def _draw_path(image: RgbImage, grid: Grid, path: Floats, cell_px: int) -> None:
    columns_rows = (path - grid.origin) / grid.cell_m * (1, -1) + (0, grid.size)
    pixels = np.rint(columns_rows * cell_px).astype(np.int32)
    cv2.polylines(image, [pixels[:, None]], False, PATH_COLOR, 2, cv2.LINE_AA)
    for pixel, color in ((pixels[0], START_COLOR), (pixels[-1], PATH_COLOR)):
        cv2.circle(image, pixel.tolist(), 6, color, -1, cv2.LINE_AA)


def _add_legend(image: RgbImage, entries: Sequence[tuple[str, tuple[int, int, int]]]) -> RgbImage:
    height = max(len(image), LINE_PX * (len(entries) + 1))
    # The longest text of the legend takes 150 px.
    canvas = np.full((height, image.shape[1] + 150, 3), GREYS["unknown"], np.uint8)
    canvas[: len(image), : image.shape[1]] = image
    left = image.shape[1] + 8
    for number, (name, color) in enumerate(entries):
        top = 6 + number * LINE_PX
        canvas[top : top + 12, left : left + 12] = color
        cv2.rectangle(canvas, (left, top), (left + 11, top + 11), (0, 0, 0))
        text = name.encode("ascii", "replace").decode()
        draw_text(canvas, text, (left + 18, top + 11), (255, 255, 255))
    return canvas


def _colors(count: int) -> list[tuple[int, int, int]]:
    """Return RGB colours of evenly spaced hues."""
    hues = np.arange(count) * 180 / max(1, count)
    hsv = np.stack([hues, np.full(count, 190), np.full(count, 235)], axis=1).astype(np.uint8)
    rgb = cv2.cvtColor(hsv[None], cv2.COLOR_HSV2RGB)[0] if count else np.zeros((0, 3), np.uint8)
    return [(int(r), int(g), int(b)) for r, g, b in rgb]
