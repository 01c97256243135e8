"""Content-addressed files of arrays: immutable, named by the SHA-256 of their content."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError
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
        return self.write_parts(
            [save({name: np.ascontiguousarray(array) for name, array in arrays.items()})]
        )

    def write_parts(self, parts: Sequence[bytes | memoryview]) -> Blob:
        """Write a file of arrays, durably; see `write`.

        Args:
            parts: Its content, a safetensors file.
        """
        digest, size = hashlib.sha256(), sum(len(part) for part in parts)
        for part in parts:
            digest.update(part)
        blob = Blob(key=digest.hexdigest(), size=size)
        path = self.path(blob.key)
        try:
            self.verify(blob)
        except (OSError, ValueError):
            path.parent.mkdir(parents=True, exist_ok=True)
            write_atomic(path, *parts)
        for folder in (path.parent, self._folder, self._folder.parent):
            sync_folder(folder)
        return blob

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
        path = self.path(blob.key)
        with missing_file(path), path.open("rb") as file:
            content = file.read(blob.size + 1)  # More is not needed to see that it differs.
        self._require(len(content) == blob.size, hashlib.sha256(content).hexdigest(), blob)
        try:
            arrays: dict[str, NDArray[Any]] = load(content)
        except (SafetensorError, KeyError, TypeError, ValueError) as error:
            raise ValueError(f"{path}: no arrays: {error}; {REPAIR}") from None
        return arrays

    def verify(self, blob: Blob) -> None:
        """Check a file against its checksum.

        Args:
            blob: From `write`.

        Raises:
            OSError: The file cannot be read.
            ValueError: The file is damaged.
        """
        path = self.path(blob.key)
        with missing_file(path), path.open("rb") as file:
            same = os.fstat(file.fileno()).st_size == blob.size
            self._require(same, hashlib.file_digest(file, "sha256").hexdigest(), blob)

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

    def _require(self, has_size: bool, digest: str, blob: Blob) -> None:
        if not has_size or digest != blob.key:
            path = self.path(blob.key)
            raise ValueError(f"{path}: damaged: its checksum does not match its name; {REPAIR}")


@contextmanager
def missing_file(path: Path) -> Iterator[None]:
    """Name the next step in the error of a missing file, and the path in others.

    Args:
        path: Of a file that is opened in the `with` block.
    """
    try:
        with name_in_errors(path):
            yield
    except FileNotFoundError:
        raise FileNotFoundError(f"{path}: missing; {REPAIR}") from None
