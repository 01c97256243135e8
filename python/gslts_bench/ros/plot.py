"""Plan of a day over ROS: free floor, path of the robot, and what it found."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from gslts_bench.ros.day import DayResult

SHADES = {-1: 0.75, 0: 1.0, 100: 0.2}
"""Grey of unknown, free and occupied cells."""
COLORS = ("tab:red", "tab:green")
"""Of boxes before and after a change."""


def write_plan(path: Path, result: DayResult) -> None:
    """Draw the plan.

    Args:
        path: Of the PNG.
        result: Of the day.

    Raises:
        OSError: The file cannot be written.
    """
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt
    from matplotlib.patches import Rectangle

    figure, axes = plt.subplots(figsize=(7, 7))
    info, origin = result.grid.info, result.grid.info.origin.position
    cells = np.array(result.grid.data, np.int8).reshape(info.height, info.width)
    gray = np.vectorize(SHADES.get)(cells)
    right, top = origin.x + info.resolution * info.width, origin.y + info.resolution * info.height
    extent = (origin.x, right, origin.y, top)
    axes.imshow(gray, "gray", vmin=0, vmax=1, origin="lower", extent=extent)
    axes.plot(*np.array(result.path).T, color="tab:blue", linewidth=0.7)
    for event in result.events:
        for box, color in zip(event.boxes, COLORS, strict=True):
            if box is not None:
                low, high = np.array(box)[:, :2]
                axes.add_patch(Rectangle(low, *(high - low), fill=False, color=color, lw=2))
        last = event.boxes[1] or event.boxes[0]
        if last is not None:
            axes.annotate(f"{event.type}: {event.kind}", last[1][:2], fontsize=8)
    title = "Path of the robot (blue), what it found gone (red) and new (green)"
    axes.set(xlabel="x, m", ylabel="y, m", title=title)
    figure.savefig(path, dpi=120, bbox_inches="tight")
    plt.close(figure)
