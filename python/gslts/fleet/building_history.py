"""History of the map of a room, in short. Does not import NumPy."""

from __future__ import annotations

from pathlib import Path

from gslts.store.causes import Record
from gslts.store.describe import describe_event
from gslts.store.history import open_history
from gslts.store.records import Rejection, Version


class RoomChange(Record):
    """An object change.

    Attributes:
        name: Of the object, as in `gslts log`.
        text: Name, type of the change, and positions in the frame of the map.
        version: First version that shows it.
        time_s: Time of that version, s since 1970 (UTC), by the clock of its machine.
        robot: Name of the robot that saw it; None if unknown.
    """

    name: str
    text: str
    version: int
    time_s: float
    robot: str | None


class RoomHistory(Record):
    """State of a map, and its newest changes.

    Attributes:
        version: Number of the newest version.
        gaussians: Number of its Gaussians.
        changed_s: Time of the newest version, s since 1970 (UTC).
        observed_s: Time of the newest version or of the newest rejected update, if that is later.
        robots: Names of robots that made versions or rejected updates, the last one first.
        changes: Object changes that the newest version shows, newest first.
    """

    version: int
    gaussians: int
    changed_s: float
    observed_s: float
    robots: tuple[str, ...]
    changes: tuple[RoomChange, ...]


def read_room_history(path: Path, since_s: float) -> RoomHistory:
    """Read the history of the map of a room.

    Args:
        path: Folder of the map.
        since_s: Time of the oldest change to list, s since 1970 (UTC).

    Returns:
        The history.

    Raises:
        OSError: The folder cannot be read.
        ValueError: The path is no folder of a map, or a file is damaged.
    """
    with open_history(path) as store:
        versions, rejections = store.versions(), store.rejections()
        tracks = store.tracks(versions[-1].number)  # Another command may add versions meanwhile.
    records: list[Version | Rejection] = [*versions, *rejections]
    records.sort(key=lambda record: -record.time_s)
    made = {version.number: version for version in versions}
    changes = [
        RoomChange(
            name=track.name,
            text=describe_event(event, track.name),
            version=event.version,
            time_s=made[event.version].time_s,
            robot=made[event.version].robot,
        )
        for track in tracks
        for event in track.events
        if made[event.version].time_s >= since_s
    ]
    return RoomHistory(
        version=versions[-1].number,
        gaussians=versions[-1].gaussians,
        changed_s=versions[-1].time_s,
        observed_s=records[0].time_s,
        robots=tuple(dict.fromkeys(record.robot for record in records if record.robot)),
        changes=tuple(sorted(changes, key=lambda change: -change.time_s)),
    )
