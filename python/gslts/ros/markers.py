"""Changes of objects as markers for RViz."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np
from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from gslts.ros.shown_change import ShownChange
from gslts.types import Floats

CAME, GONE, LEFT, MOVED, SHIFTED = (
    (0.1, 0.8, 0.2),
    (0.9, 0.1, 0.1),
    (1.0, 0.55, 0.0),
    (0.15, 0.45, 1.0),
    (0.95, 0.85, 0.1),
)
"""RGB of what came (green), is gone (red), left its position (orange), stands at another one (blue)
and was shifted a little (yellow)."""
WORDS = {"addition": "came", "removal": "gone", "relocation": "moved", "shift": "shifted"}
"""Word of each kind in a label."""
COLORS = {
    "addition": (None, CAME),
    "removal": (GONE, None),
    "relocation": (LEFT, MOVED),
    "shift": (None, SHIFTED),
}
"""Colours of the boxes before and after each kind of change; None where no box is drawn. The ends
of a shift overlap, so that only the second one is."""
ALPHA, DETECTED_ALPHA = 0.35, 0.15
"""Opacity of the sides of a box of a published change, and of one that is only detected."""
MIN_SIDE_M = 0.01
"""Minimum side of a box: RViz draws none without thickness."""
EDGE_M, SHAFT_M, HEAD_M, LETTER_M = 0.01, 0.03, 0.08, 0.12
"""Widths of edges, of the shaft and of the head of an arrow, and height of letters, m."""
MAX_LETTERS = 80
"""Maximum length of a label."""
FIRST_EDGES, ARROW, LABEL = 2, 4, 5
"""Numbers of the markers of an object: boxes are 0 and 1, their edges 2 and 3."""


def change_markers(frame_id: str, changes: Sequence[ShownChange]) -> MarkerArray:
    """Return the markers of changes, which replace all earlier ones.

    The namespace of a marker is the name of its object, so that RViz can hide single objects. The
    stamp is zero: what does not change needs no transform of its own time.

    Args:
        frame_id: Frame of the boxes.
        changes: To show; published ones are opaque, detected ones faint with their confidence.
    """
    clear = Marker(header=Header(frame_id=frame_id), action=Marker.DELETEALL)
    clear.pose.orientation.w = 1.0
    markers = [clear]
    for change in changes:
        colors = COLORS[change.kind]
        for side, (box, color) in enumerate(zip(change.boxes, colors, strict=True)):
            if box is not None and color is not None:
                markers += _box_markers(frame_id, change, side, box, color)
        before, after = change.boxes
        if before is not None and after is not None:
            markers.append(_arrow(frame_id, change, before, after))
        if before is not None or after is not None:
            markers.append(_label(frame_id, change))
    return MarkerArray(markers=markers)


def _box_markers(
    frame_id: str,
    change: ShownChange,
    side: int,
    box: Floats,
    color: tuple[float, float, float],
) -> list[Marker]:
    """Return a translucent box and its edges."""
    alpha = ALPHA if change.confidence is None else DETECTED_ALPHA
    sides = _marker(frame_id, change, side, Marker.CUBE, (*color, alpha))
    centre, size = box.mean(axis=0), np.maximum(box[1] - box[0], MIN_SIDE_M)
    sides.pose.position = _point(centre)
    sides.scale.x, sides.scale.y, sides.scale.z = size.tolist()
    edges = _marker(frame_id, change, FIRST_EDGES + side, Marker.LINE_LIST, (*color, 1.0))
    edges.scale.x = EDGE_M
    corners = {signs: _point(centre + size / 2 * signs) for signs in product((-1, 1), repeat=3)}
    edges.points = [
        corners[end]
        for low in corners
        for axis in range(3)
        if low[axis] < 0
        for end in (low, (*low[:axis], 1, *low[axis + 1 :]))
    ]
    return [sides, edges]


def _arrow(frame_id: str, change: ShownChange, before: Floats, after: Floats) -> Marker:
    color = COLORS[change.kind][1] or MOVED
    arrow = _marker(frame_id, change, ARROW, Marker.ARROW, (*color, 1.0))
    arrow.points = [_point(before.mean(axis=0)), _point(after.mean(axis=0))]
    # The length of the head, 0, lets RViz choose it.
    arrow.scale.x, arrow.scale.y, arrow.scale.z = SHAFT_M, HEAD_M, 0.0
    return arrow


def _label(frame_id: str, change: ShownChange) -> Marker:
    box = change.boxes[1] if change.boxes[1] is not None else change.boxes[0]
    assert box is not None
    label = _marker(frame_id, change, LABEL, Marker.TEXT_VIEW_FACING, (1.0, 1.0, 1.0, 1.0))
    label.pose.position = _point(np.array([*box.mean(axis=0)[:2], box[1, 2] + LETTER_M]))
    label.scale.z = LETTER_M
    sure = "" if change.confidence is None else f"? {100 * change.confidence:.0f} %"
    label.text = f"{change.name[:MAX_LETTERS]} {WORDS[change.kind]}{sure}"
    return label


def _marker(
    frame_id: str,
    change: ShownChange,
    number: int,
    kind: int,
    rgba: tuple[float, float, float, float],
) -> Marker:
    marker = Marker(header=Header(frame_id=frame_id), ns=change.name, id=number, type=kind)
    marker.action = Marker.ADD
    marker.pose.orientation.w = 1.0
    marker.color = ColorRGBA(**dict(zip("rgba", rgba, strict=True)))
    return marker


def _point(position: Any) -> Point:
    x, y, z = np.asarray(position, np.float64).tolist()
    return Point(x=x, y=y, z=z)
