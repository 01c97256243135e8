"""Semantic maps as pictures, and as the pair of files that ROS's map_server reads."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

from gslts.io.atomic_files import write_atomic
from gslts.io.images import RgbImage, draw_text
from gslts.navigation.semantic_map import SemanticMap
from gslts.types import Floats

OCCUPIED, FREE, UNKNOWN = 0, 254, 205
"""Of map_server's trinary mode."""
OCCUPIED_THRESH, FREE_THRESH = 0.65, 0.196
"""Its defaults; (255 - 205) / 255 is between them."""
GREYS = {"unknown": 150, "free": 255, "obstacle": 70}
CELL_PX = 6
LEGEND_PX, LINE_PX = 150, 18
START_COLOR, WAY_COLOR, END_COLOR = (0, 130, 0), (220, 0, 0), (220, 0, 0)


def write_map_server(semantic_map: SemanticMap, folder: Path) -> None:
    """Writes map.pgm and map.yaml, each whole or not at all, the picture first.

    Raises:
        OSError: They cannot be written.
    """
    values = np.full(semantic_map.obstacles.shape, UNKNOWN, np.uint8)
    values[semantic_map.explored] = FREE
    values[semantic_map.obstacles] = OCCUPIED
    rows = values[::-1]  # The first row of the picture is that of the greatest y.
    size = len(rows)
    grid = semantic_map.grid
    x, y = grid.origin.tolist()
    told = (
        f"image: map.pgm\nresolution: {grid.cell_m!r}\norigin: [{x!r}, {y!r}, 0.0]\nnegate: 0\n"
        f"occupied_thresh: {OCCUPIED_THRESH}\nfree_thresh: {FREE_THRESH}\n"
    )
    write_atomic(folder / "map.pgm", f"P5\n{size} {size}\n255\n".encode() + rows.tobytes())
    write_atomic(folder / "map.yaml", told.encode())


def draw_semantic_map(
    semantic_map: SemanticMap, way: Floats | None = None, categories: Sequence[str] | None = None
) -> RgbImage:
    """A plan, y upwards, with a legend at its right.

    Args:
        semantic_map: What is shown.
        way: [P,2] where a robot went, x and y in the world, m.
        categories: Those that are shown; all, if not given.
    """
    shown = semantic_map.categories if categories is None else tuple(categories)
    plan = np.full((*semantic_map.obstacles.shape, 3), GREYS["unknown"], np.uint8)
    plan[semantic_map.explored] = GREYS["free"]
    plan[semantic_map.obstacles] = GREYS["obstacle"]
    colors = _colors(len(shown))
    for name, color in zip(shown, colors, strict=True):
        plan[semantic_map.category(name)] = color
    picture = np.ascontiguousarray(plan[::-1].repeat(CELL_PX, 0).repeat(CELL_PX, 1))
    if way is not None and len(way):
        _draw_way(picture, semantic_map, way)
    entries = [(name, (grey, grey, grey)) for name, grey in GREYS.items()]
    entries += list(zip(shown, colors, strict=True))
    if way is not None:
        entries += [("start", START_COLOR), ("way, end", WAY_COLOR)]
    return _with_legend(picture, entries)


def write_picture(picture: RgbImage, path: Path) -> None:
    """Writes a PNG, all or nothing.

    Raises:
        OSError: It cannot be written.
    """
    content = io.BytesIO()
    Image.fromarray(picture).save(content, "PNG")
    write_atomic(path, content.getvalue())


def _draw_way(picture: RgbImage, semantic_map: SemanticMap, way: Floats) -> None:
    grid = semantic_map.grid
    columns_rows = (way - grid.origin) / grid.cell_m * (1, -1) + (0, grid.size)
    pixels = np.rint(columns_rows * CELL_PX).astype(np.int32)
    cv2.polylines(picture, [pixels[:, None]], False, WAY_COLOR, 2, cv2.LINE_AA)
    for place, color, radius in ((0, START_COLOR, 6), (-1, END_COLOR, 6)):
        cv2.circle(picture, pixels[place].tolist(), radius, color, -1, cv2.LINE_AA)


def _with_legend(
    picture: RgbImage, entries: Sequence[tuple[str, tuple[int, int, int]]]
) -> RgbImage:
    height = max(len(picture), LINE_PX * (len(entries) + 1))
    canvas = np.full((height, picture.shape[1] + LEGEND_PX, 3), GREYS["unknown"], np.uint8)
    canvas[: len(picture), : picture.shape[1]] = picture
    left = picture.shape[1] + 8
    for number, (name, color) in enumerate(entries):
        top = 6 + number * LINE_PX
        canvas[top : top + 12, left : left + 12] = color
        cv2.rectangle(canvas, (left, top), (left + 11, top + 11), (0, 0, 0))
        draw_text(canvas, _ascii(name), (left + 18, top + 11), (255, 255, 255))
    return canvas


def _ascii(name: str) -> str:
    return name.encode("ascii", "replace").decode()


def _colors(count: int) -> list[tuple[int, int, int]]:
    """Of even hues, so that neighbours in the legend differ."""
    hues = np.arange(count) * 180 / max(1, count)
    hsv = np.stack([hues, np.full(count, 190), np.full(count, 235)], axis=1).astype(np.uint8)
    rgb = cv2.cvtColor(hsv[None], cv2.COLOR_HSV2RGB)[0] if count else np.zeros((0, 3), np.uint8)
    return [(int(r), int(g), int(b)) for r, g, b in rgb]
