"""Files that versions of a map add, such as landmarks, each named by the SHA-256 of its content.

The manifest names the file of the first version, the cause of a later version the file that it
added. Removals are not recorded: entries name their Gaussians, so that those of a version are in
the files up to it, and are there again when an older version is restored.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import load, save

from gslts.io.atomic_files import remove_tree, sync_folder, write_atomic
from gslts.io.bounded_files import read_bounded
from gslts.store.blobs import SUFFIX
from gslts.store.causes import ExtensionCause, UpdateCause
from gslts.store.manifest import MANIFEST, read_manifest
from gslts.store.map_store import MapStore
from gslts.store.records import Version

REPAIR = "copy it from a backup, or make the map again with gslts map"
"""Next step for error messages about a missing or damaged file."""


@dataclass(frozen=True)
class AddedFiles:
    """Files of one kind.

    Attributes:
        kind: Name of their folder, of the key in the manifest, and of the field of a cause.
        max_bytes: Maximum size of a file, which bounds the memory for a hostile one.
    """

    kind: Literal["landmarks", "measurements"]
    max_bytes: int

    def path(self, folder: Path, digest: str) -> Path:
        """Return the path of a file.

        Args:
            folder: Map folder.
            digest: SHA-256 of the file.
        """
        return folder / self.kind / f"{digest}{SUFFIX}"

    def find(self, folder: Path, digest: str) -> Path:
        """Return the path of a file that was written.

        Older maps have the measurements of the first version beside the manifest.

        Args:
            folder: Map folder.
            digest: SHA-256 of the file.
        """
        path, old = self.path(folder, digest), folder / f"{self.kind}{SUFFIX}"
        return old if old.exists() and not path.exists() else path

    def write(self, arrays: Mapping[str, NDArray[Any]], folder: Path) -> str:
        """Write a file into a map folder, durable after a power loss.

        Args:
            arrays: By name.
            folder: Map folder.

        Returns:
            SHA-256 of the file, for the manifest or the cause of a version.

        Raises:
            OSError: The file cannot be written.
        """
        content = save({name: np.ascontiguousarray(array) for name, array in arrays.items()})
        digest = hashlib.sha256(content).hexdigest()
        path = self.path(folder, digest)
        path.parent.mkdir(exist_ok=True)
        write_atomic(path, content)
        sync_folder(folder)
        return digest

    def read(self, folder: Path, digest: str) -> dict[str, NDArray[Any]]:
        """Read a file.

        Args:
            folder: Map folder.
            digest: SHA-256 of the file.

        Returns:
            Its arrays by name.

        Raises:
            OSError: The file cannot be read.
            ValueError: The file is damaged.
        """
        path = self.find(folder, digest)
        try:
            content = read_bounded(path, self.max_bytes)
        except FileNotFoundError:
            raise FileNotFoundError(f"{path}: it is missing; {REPAIR}") from None
        if hashlib.sha256(content).hexdigest() != digest:
            raise ValueError(f"{path}: it is damaged: it has another SHA-256; {REPAIR}")
        with self.name_in_errors(folder, digest):
            return load(content)

    @contextmanager
    def name_in_errors(self, folder: Path, digest: str) -> Iterator[None]:
        """Name a file in the errors of a parser of its arrays.

        Args:
            folder: Map folder.
            digest: SHA-256 of the file.

        Raises:
            ValueError: The arrays are not of this kind.
        """
        try:
            yield
        except (SafetensorError, KeyError, TypeError, ValueError) as error:
            path = self.find(folder, digest)
            raise ValueError(f"{path}: these are no {self.kind}: {error}") from None

    def digest_of_manifest(self, folder: Path) -> str | None:
        """Return the SHA-256 of the file of the first version; None if it has none.

        Args:
            folder: Map folder.

        Raises:
            OSError: The manifest cannot be read.
            ValueError: The manifest is damaged.
        """
        digest = read_manifest(folder).get(self.kind)
        if digest is None or (isinstance(digest, str) and re.fullmatch("[0-9a-f]{64}", digest)):
            return digest
        raise ValueError(
            f"{folder / MANIFEST}: {self.kind}: expected a SHA-256, got {str(digest)[:80]!r}"
        )

    def digest_of(self, version: Version) -> str | None:
        """Return the SHA-256 of the file that a version after the first one added, if any.

        Args:
            version: Of the map.
        """
        is_adding = isinstance(version.cause, UpdateCause | ExtensionCause)
        return getattr(version.cause, self.kind, None) if is_adding else None

    def digests(self, folder: Path, versions: Iterable[Version]) -> Iterator[tuple[int, str]]:
        """Yield the numbers of versions that added a file, and its SHA-256.

        Args:
            folder: Map folder.
            versions: The first one, and later ones.

        Raises:
            OSError: The manifest cannot be read.
            ValueError: The manifest is damaged.
        """
        digest = self.digest_of_manifest(folder)
        if digest is not None:
            yield 1, digest
        for version in versions:
            digest = self.digest_of(version)
            if digest is not None:
                yield version.number, digest

    def find_problems(self, store: MapStore, read: Callable[[Path, str], object]) -> list[str]:
        """List the files that are missing or damaged.

        Args:
            store: Store of the map.
            read: Reads a file of a map folder, named by its SHA-256.

        Returns:
            One line per file; none if all files are valid.
        """
        problems = []
        try:
            digests = list(self.digests(store.folder, store.versions()))
        except (OSError, ValueError) as error:
            return [f"version 1: {error}"]
        for number, digest in digests:
            try:
                read(store.folder, digest)
            except (OSError, ValueError) as error:
                problems.append(f"version {number}: {error}")
        return problems

    def remove_unneeded(self, store: MapStore) -> int:
        """Remove files that no version names, such as those of interrupted commits.

        Args:
            store: Store of the map, writable.

        Returns:
            Number of bytes freed.

        Raises:
            OSError: A file cannot be removed.
            ValueError: The manifest is damaged, or a file that a version names is missing.
        """
        folder = store.folder
        needed = {self.find(folder, digest) for _, digest in self.digests(folder, store.versions())}
        missing = [path for path in needed if not path.exists()]
        if missing:
            raise ValueError(f"{missing[0]}: it is missing; {REPAIR}; nothing was removed")
        freed = 0
        for path in sorted((folder / self.kind).glob(f"*{SUFFIX}")):
            if path not in needed:
                freed += path.stat().st_size
                path.unlink()
        for part in (folder / self.kind).glob(".*.part"):  # There is no other writer.
            remove_tree(part)
        return freed
