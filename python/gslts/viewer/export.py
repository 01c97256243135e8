"""A map and its history as a page in one file, which opens without a server or a network."""

from __future__ import annotations

import gzip
import json
import math
from base64 import b64encode
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from html import escape
from importlib import resources
from itertools import pairwise
from pathlib import Path
from string import Template

import numpy as np

from gslts.io.atomic_files import write_atomic
from gslts.io.splat import GAUSSIAN, splat_rows
from gslts.viewer.blocks import rows_by_cell
from gslts.viewer.overlay import MOVED, box_edges, boxes_of_event
from gslts.viewer.viewed_map import ViewedMap

BLOCK_M = 0.25
"""Edge of the blocks of which a version is put together, m. A block that several versions share is
in the page once: smaller blocks make the page smaller, and longer lists of them."""
STEPS_PER_M = 4096
"""Centres are rounded to a quarter of a millimetre, which nobody sees: the page is smaller by a
third, together with the next value."""
SCALE_BITS = 12
"""Low bits of the float32 scales that are rounded off, of 23: an error of 0.01 %."""

Bar = Callable[[Iterable[int]], Iterable[int]]


def export_page(folder: Path, out: Path, max_versions: int, bar: Bar = iter) -> int:
    """Write the page, atomically.

    Args:
        folder: Folder of the map.
        out: File of the page.
        max_versions: Maximum number of versions, the newest ones.
        bar: Shows progress.

    Returns:
        Number of versions in the page.

    Raises:
        OSError: The map cannot be read, or the page cannot be written.
        ValueError: The folder holds no map, or a version is damaged.
    """
    viewed = ViewedMap(folder)
    numbers = [version.number for version in viewed.versions[-max_versions:]]
    blocks: dict[bytes, int] = {}  # Their contents, in the order of the page.
    try:
        versions = [
            {"blocks": _add_blocks(viewed, number, blocks), **_lines(viewed, number)}
            for number in bar(numbers)
        ]
    except ValueError as error:
        raise ValueError(f"{error}; --versions N leaves out all but the newest N") from None
    ends = np.cumsum([0, *map(len, blocks)]).tolist()
    position, target, fov_rad = viewed.first_view()
    scene = {
        "versions": versions,
        "blocks": list(pairwise(ends)),
        "view": {
            "position": position.tolist(),
            "target": target.tolist(),
            "fov_deg": math.degrees(fov_rad),
        },
    }
    files = resources.files("gslts.viewer")
    page = Template(files.joinpath("exported.html").read_text("utf-8")).substitute(
        title=escape(viewed.name),
        last=len(numbers) - 1,
        versions=_buttons(viewed, numbers),
        scene=json.dumps(scene),
        gaussians=b64encode(gzip.compress(_by_byte(b"".join(blocks)), mtime=0)).decode(),
        code=b64encode(files.joinpath("spark.js.gz").read_bytes()).decode(),
    )
    write_atomic(out, page.encode())
    return len(numbers)


def _add_blocks(viewed: ViewedMap, number: int, blocks: dict[bytes, int]) -> list[int]:
    """Add the blocks of a version to those of the page, and return their numbers there."""
    gaussian_map = viewed.gaussians(number)
    # Relative to the origin, for the float32 of the page.
    splats = splat_rows(replace(gaussian_map, origin=np.zeros(3)))
    splats["mean"] = np.rint(splats["mean"] * STEPS_PER_M) / STEPS_PER_M
    bits = splats["scales"].view(np.uint32) + np.uint32(1 << SCALE_BITS - 1)
    splats["scales"] = (bits >> SCALE_BITS << SCALE_BITS).view(np.float32)
    return [
        blocks.setdefault(splats[rows].tobytes(), len(blocks))
        for rows in rows_by_cell(gaussian_map, BLOCK_M).values()
    ]


def _by_byte(splats: bytes) -> bytes:
    """Return the first bytes of all Gaussians, then the second ones, ...: so, gzip halves them."""
    return np.frombuffer(splats, np.uint8).reshape(-1, GAUSSIAN.itemsize).T.tobytes()


def _lines(viewed: ViewedMap, number: int) -> dict[str, list[float]]:
    """Return ends and colours of the lines that show what a version changed."""
    lines: list[float] = []
    colors: list[float] = []
    for _, event in viewed.changes(max(1, number - 1), number).values():
        parts = [(box_edges(box), color) for box, color in boxes_of_event(event)]
        if len(parts) == 2:  # From the old to the new position.
            ends = [edges.mean(axis=(0, 1)) for edges, _ in parts]
            parts.append((np.array([ends]), MOVED))
        for segments, color in parts:
            lines += (segments - viewed.origin).round(3).ravel().tolist()
            colors += [channel / 255 for channel in color] * (2 * len(segments))
    return {"lines": lines, "colors": colors}


def _buttons(viewed: ViewedMap, numbers: Sequence[int]) -> str:
    """Return the list of versions, the newest first."""
    buttons = [
        f"<button value={row}><b>Version {number}</b> "
        f"{'<br>'.join(map(escape, viewed.describe(number)))}</button>"
        for row, number in enumerate(numbers)
    ]
    return "\n".join(reversed(buttons))
