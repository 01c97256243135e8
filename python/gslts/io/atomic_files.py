"""Atomic writing: after a crash or on a full disk, a file is the whole new one or the old one."""

from __future__ import annotations

import errno
import os
import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer


BUFFER_BYTES = 1 << 20
"""Bytes of a file that are written at once, if it comes in smaller parts."""


def write_atomic(path: Path, *content: ReadableBuffer) -> None:
    """Write a file atomically; when this returns, it is synced to the disk.

    Args:
        path: File to write; an old one stays until the new one is complete.
        content: All of its bytes, in parts.

    Raises:
        OSError: The file cannot be written or synced; an old file is unchanged.
    """
    temporary = temporary_path(path)
    try:
        with name_in_errors(path, temporary):
            with temporary.open("wb", buffering=BUFFER_BYTES) as file:
                for part in content:
                    file.write(part)
                file.flush()
                os.fsync(file.fileno())
            temporary.replace(path)
    except BaseException:
        remove_tree(temporary)
        raise
    sync_folder(path.parent)


def sync_folder(folder: Path) -> None:
    """Sync the names in a folder to the disk, where the file system can.

    Args:
        folder: The folder.

    Raises:
        OSError: The disk failed.
    """
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        with name_in_errors(folder.absolute()):  # The name "." would be of no help.
            os.fsync(descriptor)
    except OSError as error:
        if error.errno != errno.EINVAL:  # Some network file systems cannot sync folders.
            raise
    finally:
        os.close(descriptor)


def temporary_path(path: Path) -> Path:
    """Return the path beside `path` where this process writes before renaming.

    Removes what stopped processes left there. One of them may have had the process id of this one:
    in a container it is often the same each time.

    Args:
        path: Path of the final file or folder.
    """
    name = re.compile(rf"\.{re.escape(path.name)}\.(\d{{1,9}})\.part")
    own = path.with_name(f".{path.name}.{os.getpid()}.part")
    for part in path.parent.glob(".*.part"):
        match = name.fullmatch(part.name)
        if match is not None and (part == own or not _is_running(int(match[1]))):
            remove_tree(part)
    return own


def remove_tree(path: Path) -> None:
    """Remove a file or a folder; ignore errors of the disk.

    Args:
        path: File or folder; it need not exist.
    """
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        with suppress(OSError):
            path.unlink()


@contextmanager
def name_in_errors(path: object, partial: Path | None = None) -> Iterator[None]:
    """Name the path in errors of the system that name none, such as of a full disk.

    Args:
        path: File that is read or written in the `with` block.
        partial: Path from `temporary_path`, which users do not know; errors name `path` instead.
    """
    try:
        yield
    except OSError as error:
        if error.errno is None or error.filename not in (None, str(partial)):
            raise
        raise OSError(error.errno, error.strerror, str(path)) from None


def empty_folder(path: Path) -> None:
    """Make a folder, or accept an empty one.

    Args:
        path: The folder.

    Raises:
        OSError: The folder cannot be made.
        ValueError: The folder is not empty.
    """
    path.mkdir(parents=True, exist_ok=True)
    if any(path.iterdir()):
        raise ValueError(f"{path} is not empty")


def _is_running(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        pass
    return True
