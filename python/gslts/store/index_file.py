"""SQLite file of the index: opening, transactions, and errors that name the file."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from gslts.io.atomic_files import name_in_errors

SCHEMA, OLDEST_SCHEMA = 7, 2
"""Version of the tables, and the oldest one that is read. Raise the first with every change of
`TABLES` or of a cause. In schema 2, causes have no appearances; in schema 3, there are no shifts;
up to schema 6, appearances have areas, and extensions no measurements; columns were added as
`ADDED_COLUMNS` tells."""
ADDED_COLUMNS = (
    (4, "events", "motion"),
    (5, "versions", "robot"),
    (5, "rejections", "robot"),
    (6, "snapshots", "head"),
)
"""First schema, table and name of each column that older files lack; all are texts or NULL."""
APPLICATION_ID = 0x67736C74
"""`gslt` in ASCII; SQLite keeps it in the header of the file."""
BUSY_S = 10.0
"""Time that a reader waits for a commit of a writer, s. A commit takes milliseconds; half or double
changes nothing unless the disk stalls."""
WRITE_ERRORS = (sqlite3.SQLITE_CANTOPEN, sqlite3.SQLITE_IOERR, sqlite3.SQLITE_READONLY)
"""Codes of SQLite for a full, a broken and a write-protected disk."""

WRITE_ELSEWHERE = "copy the map to a folder that can be written, or ask for permission"
"""Next step where a folder is write-protected."""
HINTS = {
    sqlite3.SQLITE_IOERR: "; the disk is full or broken",
    sqlite3.SQLITE_READONLY: f"; {WRITE_ELSEWHERE}",
}
"""Next step for a code of SQLite."""

TABLES = """
CREATE TABLE versions (
    number INTEGER PRIMARY KEY,
    parent INTEGER REFERENCES versions (number),
    gslts TEXT NOT NULL,
    time_s REAL NOT NULL,
    gaussians INTEGER NOT NULL,
    next_id INTEGER NOT NULL,
    delta TEXT,
    delta_bytes INTEGER,
    touched INTEGER NOT NULL,
    cause TEXT NOT NULL,
    robot TEXT
) STRICT;
CREATE TABLE snapshots (
    version INTEGER PRIMARY KEY REFERENCES versions (number),
    key TEXT NOT NULL,
    bytes INTEGER NOT NULL,
    head TEXT
) STRICT;
CREATE TABLE rejections (
    version INTEGER NOT NULL REFERENCES versions (number),
    gslts TEXT NOT NULL,
    time_s REAL NOT NULL,
    cause TEXT NOT NULL,
    robot TEXT
) STRICT;
CREATE TABLE events (
    version INTEGER NOT NULL REFERENCES versions (number),
    kind TEXT NOT NULL,
    type TEXT NOT NULL,
    boxes TEXT NOT NULL,
    motion TEXT
) STRICT;
"""
"""Schema of the index."""


class IndexFile:
    """Connection to the SQLite file. Errors of SQLite become OSError or ValueError with the path.

    Args:
        path: The SQLite file.
        writable: Allow transactions. The caller makes sure that there is one writer.
        new: Create the file; it must not exist.

    Raises:
        OSError: The file cannot be opened.
        ValueError: The file is no index, or of another schema.
    """

    def __init__(self, path: Path, *, writable: bool = False, new: bool = False) -> None:
        self.path = path
        if new and path.exists():
            raise FileExistsError(f"{path} exists already")
        if not new and not path.exists():
            raise FileNotFoundError(f"{path}: no such file")
        with self._named_errors():
            self._connection = self._open(writable=writable, new=new)
        try:
            if new:
                with self._named_errors():
                    self._create_tables()
            self._check_schema(writable=writable)
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Close the connection."""
        self._connection.close()

    def rows(self, query: str, parameters: tuple[Any, ...] = ()) -> list[sqlite3.Row]:
        """Return all rows of a query.

        Args:
            query: SQL.
            parameters: Values of its placeholders.

        Returns:
            The rows, with access by column name.

        Raises:
            OSError: The file cannot be read.
            ValueError: The file is damaged.
        """
        with self._named_errors():
            return self._connection.execute(query, parameters).fetchall()

    @contextmanager
    def transaction(self) -> Iterator[sqlite3.Connection]:
        """Open a transaction: commit at the end, roll back on an exception.

        Inside of another one, it is a part of that.

        Yields:
            The connection. A commit is on disk when the context ends.

        Raises:
            OSError: The file cannot be written.
        """
        with self._named_errors():
            if self._connection.in_transaction:
                yield self._connection
                return
            self._connection.execute("BEGIN IMMEDIATE")
            try:
                yield self._connection
                self._connection.execute("COMMIT")
            except BaseException:
                if self._connection.in_transaction:
                    self._connection.execute("ROLLBACK")
                raise

    def require_intact(self) -> None:
        """Check the consistency of the whole file.

        Raises:
            OSError: The file cannot be read.
            ValueError: The file is damaged.
        """
        found = self.rows("PRAGMA integrity_check")[0][0]
        if found != "ok":
            raise self.damage_error(found)

    def damage_error(self, reason: object) -> ValueError:
        """Return the error of a damaged file.

        Args:
            reason: What is wrong.

        Returns:
            An error with path, reason and next step.
        """
        return ValueError(f"{self.path}: damaged: {reason}; copy the map from a backup")

    def _open(self, *, writable: bool, new: bool) -> sqlite3.Connection:
        if writable or new:
            return self._connect("mode=rwc" if new else "mode=rw")
        try:
            connection = self._connect("mode=rw")
        except sqlite3.OperationalError as error:
            if _primary_code(error) not in WRITE_ERRORS:
                raise
            # Even a reader of SQLite writes files beside the index, which a full or read-only disk
            # does not allow. The index alone is complete unless its write-ahead log has content.
            log = self.path.with_name(f"{self.path.name}-wal")
            if log.exists() and log.stat().st_size > 0:
                raise OSError(
                    f"{log}: cannot be read here; copy the map to a folder that can be written"
                ) from error
            return self._connect("mode=ro&immutable=1")
        connection.execute("PRAGMA query_only = ON")
        return connection

    def _connect(self, mode: str) -> sqlite3.Connection:
        uri = f"{self.path.absolute().as_uri()}?{mode}"
        connection = sqlite3.connect(uri, uri=True, timeout=BUSY_S, isolation_level=None)
        connection.row_factory = sqlite3.Row
        try:
            connection.execute("PRAGMA foreign_keys = ON")
            # FULL: a commit is on disk when it returns.
            connection.execute("PRAGMA synchronous = FULL")
            connection.execute("PRAGMA schema_version")  # Opens the files.
        except BaseException:
            connection.close()
            raise
        return connection

    def _create_tables(self) -> None:
        self._connection.execute("PRAGMA journal_mode = WAL")
        self._connection.execute(f"PRAGMA application_id = {APPLICATION_ID}")
        with self.transaction() as connection:
            for statement in TABLES.split(";"):
                connection.execute(statement)
            connection.execute(f"PRAGMA user_version = {SCHEMA}")

    def _check_schema(self, *, writable: bool) -> None:
        application = self.rows("PRAGMA application_id")[0][0]
        schema = self.rows("PRAGMA user_version")[0][0]
        if application != APPLICATION_ID:
            raise ValueError(f"{self.path}: not the index of a map")
        if OLDEST_SCHEMA <= schema < SCHEMA:
            if writable:  # An older gslts could not read what is written now.
                with self.transaction() as connection:
                    for since, table, column in ADDED_COLUMNS:
                        if schema < since:
                            connection.execute(f"ALTER TABLE {table} ADD COLUMN {column} TEXT")
                    connection.execute(f"PRAGMA user_version = {SCHEMA}")
        elif schema != SCHEMA:
            step = (
                "a newer gslts wrote it: install that version"
                if schema > SCHEMA
                else "an older gslts wrote it: make the map again with gslts map"
            )
            raise ValueError(
                f"{self.path}: its schema is version {schema}, this gslts reads {SCHEMA}; {step}"
            )

    @contextmanager
    def _named_errors(self) -> Iterator[None]:
        """Raise errors of SQLite as OSError or ValueError that name the file."""
        try:
            with name_in_errors(self.path):
                yield
        except UnicodeDecodeError as error:  # From a message of SQLite with a damaged name.
            raise self.damage_error(error) from error
        except sqlite3.DatabaseError as error:
            # Errors that Python itself raises, for bytes that are no text, have no code.
            if isinstance(error, sqlite3.OperationalError) and _primary_code(error):
                hint = HINTS.get(_primary_code(error), "")
                raise OSError(f"{self.path}: {error}{hint}") from error
            raise self.damage_error(error) from error


def _primary_code(error: sqlite3.Error) -> int:
    """Return the primary code of SQLite; 0 if the error has none."""
    return getattr(error, "sqlite_errorcode", 0) & 0xFF
