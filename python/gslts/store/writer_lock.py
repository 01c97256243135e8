"""One writer of a map at a time."""

from __future__ import annotations

import errno
import fcntl
from pathlib import Path
from typing import TextIO

from gslts.store.index import ELSEWHERE

LOCK = "writer.lock"


def writer_lock(folder: Path) -> TextIO:
    """The file that the only writer of a folder holds; the system lets go when it ends.

    Raises:
        OSError: Another process holds it, or it cannot be made.
    """
    path = folder / LOCK
    try:
        lock = path.open("w")
    except OSError as error:
        if error.errno not in (errno.EACCES, errno.EPERM, errno.EROFS):
            raise
        raise OSError(f"{path}: {error.strerror}; {ELSEWHERE}") from None
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        lock.close()
        raise OSError(f"{folder}: another process writes this map; wait until it ends") from None
    except BaseException:
        lock.close()
        raise
    return lock
