"""Lines, boxes and names over the Gaussians of a page."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from gslts.core.camera import Camera
from gslts.core.se3 import transform
from gslts.store.causes import Box
from gslts.store.records import ObjectEvent
from gslts.types import Floats

Color = tuple[int, int, int]

CAME: Color = (0, 200, 0)
GONE: Color = (230, 30, 30)
MOVED: Color = (255, 150, 0)
FOUND: Color = (0, 140, 255)
"""Colours of boxes: what came, what is gone, what moved or was shifted, and answers."""
CAMERA: Color = (90, 90, 90)
ROBOT: Color = (190, 0, 220)
"""Colours of cameras of the map, and of a robot and its path."""
LINE_PX = 2.5
"""Width of lines, px."""
CAMERA_M = 0.12
"""Depth of the drawn pyramid of a camera, m."""
EDGES = [(a, a | 1 << k) for k in range(3) for a in range(8) if not a >> k & 1]
"""Corners of the 12 edges of a box; the bits of a corner choose low or high x, y and z."""


class Overlay:
    """Draws into the scene of a page, in groups that are replaced as a whole.

    Args:
        scene: Of a page, or of a server of viser.
        origin: (3,) of the map in the world, m.
    """

    def __init__(self, scene: Any, origin: Floats) -> None:
        self._scene, self._origin = scene, origin
        self._groups: dict[str, list[Any]] = {}

    def clear(self, group: str) -> None:
        """Remove what was drawn.

        Args:
            group: Name of the group.
        """
        for handle in self._groups.pop(group, []):
            handle.remove()

    def lines(self, group: str, segments: Floats, color: Color) -> None:
        """Draw lines.

        Args:
            group: Name of the group.
            segments: [L,2,3] ends, in the world, m.
            color: Of all lines.
        """
        handle = self._scene.add_line_segments(
            self._new_name(group),
            (segments - self._origin).astype(np.float32),
            color,
            thickness=LINE_PX,
            thickness_units="screen",
        )
        self._groups[group].append(handle)

    def path(self, group: str, points: Floats, color: Color) -> None:
        """Draw a path.

        Args:
            group: Name of the group.
            points: [P,3] in the world, m.
            color: Of the path.
        """
        self.lines(group, np.stack([points[:-1], points[1:]], axis=1), color)

    def name(self, group: str, text: str, point: Floats) -> None:
        """Draw a name.

        Args:
            group: Name of the group.
            text: The name.
            point: (3,) in the world, m.
        """
        handle = self._scene.add_label(
            self._new_name(group), text, position=point - self._origin, anchor="bottom-center"
        )
        self._groups[group].append(handle)

    def box(self, group: str, box: Box | tuple[Floats, Floats], color: Color, text: str) -> None:
        """Draw a box and a name above it.

        Args:
            group: Name of the group.
            box: Lower and upper corner in the world, m.
            color: Of the box.
            text: Name.
        """
        self.lines(group, box_edges(box), color)
        low, high = np.array(box[0]), np.array(box[1])
        self.name(group, text, np.array([*((low + high) / 2)[:2], high[2]]))

    def event(self, group: str, event: ObjectEvent, text: str) -> None:
        """Draw an object change: boxes where the object was and is, and an arrow between them.

        Args:
            group: Name of the group.
            event: The change.
            text: Name of the object.
        """
        boxes = boxes_of_event(event)
        for box, color in boxes:
            is_old = len(boxes) == 2 and box is event.boxes[0]
            self.box(group, box, color, f"{text}, before" if is_old else text)
        if len(boxes) == 2:
            ends = np.array([np.mean(box, axis=0) for box, _ in boxes]) - self._origin
            handle = self._scene.add_arrows(
                self._new_name(group),
                ends[None],
                MOVED,
                shaft_radius=0.006,
                head_radius=0.018,
                head_length=0.05,
            )
            self._groups[group].append(handle)

    def cameras(self, group: str, cameras: Sequence[Camera], color: Color = CAMERA) -> None:
        """Draw cameras as pyramids.

        Args:
            group: Name of the group.
            cameras: In the world.
            color: Of the pyramids.
        """
        parts = [_pyramid(camera) for camera in cameras]
        if parts:
            self.lines(group, np.concatenate(parts), color)

    def _new_name(self, group: str) -> str:
        drawn = self._groups.setdefault(group, [])
        return f"/{group}/{len(drawn)}"


def boxes_of_event(event: ObjectEvent) -> list[tuple[Box, Color]]:
    """Return where an object was and is, with colours that tell what happened.

    Args:
        event: The change.

    Returns:
        The known boxes: before the change, and after it.
    """
    before, after = event.boxes
    if before is not None and after is not None:
        return [(before, MOVED), (after, MOVED)]
    return [(box, color) for box, color in ((before, GONE), (after, CAME)) if box is not None]


def box_edges(box: Box | tuple[Floats, Floats]) -> Floats:
    """Return the edges [12,2,3] of a box.

    Args:
        box: Lower and upper corner, m.
    """
    low, high = np.array(box[0]), np.array(box[1])
    corners = np.array([np.where([c & 1, c & 2, c & 4], high, low) for c in range(8)])
    edges: Floats = corners[EDGES]
    return edges


def _pyramid(camera: Camera) -> Floats:
    """Return the [8,2,3] edges of the pyramid of a camera in the world, m."""
    xs = (np.array([0, camera.width, camera.width, 0]) - camera.cx) / camera.fx
    ys = (np.array([0, 0, camera.height, camera.height]) - camera.cy) / camera.fy
    corners = CAMERA_M * np.column_stack([xs, ys, np.ones(4)])
    points = transform(camera.world_from_camera, np.vstack([corners, np.zeros(3)]))
    edges: Floats = points[[(0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 4), (2, 4), (3, 4)]]
    return edges
