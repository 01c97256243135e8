"""Part of the panel for queries, paths to what they find, and the floor plan."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from gslts.navigation.semantic_map_files import draw_semantic_map
from gslts.semantics.queries import Instance
from gslts.types import Floats
from gslts.viewer.overlay import FOUND, MOVED, Overlay
from gslts.viewer.panel_text import format_size, paragraphs
from gslts.viewer.viewed_map import ViewedMap

MAX_TEXT = 200
"""Maximum length of a query; longer ones are cut."""


class QueryPanel:
    """Finds objects by words, and plans paths to them.

    Args:
        gui: Of a page.
        viewed: The map.
        overlay: Of the page.
        shown: Returns the number of the version that the page shows.
        eye: Returns the (3,) position of the viewer in the world, m.
        connect: Lets a control of the panel start a task of a name.
    """

    def __init__(
        self,
        gui: Any,
        viewed: ViewedMap,
        overlay: Overlay,
        shown: Callable[[], int],
        eye: Callable[[], Floats],
        connect: Callable[[Any, str, Callable[[], None]], None],
    ) -> None:
        self._map, self._overlay, self._shown, self._eye = viewed, overlay, shown, eye
        self._answers: list[Instance] = []
        with gui.add_folder("Words"):
            self._text = gui.add_text("Find", "")
            find, go = gui.add_button("Find"), gui.add_button("Path there")
            self._answer = gui.add_html("")
        with gui.add_folder("Plan", expand_by_default=False):
            draw = gui.add_button("Draw")
            self._plan_image = gui.add_image(np.full((1, 1, 3), 255, np.uint8), visible=False)
        connect(find.on_click, "find", self._find)
        connect(go.on_click, "find", self._go)
        connect(draw.on_click, "plan", lambda: self._draw_plan(None))

    def _find(self) -> None:
        text = str(self._text.value)[:MAX_TEXT]
        self._overlay.clear("words")
        self._answers = self._map.find(self._shown(), text)
        for answer in self._answers:
            label = f"{text} {answer.score:.2f}"
            self._overlay.box("words", (answer.low, answer.high), FOUND, label)
        lines = [
            f"{answer.score:.2f}: {format_size(answer.low, answer.high)}"
            for answer in self._answers
        ]
        self._answer.content = paragraphs(lines or [f"{text}: not found"])

    def _go(self) -> None:
        self._find()
        if not self._answers:
            return
        path = self._map.path(self._shown(), self._eye()[:2], self._answers)
        if path.reason:
            self._answer.content += paragraphs([f"no path from here: {path.reason}"])
            return
        floor_m = self._map.plan(self._shown()).floor_m + 0.05
        points = np.column_stack([path.points, np.full(len(path.points), floor_m)])
        self._overlay.path("words", points, MOVED)
        self._answer.content += paragraphs([f"path from here: {path.length_m:.1f} m"])
        self._draw_plan(path.points)

    def _draw_plan(self, path: Floats | None) -> None:
        self._plan_image.image = draw_semantic_map(self._map.plan(self._shown()), path)
        self._plan_image.visible = True
