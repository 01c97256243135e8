"""Files of arrays that never change, found by the SHA-256 of their content."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from safetensors.numpy import load, save

from gslts.io.atomic_files import naming, remove_tree, sync_folder, write_whole

SUFFIX = ".safetensors"
REPAIR = "copy it from a backup, or go back to a version that is whole with gslts restore"

Arrays = Mapping[str, NDArray[Any]]


class Blobs:
    """The folder of the files.

    Args:
        folder: Is made when the first file is written.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def write(self, arrays: Arrays) -> tuple[str, int]:
        """Writes arrays, which are on the disk when this returns, whatever happens then.

        Returns:
            The key to read them with, and the bytes that they take.

        Raises:
            OSError: They cannot be written; then there is no new file.
        """
        content = save({name: np.ascontiguousarray(array) for name, array in arrays.items()})
        key = hashlib.sha256(content).hexdigest()
        path = self._path(key)
        if not (path.exists() and path.read_bytes() == content):
            path.parent.mkdir(parents=True, exist_ok=True)
            write_whole(path, content)
        for folder in (path.parent, self._folder, self._folder.parent):
            sync_folder(folder)
        return key, len(content)

    def read(self, key: str, size: int) -> dict[str, NDArray[Any]]:
        """The arrays of a file.

        Args:
            key: What `write` returned.
            size: The same; no more is read.

        Raises:
            OSError: The file cannot be read.
            ValueError: It is not what was written.
        """
        arrays: dict[str, NDArray[Any]] = load(self._checked(key, size))
        return arrays

    def verify(self, key: str, size: int) -> None:
        """Makes sure that a file is what was written.

        Raises:
            OSError: The file cannot be read.
            ValueError: It is not what was written.
        """
        self._checked(key, size)

    def __iter__(self) -> Iterator[str]:
        """The keys of all files that are there."""
        for path in sorted(self._folder.glob(f"??/*{SUFFIX}")):
            yield path.name.removesuffix(SUFFIX)

    def remove(self, key: str) -> int:
        """Removes a file; the bytes that it took.

        Raises:
            OSError: It cannot be removed.
        """
        path = self._path(key)
        size = path.stat().st_size
        path.unlink()
        return size

    def remove_parts(self) -> None:
        """Removes what writers left behind that were stopped; there must be no writer."""
        for path in self._folder.glob("??/.*.part"):
            remove_tree(path)

    def _path(self, key: str) -> Path:
        return self._folder / key[:2] / f"{key}{SUFFIX}"

    def _checked(self, key: str, size: int) -> bytes:
        path = self._path(key)
        try:
            with naming(path), path.open("rb") as file:
                content = file.read(size + 1)
        except FileNotFoundError:
            raise FileNotFoundError(f"{path}: it is missing; {REPAIR}") from None
        if len(content) != size or hashlib.sha256(content).hexdigest() != key:
            raise ValueError(
                f"{path}: it is damaged: its content is not that of its name; {REPAIR}"
            )
        return content
