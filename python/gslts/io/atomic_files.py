"""Files that are there whole or not at all."""

from __future__ import annotations

import errno
import os
import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


def write_whole(path: Path, content: bytes) -> None:
    """Writes a file, which is on the disk for good when this returns, or leaves what was there.

    Raises:
        OSError: It cannot be written, or the disk failed before its name was there for good.
    """
    temporary = part_of(path)
    try:
        with naming(path), temporary.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(path)
    except BaseException:
        remove_tree(temporary)
        raise
    sync_folder(path.parent)


def sync_folder(folder: Path) -> None:
    """Makes names in a folder last, where the file system can.

    Raises:
        OSError: The disk failed.
    """
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        with naming(folder.absolute()):  # "." would tell nothing.
            os.fsync(descriptor)
    except OSError as error:
        if error.errno != errno.EINVAL:  # Some of networks have no such call for folders.
            raise
    finally:
        os.close(descriptor)


def part_of(path: Path) -> Path:
    """Where this process writes what is to appear at a path as a whole: beside it.

    What was left there by processes that were stopped is removed. One of them may have had the
    number of this one: in a container, it is often the same each time.
    """
    name = re.compile(rf"\.{re.escape(path.name)}\.(\d{{1,9}})\.part")
    own = path.with_name(f".{path.name}.{os.getpid()}.part")
    for part in path.parent.glob(".*.part"):
        of = name.fullmatch(part.name)
        if of is not None and (part == own or not _runs(int(of[1]))):
            remove_tree(part)
    return own


def remove_tree(path: Path) -> None:
    """Removes a file or a folder, as far as the disk lets it."""
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        with suppress(OSError):
            path.unlink()


@contextmanager
def naming(path: Path) -> Iterator[None]:
    """Lets an error in writing, such as of a full disk, tell the file, as one in opening does."""
    try:
        yield
    except OSError as error:
        if error.filename is None and error.errno is not None:
            error.filename = str(path)
        raise


def empty_folder(path: Path) -> None:
    """Makes a folder, or takes an empty one.

    Raises:
        OSError: It cannot be made.
        ValueError: There is something in it.
    """
    path.mkdir(parents=True, exist_ok=True)
    if any(path.iterdir()):
        raise ValueError(f"{path} is not empty")


def _runs(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        pass
    return True
