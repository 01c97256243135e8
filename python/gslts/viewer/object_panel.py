"""Part of the panel for the object that was clicked on."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from gslts.store.causes import Box
from gslts.store.describe import describe_event
from gslts.store.records import Track
from gslts.types import Floats
from gslts.viewer.goals import MAX_TEXT, Goal
from gslts.viewer.overlay import CAME, FOUND, Overlay
from gslts.viewer.panel_text import format_size, paragraphs
from gslts.viewer.path_panel import PathPanel
from gslts.viewer.picking import surface_point
from gslts.viewer.viewed_map import ViewedMap


class ObjectPanel:
    """Describes an object, and goes to it.

    Args:
        gui: Of a page.
        viewed: The map.
        overlay: Of the page.
        paths: Goes to the object.
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
        self._chosen: tuple[str, Box] | None = None
        with gui.add_folder("Object"):
            self._text = gui.add_html(paragraphs(["Click on anything."]))
            self._button = paths.add_button(gui)
            self._button.visible = False
            self._path = gui.add_html("")
        connect(self._button.on_click, "go", self._go)

    def clear(self) -> None:
        """Forget the object."""
        self._overlay.clear("object")
        self._choose(None)

    def show(self, origin: Floats, direction: Floats) -> None:
        """Show the object that a ray hits.

        Args:
            origin: (3,) start of the ray in the world, m.
            direction: (3,) direction of the ray.
        """
        self.clear()
        point = surface_point(self._map.gaussians(self._shown()), origin, direction)
        if point is None:
            self._text.content = paragraphs(["Nothing is there."])
            return
        track = self._map.track_at(self._shown(), point)
        lines = None if track is None else self._show_track(track)
        if lines is None and self._map.has_words(self._shown()):
            lines = self._show_named(point)
        position = f"({', '.join(f'{x:.2f}' for x in point)}) m"
        self._text.content = paragraphs([*(lines or ["Nothing known by a name."]), position])

    def _choose(self, chosen: tuple[str, Box] | None) -> None:
        self._chosen, self._path.content = chosen, ""
        self._button.visible = chosen is not None

    def _go(self) -> None:
        if self._chosen is not None:
            name, box = self._chosen
            target = self._map.target_in(self._shown(), box)
            goal = Goal(words=name[:MAX_TEXT], box=box)
            self._path.content = paragraphs(self._paths.go(goal, [target]))

    def _show_track(self, track: Track) -> list[str]:
        box = track.events[-1].boxes[1]
        assert box is not None
        self._choose((track.name, box))
        self._overlay.box("object", box, CAME, track.name)
        for event in track.events:
            if event.boxes[0] is not None:
                self._overlay.event("object", event, track.name)
        since = [event for event in track.events if event.kind != "shift"]
        first = f"there since version {since[-1].version}" if since else "there since version 1"
        lines = [f"{event.version}: {describe_event(event, track.name)}" for event in track.events]
        return [f"{track.name}, {format_size(*box)}, {first}", *lines[::-1]]

    def _show_named(self, point: Floats) -> list[str] | None:
        found = self._map.name_at(self._shown(), point)
        if found is None:
            return None
        name, instance = found
        if instance is None:
            return [name]
        low, high = (tuple(corner.tolist()) for corner in (instance.low, instance.high))
        self._choose((name, (low, high)))
        self._overlay.box("object", (low, high), FOUND, name)
        return [
            f"{name}, {format_size(low, high)}, score {instance.score:.2f}",
            "no change is known of it",
        ]
