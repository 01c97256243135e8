"""Part of the panel for the floor plan, and paths over it to objects."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from gslts.navigation.semantic_map_files import draw_semantic_map
from gslts.navigation.viewpoints import Target
from gslts.types import Floats
from gslts.viewer.goals import Goal
from gslts.viewer.overlay import MOVED, Overlay
from gslts.viewer.panel_text import EMPTY
from gslts.viewer.viewed_map import ViewedMap

LAST = 1000.0
"""Order of this part: it stands below the others."""
ABOVE_FLOOR_M = 0.05
"""Height of a drawn path, m."""


class PathPanel:
    """Plans paths over the floor, and sends the robot along if pages may.

    Args:
        gui: Of a page.
        viewed: The map.
        overlay: Of the page.
        shown: Returns the number of the version that the page shows.
        eye: Returns the (3,) position of the viewer in the world, m.
        send_goal: Sends the robot to a goal; None if pages may not, or there is no robot.
        connect: Lets a control of the panel start a task of a name.

    Attributes:
        robot_at: (3,) last known position of the robot in the world, m; None if there is none.
    """

    def __init__(
        self,
        gui: Any,
        viewed: ViewedMap,
        overlay: Overlay,
        shown: Callable[[], int],
        eye: Callable[[], Floats],
        send_goal: Callable[[Goal], None] | None,
        connect: Callable[[Any, str, Callable[[], None]], None],
    ) -> None:
        self._map, self._overlay, self._shown, self._eye = viewed, overlay, shown, eye
        self._send_goal = send_goal
        self.robot_at: Floats | None = None
        with gui.add_folder("Plan", expand_by_default=False, order=LAST):
            draw = gui.add_button("Draw")
            self._image = gui.add_image(EMPTY, visible=False)
        connect(draw.on_click, "plan", lambda: self._draw_plan(None))

    def add_button(self, gui: Any) -> Any:
        """Add a button that goes to something.

        Args:
            gui: Of the page.

        Returns:
            The button.
        """
        does = "Plans a path" if self._send_goal is None else "Sends the robot"
        return gui.add_button("Go there", hint=f"{does} over the floor")

    def go(self, goal: Goal, targets: Sequence[Target]) -> list[str]:
        """Draw the path to the nearest of some objects, and send the robot there if pages may.

        Args:
            goal: Describes the objects to the robot.
            targets: The objects in the version that the page shows.

        Returns:
            Lines that describe the path, and what the robot does.

        Raises:
            OSError: The robot takes no goals at present.
        """
        lines, start = [], self._eye()
        if self._send_goal is not None:
            self._send_goal(goal)  # Planning takes time, and the robot plans by itself.
            lines = ["sent to the robot; above stands what it does"]
            start = start if self.robot_at is None else self.robot_at
        return [self._draw_path(start, targets), *lines]

    def _draw_path(self, start: Floats, targets: Sequence[Target]) -> str:
        whose = "of the robot" if start is self.robot_at else "from here"
        self._overlay.clear("path")
        try:
            path = self._map.path(self._shown(), start[:2], targets)
            plan = self._map.plan(self._shown())
        except ValueError as error:  # Without a floor, the robot may still know a path.
            return f"no path {whose}: {error}"
        if path.reason:
            return f"no path {whose}: {path.reason}"
        height_m = np.full(len(path.points), plan.floor_m + ABOVE_FLOOR_M)
        self._overlay.path("path", np.column_stack([path.points, height_m]), MOVED)
        self._draw_plan(path.points)
        return f"path {whose}: {path.length_m:.1f} m"

    def _draw_plan(self, path: Floats | None) -> None:
        self._image.image = draw_semantic_map(self._map.plan(self._shown()), path)
        self._image.visible = True
