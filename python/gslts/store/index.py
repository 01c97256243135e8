"""The index of a map's versions: one SQLite file."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from math import isfinite
from pathlib import Path
from typing import Any, TypeVar, get_args

from gslts.io.atomic_files import naming
from gslts.store.records import Blob, ChangeKind, Event, Kind, Rejection, Version

SCHEMA = 1
APPLICATION_ID = 0x67736C74
"""`gslt`, which SQLite keeps in the header of the file."""
BUSY_S = 10.0
"""A reader waits so long for a writer that is about to commit."""
CANNOT_WRITE = (sqlite3.SQLITE_CANTOPEN, sqlite3.SQLITE_IOERR, sqlite3.SQLITE_READONLY)
"""What SQLite says where it cannot write: a full, a broken and a forbidden disk."""
LAST_S = 253_402_300_800
"""The end of the year 9999, as far as clocks are told in words."""

ELSEWHERE = "copy the map to a folder that can be written, or ask for permission"
HINTS = {
    sqlite3.SQLITE_IOERR: "; the disk is full or broken",
    sqlite3.SQLITE_READONLY: f"; {ELSEWHERE}",
}

Found = TypeVar("Found")

TABLES = """
CREATE TABLE versions (
    number INTEGER PRIMARY KEY,
    parent INTEGER REFERENCES versions (number),
    kind TEXT NOT NULL,
    time_s REAL NOT NULL,
    gaussians INTEGER NOT NULL,
    next_id INTEGER NOT NULL,
    delta TEXT,
    delta_bytes INTEGER,
    touched INTEGER NOT NULL,
    cause TEXT NOT NULL
) STRICT;
CREATE TABLE snapshots (
    version INTEGER PRIMARY KEY REFERENCES versions (number),
    key TEXT NOT NULL,
    bytes INTEGER NOT NULL
) STRICT;
CREATE TABLE rejections (
    version INTEGER NOT NULL REFERENCES versions (number),
    time_s REAL NOT NULL,
    cause TEXT NOT NULL
) STRICT;
CREATE TABLE events (
    version INTEGER NOT NULL REFERENCES versions (number),
    kind TEXT NOT NULL,
    type TEXT NOT NULL,
    boxes TEXT NOT NULL
) STRICT;
CREATE INDEX events_of_type ON events (type, version);
"""


class Index:
    """The versions, as one writer and any number of readers see them.

    Args:
        path: Of the SQLite file.
        writable: Whether versions may be added; the caller makes sure that one writer does.
        new: Whether to make the file.

    Raises:
        OSError: It cannot be opened.
        ValueError: It is no index, or one of a newer gslts.
    """

    def __init__(self, path: Path, *, writable: bool = False, new: bool = False) -> None:
        self._path = path
        if new == path.exists():
            raise (
                FileExistsError(f"{path} is there already")
                if new
                else FileNotFoundError(f"{path}: there is no such file")
            )
        with self._told():
            self._connection = self._opened(writable=writable, new=new)
        try:
            if new:
                with self._told():
                    self._make()
            self._check()
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Gives the file free."""
        self._connection.close()

    def versions(self) -> list[Version]:
        """All, the first one first."""
        return self._rows("SELECT * FROM versions ORDER BY number", _version)

    def version(self, number: int) -> Version:
        """One of them.

        Raises:
            ValueError: There is no such version.
        """
        found = self._rows("SELECT * FROM versions WHERE number = ?", _version, (number,))
        if not found:
            raise ValueError(f"{self._path.parent}: there is no version {number}")
        return found[0]

    def way(self, number: int) -> list[int]:
        """Numbers of a version and of those that it was made of, its own first."""
        query = """
            WITH RECURSIVE way (number, parent) AS (
                SELECT number, parent FROM versions WHERE number = ?
                UNION ALL
                SELECT versions.number, versions.parent FROM versions JOIN way
                ON versions.number = way.parent AND versions.number < way.number
            ) SELECT number FROM way ORDER BY number DESC"""
        return self._rows(query, lambda row: int(row["number"]), (number,))

    def newest(self) -> Version:
        """The last one.

        Raises:
            ValueError: There is none.
        """
        found = self._rows("SELECT * FROM versions ORDER BY number DESC LIMIT 1", _version)
        if not found:
            raise ValueError(f"{self._path.parent}: there is no version in it")
        return found[0]

    def snapshots(self) -> dict[int, Blob]:
        """Those of versions that were written as a whole."""
        return dict(
            self._rows(
                "SELECT * FROM snapshots",
                lambda row: (row["version"], _blob(row["key"], row["bytes"])),
            )
        )

    def rejections(self) -> list[Rejection]:
        """Updates that were tried and changed nothing, the first one first."""
        return self._rows(
            "SELECT * FROM rejections ORDER BY rowid",
            lambda row: Rejection(row["version"], _time_s(row), _cause(row)),
        )

    def add_rejection(self, rejection: Rejection) -> None:
        """Notes that an update changed nothing.

        Raises:
            OSError: It cannot be written.
        """
        with self._transaction() as connection:
            connection.execute(
                "INSERT INTO rejections VALUES (?, ?, ?)",
                (rejection.version, rejection.time_s, json.dumps(rejection.cause)),
            )

    def events(self, object_type: str | None = None) -> list[Event]:
        """What became of objects, of one type or of all, the first one first."""
        of_type, given = "", tuple[str, ...]()
        if object_type is not None:
            of_type, given = "WHERE type = ? COLLATE NOCASE", (object_type,)
        query = f"SELECT * FROM events {of_type} ORDER BY version, rowid"
        return self._rows(query, _event, given)

    def add(
        self, version: Version, snapshot: Blob | None = None, events: Sequence[Event] = ()
    ) -> None:
        """Adds a version; it is there for good when this returns, or not at all.

        Raises:
            OSError: It cannot be written.
        """
        delta = version.delta
        with self._transaction() as connection:
            connection.execute(
                "INSERT INTO versions VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
                (
                    version.number,
                    version.parent,
                    version.kind,
                    version.time_s,
                    version.gaussians,
                    version.next_id,
                    None if delta is None else delta.key,
                    None if delta is None else delta.size,
                    version.touched,
                    json.dumps(version.cause),
                ),
            )
            if snapshot is not None:
                self._add_snapshot(version.number, snapshot)
            connection.executemany(
                "INSERT INTO events VALUES (?, ?, ?, ?)",
                [(one.version, one.kind, one.type, json.dumps(one.boxes)) for one in events],
            )

    def add_snapshot(self, number: int, snapshot: Blob) -> None:
        """Notes that a version was written as a whole.

        Raises:
            OSError: It cannot be written.
        """
        with self._transaction():
            self._add_snapshot(number, snapshot)

    def forget_before(self, number: int) -> None:
        """Forgets which files the versions before one are made of.

        Raises:
            OSError: It cannot be written.
        """
        with self._transaction() as connection:
            connection.execute("DELETE FROM snapshots WHERE version < ?", (number,))
            connection.execute(
                "UPDATE versions SET delta = NULL, delta_bytes = NULL WHERE number < ?", (number,)
            )

    def require_whole(self) -> None:
        """Makes sure that the file itself is not damaged.

        Raises:
            ValueError: It is.
        """
        with self._told():
            found = self._connection.execute("PRAGMA integrity_check").fetchone()[0]
        if found != "ok":
            raise self._damaged(found)

    def _rows(
        self, query: str, of: Callable[[sqlite3.Row], Found], given: tuple[Any, ...] = ()
    ) -> list[Found]:
        """What rows tell, each on its own."""
        with self._told():
            rows = self._connection.execute(query, given).fetchall()
        try:
            return [of(row) for row in rows]
        except (IndexError, TypeError, ValueError, RecursionError) as error:
            raise self._damaged(error) from error

    def _damaged(self, why: object) -> ValueError:
        return ValueError(f"{self._path}: it is damaged: {why}; copy the map from a backup")

    def _add_snapshot(self, number: int, snapshot: Blob) -> None:
        self._connection.execute(
            "INSERT INTO snapshots VALUES (?, ?, ?)", (number, snapshot.key, snapshot.size)
        )

    def _opened(self, *, writable: bool, new: bool) -> sqlite3.Connection:
        if writable or new:
            return self._connect("mode=rwc" if new else "mode=rw")
        try:
            connection = self._connect("mode=rw")
        except sqlite3.OperationalError as error:
            if _primary(error) not in CANNOT_WRITE:
                raise
            # SQLite puts files beside this one even to read, which a full or read-only disk does
            # not allow. There it may be read alone, unless its log holds versions that it does not.
            log = self._path.with_name(f"{self._path.name}-wal")
            if log.exists() and log.stat().st_size > 0:
                raise OSError(
                    f"{log}: it cannot be read here; copy the map to a folder that can be written"
                ) from error
            return self._connect("mode=ro&immutable=1")
        connection.execute("PRAGMA query_only = ON")
        return connection

    def _connect(self, mode: str) -> sqlite3.Connection:
        connection = sqlite3.connect(
            f"{self._path.absolute().as_uri()}?{mode}",
            uri=True,
            timeout=BUSY_S,
            isolation_level=None,
        )
        connection.row_factory = sqlite3.Row
        try:
            connection.execute("PRAGMA foreign_keys = ON")
            # With FULL, a commit is on the disk when it returns.
            connection.execute("PRAGMA synchronous = FULL")
            connection.execute("PRAGMA schema_version")  # Opens the files.
        except BaseException:
            connection.close()
            raise
        return connection

    def _make(self) -> None:
        self._connection.execute("PRAGMA journal_mode = WAL")
        self._connection.execute(f"PRAGMA application_id = {APPLICATION_ID}")
        with self._transaction() as connection:
            for statement in TABLES.split(";"):
                connection.execute(statement)
            connection.execute(f"PRAGMA user_version = {SCHEMA}")

    def _check(self) -> None:
        with self._told():
            application = self._connection.execute("PRAGMA application_id").fetchone()[0]
            schema = self._connection.execute("PRAGMA user_version").fetchone()[0]
        if application != APPLICATION_ID:
            raise ValueError(f"{self._path}: it is not the index of a map")
        if schema != SCHEMA:
            raise ValueError(
                f"{self._path}: its schema is version {schema}, this gslts reads {SCHEMA}; "
                "a newer gslts made it: install that one"
            )

    @contextmanager
    def _transaction(self) -> Iterator[sqlite3.Connection]:
        with self._told():
            self._connection.execute("BEGIN IMMEDIATE")
            try:
                yield self._connection
                self._connection.execute("COMMIT")
            except BaseException:
                if self._connection.in_transaction:
                    self._connection.execute("ROLLBACK")
                raise

    @contextmanager
    def _told(self) -> Iterator[None]:
        """Tells errors of SQLite as those of files."""
        try:
            with naming(self._path):
                yield
        except UnicodeDecodeError as error:  # Of what SQLite has to say of a damaged name.
            raise self._damaged(error) from error
        except sqlite3.DatabaseError as error:
            # What Python itself raises, of text that is none, has no code.
            if isinstance(error, sqlite3.OperationalError) and _primary(error):
                hint = HINTS.get(_primary(error), "")
                raise OSError(f"{self._path}: {error}{hint}") from error
            raise self._damaged(error) from error


def _primary(error: sqlite3.Error) -> int:
    """Its code, without what SQLite adds to tell more; 0 if it has none."""
    return getattr(error, "sqlite_errorcode", 0) & 0xFF


def _version(row: sqlite3.Row) -> Version:
    number, parent = row["number"], row["parent"]
    if parent is not None and parent >= number:
        raise ValueError(f"version {number} is made of version {parent}")
    if row["kind"] not in get_args(Kind):
        raise ValueError(f"version {number} is of no kind")
    return Version(
        number=number,
        parent=parent,
        kind=row["kind"],
        time_s=_time_s(row),
        gaussians=row["gaussians"],
        next_id=row["next_id"],
        delta=None if row["delta"] is None else _blob(row["delta"], row["delta_bytes"]),
        touched=row["touched"],
        cause=_cause(row),
    )


def _event(row: sqlite3.Row) -> Event:
    boxes = json.loads(row["boxes"])
    if row["kind"] not in get_args(ChangeKind) or len(boxes) != 2:
        raise ValueError(f"an event of version {row['version']} is of no kind")
    for box in boxes:
        if box is not None and not _is_box(box):
            raise ValueError(f"a box of version {row['version']} is none")
    return Event(row["version"], row["kind"], row["type"], tuple(boxes))


def _is_box(box: Any) -> bool:
    """Whether it is two corners of three finite numbers each."""
    corners = box if isinstance(box, list) else []
    rows = [one for one in corners if isinstance(one, list) and len(one) == 3]
    numbers = [value for row in rows for value in row]
    return len(corners) == len(rows) == 2 and all(
        isinstance(value, int | float) and isfinite(value) for value in numbers
    )


def _time_s(row: sqlite3.Row) -> float:
    time_s: float = row["time_s"]
    if not 0 <= time_s < LAST_S:
        raise ValueError(f"a time is {time_s} s")
    return time_s


def _cause(row: sqlite3.Row) -> dict[str, Any]:
    cause = json.loads(row["cause"])
    if not isinstance(cause, dict):
        raise TypeError("a cause is no object of JSON")
    return cause


def _blob(key: Any, size: Any) -> Blob:
    if not isinstance(key, str) or not isinstance(size, int):
        raise TypeError("a file has no name")
    return Blob(key, size)
