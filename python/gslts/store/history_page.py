"""HTML page of the history of a map, in one self-contained file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path

from gslts.io.atomic_files import write_atomic
from gslts.io.data_urls import data_url
from gslts.io.html_page import bullets, make_page, number, section, table
from gslts.store.causes import UpdateCause, UpdateRecord
from gslts.store.describe import (
    describe_event,
    describe_rejection,
    describe_version,
    describe_versions,
    format_time,
)
from gslts.store.history import History
from gslts.store.manifest import update_image_path
from gslts.store.records import Rejection, Track, Version

_Lines = Mapping[int, Sequence[str]]
"""Object changes in words, by number of the version."""


def write_history(
    path: Path, store: History, title: str | None = None, sections: Sequence[str] = ()
) -> None:
    """Write the page, atomically.

    Args:
        path: Of the page.
        store: History of the map.
        title: Of the page; None means the name of the folder.
        sections: Further sections that come first, from `gslts.io.html_page.section`.

    Raises:
        OSError: The page cannot be written.
        ValueError: The history is damaged.
    """
    write_atomic(path, make_history_page(store, title, sections))


def make_history_page(
    store: History, title: str | None = None, sections: Sequence[str] = ()
) -> bytes:
    """Make the page.

    Args:
        store: History of the map.
        title: Of the page; None means the name of the folder.
        sections: Further sections that come first, from `gslts.io.html_page.section`.

    Returns:
        HTML in UTF-8.

    Raises:
        OSError: The history cannot be read.
        ValueError: The history is damaged.
    """
    versions, rejections, lines = store.versions(), store.rejections(), describe_versions(store)
    updates = [version for version in versions if isinstance(version.cause, UpdateCause)]
    summary = (
        f"{len(versions)} versions: {len(updates)} updates, {len(rejections)} rejected updates; "
        f"{versions[-1].gaussians:,} Gaussians now, {versions[0].gaussians:,} at first"
    )
    parts = [
        *sections,
        section("Versions", _timeline(versions, lines)),
        section("Objects", _objects(store.tracks())),
        section("Rejected updates", bullets([_describe(rejection) for rejection in rejections])),
        section("Before and after", _images(store.folder, updates, lines)),
    ]
    return make_page(title or store.folder.resolve().name, summary, parts)


def _timeline(versions: Sequence[Version], lines: _Lines) -> str:
    head = (
        "version",
        "time",
        "robot",
        "round",
        "changes",
        "Gaussians changed",
        "PSNR, dB",
        "seconds",
    )
    return table(head, [_row(version, lines) for version in versions])


def _row(version: Version, lines: _Lines) -> list[str]:
    cause = version.cause if isinstance(version.cause, UpdateCause) else None
    record = UpdateRecord() if cause is None else cause.record
    psnr = [number(value) for value in (record.psnr_before_db, record.psnr_after_db)]
    return [
        str(version.number),
        format_time(version.time_s),
        version.robot or "",
        "" if cause is None or cause.round is None else str(cause.round),
        _changes(version, lines),
        f"{version.touched:,}",
        " to ".join(psnr) if cause else "",
        ", ".join(f"{stage} {value:.1f}" for stage, value in record.seconds.items()),
    ]


def _changes(version: Version, lines: _Lines) -> str:
    return "; ".join(lines[version.number]) or describe_version(version)


def _objects(tracks: Sequence[Track]) -> str:
    rows = [
        (track.name, str(event.version), describe_event(event, track.name))
        for track in tracks
        for event in track.events
    ]
    return table(("object", "version", "change"), rows)


def _describe(rejection: Rejection) -> str:
    kinds = ", ".join(change.kind for change in rejection.cause.changes)
    when = format_time(rejection.time_s)
    return f"{when}, version {rejection.version}: {kinds} {describe_rejection(rejection)}"


def _images(folder: Path, updates: Sequence[Version], lines: _Lines) -> str:
    parts = []
    for version in updates:
        path = update_image_path(folder, version.number)
        if path.exists():
            title = escape(f"Version {version.number}: {_changes(version, lines)}")
            address = data_url("image/jpeg", path.read_bytes())
            parts.append(f'<h3>{title}</h3>\n<img class=wide alt="{title}" src="{address}">')
    return "\n".join(parts)
