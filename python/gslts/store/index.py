"""Index of the versions of a map: typed reading and writing of the tables."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

from pydantic import ValidationError

from gslts.io.messages import first_problem
from gslts.store.causes import rejected_cause_from_json, version_cause_from_json
from gslts.store.index_file import IndexFile
from gslts.store.records import Blob, Event, ObjectEvent, Rejection, Snapshot, Version

Parsed = TypeVar("Parsed")


class Index(IndexFile):
    """Versions, snapshots, rejected updates and object changes, for one writer and any readers."""

    def versions(self) -> list[Version]:
        """Return all versions, oldest first."""
        return self._read("SELECT * FROM versions ORDER BY number", _version)

    def version(self, number: int) -> Version:
        """Return a version.

        Args:
            number: Counted from 1.

        Raises:
            ValueError: There is no such version.
        """
        found = self._read("SELECT * FROM versions WHERE number = ?", _version, (number,))
        if not found:
            raise ValueError(f"{self.path.parent}: there is no version {number}")
        return found[0]

    def newest(self) -> Version:
        """Return the newest version.

        Raises:
            ValueError: There is none.
        """
        found = self._read("SELECT * FROM versions ORDER BY number DESC LIMIT 1", _version)
        if not found:
            raise ValueError(f"{self.path.parent}: the map has no version")
        return found[0]

    def lineage(self, number: int) -> list[int]:
        """Return the numbers of a version and of all versions it was made from.

        Args:
            number: Of the version.

        Returns:
            Newest first; `number` itself is the first.
        """
        query = """
            WITH RECURSIVE lineage (number, parent) AS (
                SELECT number, parent FROM versions WHERE number = ?
                UNION ALL
                SELECT versions.number, versions.parent FROM versions JOIN lineage
                ON versions.number = lineage.parent AND versions.number < lineage.number
            ) SELECT number FROM lineage ORDER BY number DESC"""
        return self._read(query, lambda row: int(row["number"]), (number,))

    def update_ids(self, number: int) -> list[range]:
        """Return the ids of Gaussians that the updates in the lineage of a version added.

        Args:
            number: Of the version.

        Returns:
            Ids of each update, oldest first. Causes are not parsed, which would take most time.
        """
        query = """
            WITH RECURSIVE lineage (number, parent, next_id, cause) AS (
                SELECT number, parent, next_id, cause FROM versions WHERE number = ?
                UNION ALL
                SELECT versions.number, versions.parent, versions.next_id, versions.cause
                FROM versions JOIN lineage
                ON versions.number = lineage.parent AND versions.number < lineage.number
            ) SELECT before.next_id AS start, lineage.next_id AS stop
            FROM lineage JOIN versions AS before ON before.number = lineage.parent
            WHERE json_extract(lineage.cause, '$.kind') = 'update' ORDER BY lineage.number"""
        return self._read(query, lambda row: range(row["start"], row["stop"]), (number,))

    def snapshots(self) -> dict[int, Snapshot]:
        """Return the files of versions that were stored as a whole, by number."""
        rows = self._read("SELECT * FROM snapshots", _snapshot)
        return dict(rows)

    def rejections(self) -> list[Rejection]:
        """Return the rejected updates, oldest first."""
        return self._read("SELECT * FROM rejections ORDER BY rowid", _rejection)

    def events(self) -> list[Event]:
        """Return the object changes, oldest first."""
        return self._read("SELECT * FROM events ORDER BY version, rowid", _event)

    def add(
        self, version: Version, snapshot: Snapshot | None = None, events: Sequence[ObjectEvent] = ()
    ) -> None:
        """Add a version in one transaction.

        Args:
            version: The new version.
            snapshot: File of all its Gaussians, if there is one.
            events: Object changes that it shows.

        Raises:
            OSError: The file cannot be written.
        """
        delta, number = version.delta, version.number
        row = (
            number,
            version.parent,
            version.gslts,
            version.time_s,
            version.gaussians,
            version.next_id,
            None if delta is None else delta.key,
            None if delta is None else delta.size,
            version.touched,
            version.cause.model_dump_json(),
            version.robot,
        )
        with self.transaction() as connection:
            connection.execute(f"INSERT INTO versions VALUES ({', '.join('?' * len(row))})", row)
            if snapshot is not None:
                _insert_snapshot(connection, number, snapshot)
            connection.executemany(
                "INSERT INTO events VALUES (?, ?, ?, ?, ?)",
                [(number, *_event_columns(event)) for event in events],
            )

    def add_snapshot(self, number: int, snapshot: Snapshot) -> None:
        """Add the snapshot of an existing version.

        Args:
            number: Of the version.
            snapshot: File of all its Gaussians.

        Raises:
            OSError: The file cannot be written.
        """
        with self.transaction() as connection:
            _insert_snapshot(connection, number, snapshot)

    def add_rejection(self, rejection: Rejection) -> None:
        """Add a rejected update.

        Args:
            rejection: The attempt.

        Raises:
            OSError: The file cannot be written.
        """
        row = (
            rejection.version,
            rejection.gslts,
            rejection.time_s,
            rejection.cause.model_dump_json(),
            rejection.robot,
        )
        with self.transaction() as connection:
            connection.execute("INSERT INTO rejections VALUES (?, ?, ?, ?, ?)", row)

    def forget_before(self, number: int) -> None:
        """Forget the files of the versions before a number; their records stay.

        Args:
            number: First version that keeps its files.

        Raises:
            OSError: The file cannot be written.
        """
        with self.transaction() as connection:
            connection.execute("DELETE FROM snapshots WHERE version < ?", (number,))
            connection.execute(
                "UPDATE versions SET delta = NULL, delta_bytes = NULL WHERE number < ?", (number,)
            )

    def remove_after(self, number: int) -> None:
        """Remove the versions after a number, with all that belongs to them.

        Args:
            number: Of the last version that stays.

        Raises:
            OSError: The file cannot be written.
        """
        with self.transaction() as connection:
            for table in ("events", "rejections", "snapshots"):
                connection.execute(f"DELETE FROM {table} WHERE version > ?", (number,))
            connection.execute("DELETE FROM versions WHERE number > ?", (number,))

    def _read(
        self, query: str, parse: Callable[[sqlite3.Row], Parsed], parameters: tuple[Any, ...] = ()
    ) -> list[Parsed]:
        rows = self.rows(query, parameters)
        try:
            return [parse(row) for row in rows]
        except ValidationError as error:
            raise self.damage_error(first_problem(error)) from None
        except (IndexError, TypeError, ValueError, RecursionError) as error:
            raise self.damage_error(error) from error


def _version(row: sqlite3.Row) -> Version:
    number = row["number"]
    try:
        cause = version_cause_from_json(row["cause"])
    except ValueError as error:
        raise ValueError(f"version {number}: {error}") from None
    return Version(
        number=number,
        parent=row["parent"],
        gslts=row["gslts"],
        time_s=row["time_s"],
        gaussians=row["gaussians"],
        next_id=row["next_id"],
        delta=None if row["delta"] is None else Blob(key=row["delta"], size=row["delta_bytes"]),
        touched=row["touched"],
        cause=cause,
        robot=_added_column(row, "robot"),
    )


def _rejection(row: sqlite3.Row) -> Rejection:
    return Rejection(
        version=row["version"],
        gslts=row["gslts"],
        time_s=row["time_s"],
        cause=rejected_cause_from_json(row["cause"]),
        robot=_added_column(row, "robot"),
    )


def _event_columns(event: ObjectEvent) -> tuple[str, str, str, str | None]:
    motion = None if event.motion is None else json.dumps(event.motion)
    return event.kind, event.type, json.dumps(event.boxes), motion


def _event(row: sqlite3.Row) -> Event:
    motion = _added_column(row, "motion")
    return Event(
        version=row["version"],
        kind=row["kind"],
        type=row["type"],
        boxes=json.loads(row["boxes"]),
        motion=None if motion is None else json.loads(motion),
    )


def _added_column(row: sqlite3.Row, name: str) -> str | None:
    """Return a value of `ADDED_COLUMNS`; None in a file of an older schema."""
    return row[name] if name in row.keys() else None  # noqa: SIM118  # A row is not a mapping.


def _snapshot(row: sqlite3.Row) -> tuple[int, Snapshot]:
    head = _added_column(row, "head")
    return row["version"], Snapshot(key=row["key"], size=row["bytes"], head=head)


def _insert_snapshot(connection: sqlite3.Connection, number: int, snapshot: Snapshot) -> None:
    connection.execute(
        "INSERT INTO snapshots VALUES (?, ?, ?, ?)",
        (number, snapshot.key, snapshot.size, snapshot.head),
    )
