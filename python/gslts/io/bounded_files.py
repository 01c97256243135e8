"""Bounded reading of untrusted files."""

from __future__ import annotations

from typing import IO, Any, Protocol

from gslts.io.atomic_files import name_in_errors


class Readable(Protocol):
    """A file on the disk (`Path`) or in an archive (`zipfile.Path`)."""

    def open(self, mode: Any) -> IO[Any]:
        """See `Path.open`."""
        ...


def read_bounded(path: Readable, max_bytes: int) -> bytes:
    """Read a file, if it is not too large.

    Args:
        path: A file.
        max_bytes: Maximum size.

    Raises:
        OSError: The file cannot be read.
        ValueError: The file is larger, or its archive is damaged.
    """
    try:
        with name_in_errors(path), path.open("rb") as file:
            content: bytes = file.read(max_bytes + 1)
    except OSError:
        raise
    except Exception as error:  # A damaged archive raises errors of any kind.
        raise ValueError(f"{path}: {error}") from None
    if len(content) > max_bytes:
        raise ValueError(f"{path}: larger than {max_bytes:,} bytes")
    return content
