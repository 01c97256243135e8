"""What is known of versions, in words."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from gslts.store.records import Event, Rejection, Version


def words_of_version(version: Version) -> str:
    """Why it is, and how large."""
    what = {
        "base": f"made of {version.cause.get('dataset')}",
        "update": f"{version.touched} Gaussians touched",
        "restore": f"version {version.parent} again",
        "semantics": f"with semantics of {version.cause.get('source')}",
    }[version.kind]
    return f"{version.gaussians} Gaussians, {what}"


def words_of_event(event: Event) -> str:
    """What became of an object, and where."""
    before, after = (_middle(box) for box in event.boxes)
    way = {
        "addition": f"came to {after}",
        "removal": f"gone from {before}",
        "relocation": f"from {before} to {after}",
    }[event.kind]
    return f"{event.type} {way}"


def words_of_rejection(rejection: Rejection) -> str:
    """Why the map stayed as it was."""
    record = rejection.cause.get("record")
    return f"not updated: {record.get('rejected') if isinstance(record, dict) else None}"


def words_of_time(time_s: float) -> str:
    """In the time zone of this machine."""
    return datetime.fromtimestamp(time_s).astimezone().isoformat(" ", "seconds")


def _middle(box: Any) -> str:
    if box is None:
        return "nowhere"
    x, y, z = ((low + high) / 2 for low, high in zip(*box, strict=True))
    return f"({x:.2f}, {y:.2f}, {z:.2f}) m"
