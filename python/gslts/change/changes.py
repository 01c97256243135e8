"""One object that is new, gone or somewhere else."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gslts._core import detect as _core
from gslts.types import Bools, Floats

Kind = Literal["addition", "removal", "relocation"]

KINDS: dict[_core.ChangeType, Kind] = {
    _core.ChangeType.ADDITION: "addition",
    _core.ChangeType.REMOVAL: "removal",
    _core.ChangeType.RELOCATION: "relocation",
}


@dataclass(frozen=True, eq=False)
class Change:
    """One object that is new, gone or somewhere else.

    Attributes:
        kind: Of the change.
        confidence: 0 to 1: how likely it is no error.
        point: (3,) where it is to be looked at, in the world, m.
        before, after: What is seen of the object in the map and in the frame; None where it is not,
            and with the strategy "paper".
        masks: [H,W] the same in the image; `Detection.camera` is its camera. None where it is not
            in this image.
    """

    kind: Kind
    confidence: float
    point: Floats
    before: _core.Surface | None
    after: _core.Surface | None
    masks: tuple[Bools | None, Bools | None]

    @property
    def boxes(self) -> tuple[tuple[Floats, Floats] | None, tuple[Floats, Floats] | None]:
        """Lower and upper corners (3,) around what is seen before and after, in the world, m."""
        return _box(self.before), _box(self.after)

    def end(self, side: Literal["before", "after"]) -> Change:
        """The removal or the addition that one end of a relocation is."""
        part, mask = (
            (self.before, self.masks[0]) if side == "before" else (self.after, self.masks[1])
        )
        assert part is not None  # A relocation has both.
        if side == "before":
            return Change("removal", self.confidence, part.point, part, None, (mask, None))
        return Change("addition", self.confidence, part.point, None, part, (None, mask))


def object_changes(
    surfaces: list[_core.Surface], labels: NDArray[np.int32], rule: _core.ObjectRule
) -> tuple[Change, ...]:
    """The changes that explain surfaces of one image, the most certain first.

    Args:
        surfaces: What only one of map and frame shows.
        labels: [H,W] of them.
        rule: Thresholds.

    Raises:
        ValueError: A threshold is out of range.
    """
    return tuple(
        _change(one, (_mask(labels, one.before), _mask(labels, one.after)))
        for one in _core.classify_changes(surfaces, rule)
    )


def joined(removal: Change, addition: Change, rule: _core.ObjectRule) -> Change | None:
    """The relocation that a removal and an addition are, if they are; they may be of two images."""
    if removal.before is None or addition.after is None:
        return None
    found = _core.classify_changes([removal.before, addition.after], rule)
    if len(found) != 1 or found[0].type != _core.ChangeType.RELOCATION:
        return None
    return _change(found[0], (removal.masks[0], addition.masks[1]))


def paper_change(found: _core.GsLtsChange, labels: NDArray[np.int32]) -> Change:
    """The change that the rule of GS-LTS tells, of components with labels [H,W]."""
    first = labels == found.first.label
    second = None if found.second is None else labels == found.second.label
    both = first if second is None else first | second
    kind = KINDS[found.type]
    return Change(
        kind=kind,
        confidence=1.0,
        point=found.point_in_world,
        before=None,
        after=None,
        masks=(None if kind == "addition" else both, None if kind == "removal" else both),
    )


def _change(one: _core.ObjectChange, masks: tuple[Bools | None, Bools | None]) -> Change:
    shown = one.after if one.after is not None else one.before
    assert shown is not None  # Each change has one of them.
    return Change(
        kind=KINDS[one.type],
        confidence=one.confidence,
        point=shown.point,
        before=one.before,
        after=one.after,
        masks=masks,
    )


def _box(surface: _core.Surface | None) -> tuple[Floats, Floats] | None:
    return None if surface is None else (surface.low, surface.high)


def _mask(labels: NDArray[np.int32], surface: _core.Surface | None) -> Bools | None:
    return None if surface is None else labels == surface.label
