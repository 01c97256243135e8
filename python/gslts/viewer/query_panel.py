"""Part of the panel for queries."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from gslts.viewer.goals import MAX_TEXT, Goal
from gslts.viewer.overlay import FOUND, Overlay
from gslts.viewer.panel_text import format_size, paragraphs
from gslts.viewer.path_panel import PathPanel
from gslts.viewer.viewed_map import ViewedMap


class QueryPanel:
    """Finds objects by words, and goes to them.

    Args:
        gui: Of a page.
        viewed: The map.
        overlay: Of the page.
        paths: Goes to objects.
        shown: Returns the number of the version that the page shows.
        connect: Lets a control of the panel start a task of a name.
    """

    def __init__(
        self,
        gui: Any,
        viewed: ViewedMap,
        overlay: Overlay,
        paths: PathPanel,
        shown: Callable[[], int],
        connect: Callable[[Any, str, Callable[[], None]], None],
    ) -> None:
        self._map, self._overlay, self._paths, self._shown = viewed, overlay, paths, shown
        with gui.add_folder("Words"):
            self._text = gui.add_text("Find", "")
            find, go = gui.add_button("Find"), paths.add_button(gui)
            self._answer = gui.add_html("")
        connect(find.on_click, "find", lambda: self._find(goes=False))
        connect(go.on_click, "find", lambda: self._find(goes=True))

    def _find(self, goes: bool) -> None:
        text = str(self._text.value)[:MAX_TEXT]
        self._overlay.clear("words")
        answers = self._map.find(self._shown(), text)
        for answer in answers:
            label = f"{text} {answer.score:.2f}"
            self._overlay.box("words", (answer.low, answer.high), FOUND, label)
        lines = [
            f"{answer.score:.2f}: {format_size(answer.low, answer.high)}" for answer in answers
        ]
        self._answer.content = paragraphs(lines or [f"{text}: not found"])
        if goes and answers:
            targets = [self._map.target_of(self._shown(), answer) for answer in answers]
            self._answer.content += paragraphs(self._paths.go(Goal(words=text), targets))
