"""A change of the home: one object that was added, removed, moved or shifted."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np

from gslts._core.detect import Surface
from gslts.core.boxes import box_iou
from gslts.semantics.masks import PixelBox, box_of_mask
from gslts.types import Bools, Floats

Kind = Literal["addition", "removal", "relocation", "shift"]
Side = Literal["before", "after"]
Box = tuple[Floats, Floats]
"""Lower and upper corner (3,), world, m."""

SIDES: tuple[Side, Side] = ("before", "after")
"""Order of the pairs in a `Change`."""
RIGID_TOLERANCE = 1e-6
"""Maximum error of the products of the columns of a rotation."""


@dataclass(frozen=True, eq=False)
class Change:
    """Added, removed, moved or shifted object.

    A shift is a small rigid motion of something that stays where it is, such as a chair that was
    pushed by some centimetres, with all that stands on it.

    A plain value: any detector can construct one for `ChangeMonitor` and `gslts.update`. Pairs
    hold the value before and after the change; an addition has no value before, a removal none
    after.

    Args:
        kind: "addition", "removal", "relocation" or "shift".
        confidence: Probability that the change is real, 0 to 1.
        point: (3,) position to look at, world, m.
        boxes: Axis-aligned boxes around the object, (low, high) of (3,) each, world, m; None if
            unknown. Updates need the boxes of the sides that changed.
        masks: [H,W] pixels of the object in one image; None if it is not visible there.
        before: Surface in the map, which lets ends of two frames be matched; None if unknown.
        after: Surface in the frame, likewise.
        motion: (4,4) rigid transform of a shift in the world, m: x_after = motion @ x_before; None
            for other kinds.
        is_measured: False if positions after the change come from the depth of the map, as the
            frame has none: the object is there or in front of it.

    Raises:
        ValueError: A value is out of range, or does not fit the kind.
    """

    kind: Kind
    confidence: float
    point: Floats
    boxes: tuple[Box | None, Box | None] = (None, None)
    masks: tuple[Bools | None, Bools | None] = (None, None)
    before: Surface | None = None
    after: Surface | None = None
    motion: Floats | None = None
    is_measured: bool = True

    def __post_init__(self) -> None:
        if self.kind not in get_args(Kind):
            known = ", ".join(get_args(Kind))
            raise ValueError(f"Change: kind must be one of {known}, got {self.kind!r}")
        if not 0 <= self.confidence <= 1:
            raise ValueError(f"Change: confidence must be in [0, 1], got {self.confidence}")
        _require_position("point", self.point)
        for side, box in zip(SIDES, self.boxes, strict=True):
            if box is not None:
                _require_box(f"boxes: {side}", box)
        _require_motion(self.kind, self.motion)
        absent = {"addition": 0, "removal": 1}.get(self.kind)
        if absent is None:
            return
        for name, pair in (
            ("boxes", self.boxes),
            ("masks", self.masks),
            ("surfaces", (self.before, self.after)),
        ):
            if pair[absent] is not None:
                raise ValueError(
                    f"Change: {name}: {self.kind} has nothing {SIDES[absent]} the change; "
                    "expected None"
                )

    def end_point(self, side: Side) -> Floats | None:
        """Return (3,) the position of the object at one side, world, m; None if unknown.

        Args:
            side: "before" or "after".
        """
        surface = self.before if side == "before" else self.after
        if surface is not None:
            return surface.point
        box = self.boxes[SIDES.index(side)]
        return None if box is None else (box[0] + box[1]) / 2

    def box_iou(self, other: Change) -> float:
        """Return the intersection over union of the boxes of two changes; the larger of both sides.

        Args:
            other: The other change.

        Returns:
            0 to 1; 0 if the boxes are unknown.
        """
        sides = zip(self.boxes, other.boxes, strict=True)
        known = [(a, b) for a, b in sides if a is not None and b is not None]
        return max((box_iou(a, b) for a, b in known), default=0.0)

    def box_px(self, side: Side, width: int) -> PixelBox | None:
        """Return the box around the object in the image; None if it is not visible at that side.

        Args:
            side: "before" or "after".
            width: Width of the frame, px; masks may be of a halved image.

        Returns:
            (x0, y0, x1, y1) in the pixels of the frame, x1 and y1 exclusive.
        """
        mask = self.masks[SIDES.index(side)]
        return None if mask is None else box_of_mask(mask, width)

    def end(self, side: Side) -> Change:
        """Return the removal or the addition that is one end of a relocation or a shift.

        Args:
            side: "before" for the removal, "after" for the addition.

        Raises:
            ValueError: The position at that side is unknown.
        """
        point, row = self.end_point(side), SIDES.index(side)
        if point is None:
            raise ValueError(f"Change.end: the {self.kind} has no box {side} the change")
        box, mask = self.boxes[row], self.masks[row]
        if side == "before":
            return Change(
                "removal", self.confidence, point, (box, None), (mask, None), before=self.before
            )
        return Change(
            "addition",
            self.confidence,
            point,
            (None, box),
            (None, mask),
            after=self.after,
            is_measured=self.is_measured,
        )


def _require_position(name: str, value: Any) -> None:
    if np.shape(value) != (3,) or not np.isfinite(value).all():
        raise ValueError(f"Change: {name}: expected three finite numbers, got {value}")


def _require_box(name: str, box: Any) -> None:
    if len(box) != 2:
        raise ValueError(f"Change: {name}: expected (low, high), got {len(box)} corners")
    for corner in box:
        _require_position(name, corner)
    if (np.asarray(box[0]) > np.asarray(box[1])).any():
        raise ValueError(f"Change: {name}: low must not exceed high, got {box}")


def _require_motion(kind: Kind, motion: Any) -> None:
    if (motion is not None) != (kind == "shift"):
        raise ValueError(f"Change: motion: a shift needs one, other kinds have none, got {kind}")
    if motion is None:
        return
    if np.shape(motion) != (4, 4) or not np.isfinite(motion).all():
        raise ValueError("Change: motion: expected [4,4] finite numbers")
    rotation = np.asarray(motion)[:3, :3]
    if not (
        np.allclose(rotation @ rotation.T, np.eye(3), atol=RIGID_TOLERANCE)
        and np.linalg.det(rotation) > 0
        and np.allclose(np.asarray(motion)[3], (0, 0, 0, 1), atol=RIGID_TOLERANCE)
    ):
        raise ValueError("Change: motion: expected a rigid transform")
