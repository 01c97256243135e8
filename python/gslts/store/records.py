"""What the past of a map is made of."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

Kind = Literal["base", "update", "restore", "semantics"]
ChangeKind = Literal["addition", "removal", "relocation"]


@dataclass(frozen=True)
class Blob:
    """A file of arrays.

    Attributes:
        key: Its SHA-256.
        size: Its bytes.
    """

    key: str
    size: int


@dataclass(frozen=True)
class Version:
    """A map as it was from some time on.

    Attributes:
        number: From 1 on.
        parent: The version that `delta` leads from; None where there is a snapshot alone.
        kind: How it came about.
        time_s: When it was committed, s since 1970 (UTC), by the clock of then.
        gaussians: How many it has.
        next_id: No Gaussian of this version or one before has such an id or a higher one.
        delta: What leads from its parent; None where nothing does, or it is the same.
        touched: How many Gaussians were removed, added and changed.
        cause: Why it is, in values of JSON.
    """

    number: int
    parent: int | None
    kind: Kind
    time_s: float
    gaussians: int
    next_id: int
    delta: Blob | None
    touched: int
    cause: dict[str, Any]


@dataclass(frozen=True)
class Rejection:
    """Why a map stayed as it was.

    Attributes:
        version: That it stayed.
        time_s: When, s since 1970 (UTC), by the clock of then.
        cause: What was tried, in values of JSON.
    """

    version: int
    time_s: float
    cause: dict[str, Any]


@dataclass(frozen=True)
class Event:
    """What became of an object.

    Attributes:
        version: Of the map that knows of it.
        kind: What became of it.
        type: Such as "Mug"; "object" where it is not known.
        boxes: Around it before and after, lower and upper corner [2,3] in the world, m; None where
            it is not there.
    """

    version: int
    kind: ChangeKind
    type: str
    boxes: tuple[Any, Any]
