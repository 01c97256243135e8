"""Autoencoder files of a map folder.

The cause of the version that added semantic features names the autoencoder file by its checksum, so
that a version never uses the autoencoder of another.
"""

from __future__ import annotations

import hashlib
from pathlib import Path

from gslts.io.atomic_files import sync_folder, write_atomic
from gslts.semantics.autoencoder import Autoencoder, autoencoder_bytes, read_autoencoder
from gslts.semantics.class_codec import ClassCodec
from gslts.semantics.source import Codec
from gslts.store.causes import SemanticsCause
from gslts.store.manifest import split_version
from gslts.store.map_folder import open_map
from gslts.store.map_store import MapStore

FOLDER = "semantics"
"""Sub-folder of a map folder for autoencoder files."""


def write_autoencoder(model: Autoencoder, folder: Path) -> str:
    """Write an autoencoder into a map folder and sync it to disk.

    Args:
        model: The autoencoder.
        folder: The map folder.

    Returns:
        SHA-256 of the file, for `SemanticsCause`.

    Raises:
        OSError: The file cannot be written.
    """
    content = autoencoder_bytes(model)
    digest = hashlib.sha256(content).hexdigest()
    path = autoencoder_path(folder, digest)
    path.parent.mkdir(exist_ok=True)
    write_atomic(path, content)
    sync_folder(folder)
    return digest


def read_semantics(path: Path) -> tuple[SemanticsCause, Codec] | None:
    """Read the cause and the codec of the features of a version.

    Args:
        path: A map folder, or a version of it such as MAP@3.

    Returns:
        Both; None if neither the version nor one that it came from added semantic features.

    Raises:
        OSError: A file cannot be read.
        ValueError: There is no such version, or a file is damaged.
    """
    folder, number = split_version(path)
    with open_map(folder) as store:
        causes = [version.cause for version in store.lineage(number)]
    semantics = [cause for cause in causes if isinstance(cause, SemanticsCause)]
    return (semantics[-1], _read_codec(semantics[-1], folder)) if semantics else None


def require_semantics(path: Path) -> tuple[SemanticsCause, Codec]:
    """Read the cause and the codec of a version that must have semantic features.

    Args:
        path: A map folder, or a version of it such as MAP@3.

    Returns:
        As `read_semantics`.

    Raises:
        OSError: A file cannot be read.
        ValueError: The version has no semantic features, or as for `read_semantics`.
    """
    found = read_semantics(path)
    if found is None:
        raise ValueError(f"{path} has no semantic features; gslts semantics adds them")
    return found


def semantics_problems(store: MapStore) -> list[str]:
    """List the autoencoder files of a map that are missing or damaged.

    Args:
        store: The store of the map.

    Returns:
        One line for each problem; empty if there is none.
    """
    problems = []
    for version in store.versions():
        try:
            if isinstance(version.cause, SemanticsCause):
                _read_codec(version.cause, store.folder)
        except (OSError, ValueError) as error:
            problems.append(f"version {version.number}: {error}")
    return problems


def _read_codec(cause: SemanticsCause, folder: Path) -> Codec:
    if cause.autoencoder is None:
        return ClassCodec(1 + len(cause.names))
    return read_autoencoder(autoencoder_path(folder, cause.autoencoder), cause.autoencoder)


def autoencoder_path(folder: Path, digest: str) -> Path:
    """Return the path of the file of an autoencoder.

    Args:
        folder: The map folder.
        digest: SHA-256 of the file.
    """
    return folder / FOLDER / f"{digest[:16]}.safetensors"
