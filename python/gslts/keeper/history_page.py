"""The past of a map as one HTML page that needs nothing else."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from html import escape
from pathlib import Path

from gslts.io.html_page import bullets, number, section, table, write_page
from gslts.store.causes import UpdateCause, UpdateRecord
from gslts.store.describe import (
    describe_event,
    describe_rejection,
    describe_version,
    format_time,
)
from gslts.store.history import History
from gslts.store.manifest import update_image_path
from gslts.store.records import Event, Rejection, Version


def write_history(
    path: Path, store: History, title: str | None = None, more: Sequence[str] = ()
) -> None:
    """Writes the page, which is there whole or not at all.

    Args:
        path: Of the page.
        store: Whose past it is.
        title: Of the page; None means the name of the folder.
        more: Sections that come first, from `gslts.io.html_page.section`.

    Raises:
        OSError: It cannot be written.
        ValueError: The index is damaged.
    """
    versions, events, rejections = store.versions(), store.events(), store.rejections()
    updates = [one for one in versions if one.kind == "update"]
    summary = (
        f"{len(versions)} versions: {len(updates)} updates, {len(rejections)} rejected; "
        f"{versions[-1].gaussians:,} Gaussians now, {versions[0].gaussians:,} at first"
    )
    sections = [
        *more,
        section("What happened", _timeline(versions, events)),
        section("What was left as it was", bullets([_rejection(one) for one in rejections])),
        section("Before and after", _pictures(store.folder, updates, events)),
    ]
    write_page(path, title or store.folder.resolve().name, summary, sections)


def _timeline(versions: Sequence[Version], events: Sequence[Event]) -> str:
    head = ("version", "time", "round", "what", "Gaussians touched", "around it, dB", "seconds")
    return table(head, [_row(one, events) for one in versions])


def _row(version: Version, events: Sequence[Event]) -> list[str]:
    cause = version.cause if isinstance(version.cause, UpdateCause) else None
    record = UpdateRecord() if cause is None else cause.record
    psnr = [number(value) for value in (record.psnr_before_db, record.psnr_after_db)]
    seconds = [f"{name} {value:.1f}" for name, value in record.seconds.items()]
    return [
        str(version.number),
        format_time(version.time_s),
        "" if cause is None or cause.round is None else str(cause.round),
        _what(version, events),
        f"{version.touched:,}",
        " to ".join(psnr) if cause else "",
        ", ".join(seconds),
    ]


def _what(version: Version, events: Sequence[Event]) -> str:
    told = [describe_event(one) for one in events if one.version == version.number]
    return "; ".join(told) or describe_version(version)


def _rejection(rejection: Rejection) -> str:
    kinds = ", ".join(change.kind for change in rejection.cause.changes)
    when = format_time(rejection.time_s)
    return f"{when}, version {rejection.version}: {kinds} {describe_rejection(rejection)}"


def _pictures(folder: Path, updates: Sequence[Version], events: Sequence[Event]) -> str:
    parts = []
    for version in updates:
        path = update_image_path(folder, version.number)
        if path.exists():
            title = escape(f"Version {version.number}: {_what(version, events)}")
            address = f"data:image/jpeg;base64,{b64encode(path.read_bytes()).decode()}"
            parts.append(f'<h3>{title}</h3>\n<img class=wide alt="{title}" src="{address}">')
    return "\n".join(parts)
