"""Lock that allows one writer of a map at a time."""

from __future__ import annotations

import errno
import fcntl
from pathlib import Path
from typing import TextIO

from gslts.store.index_file import WRITE_ELSEWHERE

LOCK = "writer.lock"
"""File name of the lock in the folder of a map."""


def lock_for_writing(folder: Path) -> TextIO:
    """Lock a map for writing; the system releases the lock when the process ends.

    Args:
        folder: Folder of the map.

    Returns:
        The open file; close it to release the lock.

    Raises:
        BlockingIOError: Another process holds the lock.
        OSError: The file cannot be created.
    """
    path = folder / LOCK
    try:
        lock = path.open("w")
    except OSError as error:
        if error.errno not in (errno.EACCES, errno.EPERM, errno.EROFS):
            raise
        raise OSError(f"{path}: {error.strerror}; {WRITE_ELSEWHERE}") from None
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        lock.close()
        raise BlockingIOError(
            f"{folder}: another process writes this map; wait until it ends"
        ) from None
    except BaseException:
        lock.close()
        raise
    return lock
