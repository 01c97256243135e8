"""Text of the version history, for `gslts log` and the HTML page."""

from __future__ import annotations

from datetime import datetime

from gslts.store.causes import (
    Box,
    ImportCause,
    MappingCause,
    RestoreCause,
    SemanticsCause,
)
from gslts.store.records import ObjectEvent, Rejection, Version


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
        case RestoreCause(version=number):
            what = f"version {number} restored"
        case SemanticsCause(source=source):
            what = f"semantic features from {source}"
        case _:
            what = f"{version.touched} Gaussians changed"
    return f"{version.gaussians} Gaussians, {what}"


def describe_event(event: ObjectEvent) -> str:
    """Describe an object change.

    Args:
        event: From a history.

    Returns:
        Type of the object, type of the change, and the centres of its boxes, m.
    """
    before, after = (_format_centre(box) for box in event.boxes)
    change = {
        "addition": f"added at {after}",
        "removal": f"removed from {before}",
        "relocation": f"moved from {before} to {after}",
    }[event.kind]
    return f"{event.type} {change}"


def describe_rejection(rejection: Rejection) -> str:
    """Describe a rejected update.

    Args:
        rejection: From a history.

    Returns:
        One line with the reason.
    """
    return f"update rejected: {rejection.cause.reason}"


def format_time(time_s: float) -> str:
    """Format a time in the time zone of this machine.

    Args:
        time_s: Seconds since 1970 (UTC).

    Returns:
        ISO 8601, to the second.
    """
    return datetime.fromtimestamp(time_s).astimezone().isoformat(" ", "seconds")


def _format_centre(box: Box | None) -> str:
    if box is None:
        return "an unknown position"
    x, y, z = ((low + high) / 2 for low, high in zip(*box, strict=True))
    return f"({x:.2f}, {y:.2f}, {z:.2f}) m"
