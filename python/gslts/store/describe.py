"""Text of the version history, for `gslts log` and the HTML page."""

from __future__ import annotations

import math
from collections.abc import Sequence
from datetime import UTC, datetime
from typing import Any

from gslts.store.causes import (
    Box,
    ConsolidationCause,
    ExtensionCause,
    ImportCause,
    MappingCause,
    Motion,
    RestoreCause,
    SemanticsCause,
)
from gslts.store.history import History
from gslts.store.records import ObjectEvent, Rejection, Track, Version
from gslts.store.tracks import object_tracks


def describe_version(version: Version) -> str:
    """Describe the size and the cause of a version.

    Args:
        version: From a history.

    Returns:
        One line.
    """
    match version.cause:
        case MappingCause(dataset=dataset):
            what = f"mapped from {dataset or 'an unknown recording'}"
        case ImportCause(file=file):
            what = f"imported from {file}"
        case ExtensionCause(dataset=dataset, record=record):
            what = f"extended by {record.added} from {dataset}"
        case ConsolidationCause(record=record, since=since):
            what = f"consolidated since version {since}: {record.refined} refined"
        case RestoreCause(version=number):
            what = f"version {number} restored"
        case SemanticsCause(source=source):
            what = f"semantic features from {source}"
        case _:
            what = f"{version.touched} Gaussians changed"
    return f"{version.gaussians} Gaussians, {what}"


def describe_event(event: ObjectEvent, name: str | None = None) -> str:
    """Describe an object change.

    Args:
        event: From a history.
        name: Of the object; None means its type.

    Returns:
        Name of the object, type of the change, and the centres of its boxes, m; of a shift, how far
        and by which angle.
    """
    if event.motion is not None:
        return f"{name or event.type} shifted{_format_motion(event.motion, event.boxes[0])}"
    before, after = (_format_centre(box) for box in event.boxes)
    change = {
        "addition": f"added at {after}",
        "removal": f"removed from {before}",
        "relocation": f"moved from {before} to {after}",
    }[event.kind]
    return f"{name or event.type} {change}"


def describe_versions(store: History) -> dict[int, list[str]]:
    """Describe the object changes of all versions, each change of an object once.

    Args:
        store: History of the map.

    Returns:
        Lines by number of the version. A version that shows only a part of a change has a line with
        the number of the version that tells it.
    """
    versions, events = store.versions(), store.events()
    lines: dict[int, list[str]] = {}
    for newest in reversed(versions):  # Of all versions, or of those that a restore undid.
        if newest.number in lines:
            continue
        numbers = store.lineage_numbers(newest.number)
        lineage = [version for version in versions if version.number in numbers]
        tracks = object_tracks(lineage, events)
        undone = "" if newest is versions[-1] else ", undone since"
        for number in numbers - lines.keys():
            lines[number] = [f"{line}{undone}" for line in _describe_tracks(tracks, number)]
    return lines


def describe_rejection(rejection: Rejection) -> str:
    """Describe a rejected update.

    Args:
        rejection: From a history.

    Returns:
        One line with the reason.
    """
    return f"update rejected: {rejection.cause.reason}"


def format_made(record: Version | Rejection) -> str:
    """Format when a version or a rejection was made, and by which robot.

    Args:
        record: From a history.

    Returns:
        Time and name; a dash stands for the robot of a record of an older gslts.
    """
    return f"{format_time(record.time_s)}  {record.robot or '-'}"


def format_time(time_s: float) -> str:
    """Format a time in the time zone of this machine.

    Args:
        time_s: Seconds since 1970 (UTC).

    Returns:
        ISO 8601, to the second.
    """
    return datetime.fromtimestamp(time_s).astimezone().isoformat(" ", "seconds")


def _describe_tracks(tracks: Sequence[Track], number: int) -> list[str]:
    """Describe what a version shows of all objects."""
    lines = []
    for track in tracks:
        for event in track.events:
            if event.version == number:
                lines.append(describe_event(event, track.name))
            elif number in event.parts:
                lines.append(f"{track.name}: see version {event.version}")
    return lines


def _format_centre(box: Box | None) -> str:
    if box is None:
        return "an unknown position"
    x, y, z = ((low + high) / 2 for low, high in zip(*box, strict=True))
    return f"({x:.2f}, {y:.2f}, {z:.2f}) m"


def _format_motion(motion: Motion, box: Box | None) -> str:
    """Return the horizontal displacement of the centre of a box, and the yaw."""
    yaw_deg = math.degrees(math.atan2(motion[1][0], motion[0][0]))
    turned = f"{abs(yaw_deg):.0f}°"
    if box is None:
        return f" by {turned}"
    centre = [(low + high) / 2 for low, high in zip(*box, strict=True)]
    moved = [
        sum(turn * x for turn, x in zip(row, centre, strict=False)) + row[3] for row in motion[:2]
    ]
    return f" by {100 * math.dist(centre[:2], moved):.0f} cm and {turned}"


def version_facts(history: History, number: int | None) -> dict[str, Any]:
    """Return what other programs may show of a version, as JSON values.

    Args:
        history: Of the map.
        number: Of the version; None means the newest.

    Returns:
        Number, time (ISO 8601, UTC), program, robot and description of the version; `types`, the
        words of its semantic features; and `objects`, of each object that changed its name, and box
        [3,2] or null of the last position, world, m.

    Raises:
        ValueError: There is no such version.
    """
    version = history.version(number)
    causes = [version.cause for version in history.lineage(version.number)]
    types = next((c.names for c in reversed(causes) if isinstance(c, SemanticsCause)), ())
    return {
        "version": version.number,
        "time": datetime.fromtimestamp(version.time_s, UTC).isoformat(),
        "gslts": version.gslts,
        "robot": version.robot,
        "description": describe_version(version),
        "types": types,
        "objects": [
            {"name": track.name, "box": track.events[-1].boxes[1]}
            for track in history.tracks(version.number)
        ],
    }
