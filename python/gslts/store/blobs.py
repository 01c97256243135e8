"""Content-addressed files of arrays: immutable, named by the SHA-256 of their content."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from safetensors.numpy import load, save

from gslts.io.atomic_files import name_in_errors, remove_tree, sync_folder, write_atomic
from gslts.store.records import Blob

SUFFIX = ".safetensors"
"""Suffix of the files."""
REPAIR = "copy it from a backup, or go back to an intact version with gslts restore"
"""Next step where a file is missing or damaged."""

Arrays = Mapping[str, NDArray[Any]]


class Blobs:
    """Folder of the files.

    Args:
        folder: Created with the first file.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def write(self, arrays: Arrays) -> Blob:
        """Write arrays, durably: they are on disk when this returns.

        Args:
            arrays: By name.

        Returns:
            Key and size, to read them with.

        Raises:
            OSError: The file cannot be written; then there is no new file.
        """
        content = save({name: np.ascontiguousarray(array) for name, array in arrays.items()})
        key = hashlib.sha256(content).hexdigest()
        path = self.path(key)
        if not (path.exists() and path.read_bytes() == content):
            path.parent.mkdir(parents=True, exist_ok=True)
            write_atomic(path, content)
        for folder in (path.parent, self._folder, self._folder.parent):
            sync_folder(folder)
        return Blob(key=key, size=len(content))

    def read(self, blob: Blob) -> dict[str, NDArray[Any]]:
        """Read the arrays of a file.

        Args:
            blob: From `write`.

        Returns:
            The arrays by name.

        Raises:
            OSError: The file cannot be read.
            ValueError: The file is damaged.
        """
        arrays: dict[str, NDArray[Any]] = load(self._read_checked(blob))
        return arrays

    def verify(self, blob: Blob) -> None:
        """Check a file against its checksum.

        Args:
            blob: From `write`.

        Raises:
            OSError: The file cannot be read.
            ValueError: The file is damaged.
        """
        self._read_checked(blob)

    def __iter__(self) -> Iterator[str]:
        """Iterate over the keys of all files in the folder."""
        for path in sorted(self._folder.glob(f"??/*{SUFFIX}")):
            yield path.name.removesuffix(SUFFIX)

    def remove(self, key: str) -> int:
        """Remove a file.

        Args:
            key: Of the file.

        Returns:
            Its size, bytes.

        Raises:
            OSError: The file cannot be removed.
        """
        path = self.path(key)
        size = path.stat().st_size
        path.unlink()
        return size

    def remove_partial_files(self) -> None:
        """Remove the partial files of writers that were killed. There must be no other writer."""
        for path in self._folder.glob("??/.*.part"):
            remove_tree(path)

    def path(self, key: str) -> Path:
        """Return the path of a file.

        Args:
            key: Of the file.
        """
        return self._folder / key[:2] / f"{key}{SUFFIX}"

    def _read_checked(self, blob: Blob) -> bytes:
        path = self.path(blob.key)
        try:
            with name_in_errors(path), path.open("rb") as file:
                content = file.read(blob.size + 1)  # More is not needed to see that it differs.
        except FileNotFoundError:
            raise FileNotFoundError(f"{path}: missing; {REPAIR}") from None
        if len(content) != blob.size or hashlib.sha256(content).hexdigest() != blob.key:
            raise ValueError(f"{path}: damaged: its checksum does not match its name; {REPAIR}")
        return content
