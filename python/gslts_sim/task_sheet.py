"""Sheet of a scene change task: views before and after, test views and a plan."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from gslts_sim.contact_sheet import plan_of
from gslts_sim.controller import Controller
from gslts_sim.event import Event
from gslts_sim.home import Home
from gslts_sim.robot_body import Viewpoint
from gslts_sim.task import Task

BEFORE, AFTER = "#ffb000", "#00d0ff"
"""Colours of the two states."""
MAX_TEST_VIEWS = 4
"""Number of near test views that are shown, and of far ones."""


def write_task_sheet(task: Task, home: Home, path: Path) -> None:
    """Write both states from the initial viewpoint, some test views and a plan as one PNG.

    Args:
        task: The task.
        home: Result of `task.home.load`.
        path: Of the PNG file.

    Raises:
        OSError: The file cannot be written.
        ValueError: The task cannot be replayed in the home.
    """
    figure = Figure(figsize=(16, 8.6), layout="constrained")
    FigureCanvasAgg(figure)
    change = task.change
    title = f"{home.name}: {change.kind} of {change.object_id}"
    figure.suptitle(title, parse_math=False)
    grid = figure.add_gridspec(3, 6, height_ratios=(2.1, 1, 1))
    before = task.observe(task.start(home, changed=False), 0)
    robot = task.start(home, changed=True)
    after = task.observe(robot, 0)
    for column, (name, event, color) in enumerate(
        (("before", before, BEFORE), ("after", after, AFTER))
    ):
        axes = figure.add_subplot(grid[0, 2 * column : 2 * column + 2])
        _show(axes, event, change.object_id, color)
        axes.set_title(f"{name}, from the initial viewpoint", color=color, backgroundcolor="#222")
    sets = task.test_viewpoints
    for row, (name, first) in enumerate((("near", 1), ("far", 1 + len(sets.near))), start=1):
        for column in range(MAX_TEST_VIEWS):
            axes = figure.add_subplot(grid[row, column])
            _show(axes, task.observe(robot, first + column), change.object_id, AFTER)
            axes.set_title(f"{name} {column + 1}, after", fontsize=8)
    _plan(figure.add_subplot(grid[:, 4:]), task, robot)
    figure.savefig(path, dpi=100)


def _show(axes: Axes, event: Event, object_id: str, color: str) -> None:
    axes.imshow(event.frame)
    mask = event.instance_masks.get(object_id)
    if mask is not None:
        rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
        x, y = columns[0] - 3, rows[0] - 3
        width, height = columns[-1] - columns[0] + 7, rows[-1] - rows[0] + 7
        axes.add_patch(Rectangle((x, y), width, height, fill=False, color=color, linewidth=1.5))
    axes.set_axis_off()


def _plan(axes: Axes, task: Task, robot: Controller) -> None:
    (x0, y0, _), (x1, y1, _) = robot.home.space.box
    axes.imshow(plan_of(robot.home, robot.home.space), extent=(x0, x1, y0, y1), alpha=0.8)
    for box, color in ((task.change.box_before, BEFORE), (task.change.box_after, AFTER)):
        if box is not None:
            (x, y, _), (right, top, _) = box
            axes.add_patch(
                Rectangle((x, y), right - x, top - y, fill=False, color=color, linewidth=2.5)
            )
    sets = task.test_viewpoints
    _arrows(axes, sets.near, "#7fff00", "near")
    _arrows(axes, sets.far, "#ff40ff", "far")
    _arrows(axes, (task.viewpoint,), "red", "initial")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.1), ncols=3)
    axes.set(xlabel="x, m", ylabel="y, m", title="after: test viewpoints and boxes")


def _arrows(axes: Axes, viewpoints: tuple[Viewpoint, ...], color: str, label: str) -> None:
    x, y = np.array([(view.x, view.y) for view in viewpoints]).T
    yaw_rad = np.deg2rad([view.yaw_deg for view in viewpoints])
    axes.quiver(
        x, y, np.cos(yaw_rad), np.sin(yaw_rad),
        color=color, label=label, scale=18, width=0.006, edgecolor="black", linewidth=0.4,
    )  # fmt: skip
