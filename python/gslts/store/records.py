"""Records of the version history of a map. They do not import NumPy."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Self

from pydantic import Field, model_validator

from gslts.store.causes import (
    Box,
    ChangeKind,
    Count,
    Motion,
    Number,
    Record,
    RejectedUpdateCause,
    Sha256,
    VersionCause,
    require_motion,
)
from gslts.store.robot_name import NAME

UNKNOWN = "object"
"""Type of an object that nothing names."""


RobotName = Annotated[str, Field(pattern=f"^{NAME}$")]
# Before the end of the year 9999: `datetime` formats no later time.
Time = Annotated[float, Field(ge=0, lt=253_402_300_800)]


class Blob(Record):
    """A file of arrays.

    Attributes:
        key: SHA-256 of the content.
        size: Length of the content, bytes.
    """

    key: Sha256
    size: Count


class Snapshot(Blob):
    """A file of all Gaussians of a version.

    Attributes:
        head: SHA-256 of its head, with which parts of it are read; None for files of an older
            gslts, which are read as a whole.
    """

    head: Sha256 | None = None


class Version(Record):
    """A version of a map.

    Attributes:
        number: Counted from 1.
        parent: Version that `delta` applies to; None if the version is stored as a snapshot only.
        gslts: Version of the program that wrote it.
        time_s: Time of the commit, s since 1970 (UTC), by the clock of that machine.
        gaussians: Number of Gaussians.
        next_id: Greater than the id of every Gaussian of this version and of those before it.
        delta: File of the changes since the parent; None if there is none.
        touched: Number of Gaussians that were removed, added or changed.
        cause: Why the version exists.
        robot: Name of the robot that made it; None if unknown.
    """

    number: Number
    parent: Number | None
    gslts: str
    time_s: Time
    gaussians: Count
    next_id: Count
    delta: Blob | None
    touched: Count
    cause: VersionCause
    robot: RobotName | None = None

    @property
    def kind(self) -> str:
        """Kind of the cause, such as "update"."""
        return self.cause.kind

    @model_validator(mode="after")
    def _follows_parent(self) -> Self:
        if self.parent is not None and self.parent >= self.number:
            raise ValueError(f"parent: version {self.number} is made from version {self.parent}")
        return self


class Rejection(Record):
    """An update that was tried and left the map unchanged.

    Attributes:
        version: Version that the map kept.
        gslts: Version of the program that wrote it.
        time_s: Time, s since 1970 (UTC), by the clock of that machine.
        cause: The attempt and the reason.
        robot: Name of the robot that tried it; None if unknown.
    """

    version: Number
    gslts: str
    time_s: Time
    cause: RejectedUpdateCause
    robot: RobotName | None = None


class ObjectEvent(Record):
    """An object change that a version shows.

    Attributes:
        kind: Type of the change.
        type: Type of the object such as "Mug"; "object" if unknown.
        boxes: Box of the object before and after the change; None where there is no object.
        motion: Motion of a shift; None for other kinds.
    """

    kind: ChangeKind
    type: str
    boxes: tuple[Box | None, Box | None]
    motion: Motion | None = None

    @model_validator(mode="after")
    def _motion_fits_kind(self) -> Self:
        require_motion(self.kind, self.motion)
        return self


class Event(ObjectEvent):
    """An object change in the history of a map.

    Attributes:
        version: First version that shows the change.
    """

    version: Number


@dataclass(frozen=True)
class Updates:
    """Traces of the updates of a map.

    Attributes:
        added_ids: Ids of the Gaussians that each update added, such as those of objects that came;
            oldest first. Extensions and consolidations are no updates.
        left: Boxes in which objects were that left or moved: low and high corners, world, m.
        came: Boxes to which objects came or moved.
    """

    added_ids: Sequence[range] = ()
    left: Sequence[Any] = ()
    came: Sequence[Any] = ()

    @classmethod
    def of_boxes(cls, boxes: Iterable[tuple[Any, Any]], added_ids: Sequence[range] = ()) -> Updates:
        """Take the boxes of changes of objects.

        Args:
            boxes: Before and after each change: corners, world, m; None where no object is.
            added_ids: Ids of the Gaussians that each update added.
        """
        pairs = list(boxes)
        left, came = ([pair[side] for pair in pairs if pair[side] is not None] for side in (0, 1))
        return cls(added_ids, left, came)

    def then(self, later: Updates) -> Updates:
        """Return these updates and later ones.

        Args:
            later: Of the same map.
        """
        return Updates(
            [*self.added_ids, *later.added_ids],
            [*self.left, *later.left],
            [*self.came, *later.came],
        )


NO_UPDATES = Updates()
"""Of a map that no update changed."""


class TrackEvent(Event):
    """A change of one object, put together from what several versions may show.

    Attributes:
        version: Version that tells it: of a move whose ends were found in two, the later one.
        parts: All versions that show a part of it, or show it again, oldest first.
    """

    parts: tuple[Number, ...]


class Track(Record):
    """History of one object.

    Attributes:
        name: Its type, with a number for all but the first object of this type.
        events: What happened to it, oldest first.
    """

    name: str
    events: tuple[TrackEvent, ...]
