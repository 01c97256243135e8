"""What a map keeps to understand the features of its Gaussians.

The setting stands in the cause of the version that brought the features, and names the file of the
autoencoder by what is in it: a version never meets the autoencoder of another.
"""

from __future__ import annotations

import hashlib
from pathlib import Path

from gslts.io.atomic_files import sync_folder, write_atomic
from gslts.semantics.autoencoder import Autoencoder, autoencoder_bytes, read_autoencoder
from gslts.store.causes import SemanticsCause
from gslts.store.manifest import split_version
from gslts.store.map_folder import open_map
from gslts.store.map_store import MapStore

FOLDER = "semantics"
"""Of autoencoders, in the folder of a map."""


def write_autoencoder(model: Autoencoder, folder: Path) -> str:
    """Writes it into the folder of a map, so that it outlasts a power cut.

    Returns:
        Its SHA-256, for the setting.

    Raises:
        OSError: It cannot be written.
    """
    content = autoencoder_bytes(model)
    digest = hashlib.sha256(content).hexdigest()
    path = _path_of(folder, digest)
    path.parent.mkdir(exist_ok=True)
    write_atomic(path, content)
    sync_folder(folder)
    return digest


def read_semantics(path: Path) -> tuple[SemanticsCause, Autoencoder] | None:
    """What the features of a version mean; None if nobody taught it or one before it.

    Args:
        path: A map folder, or a version of it such as MAP@3.

    Raises:
        OSError: A file cannot be read.
        ValueError: There is no such version, or a file is damaged.
    """
    folder, number = split_version(path)
    with open_map(folder) as store:
        causes = [version.cause for version in store.lineage(number)]
    taught = [cause for cause in causes if isinstance(cause, SemanticsCause)]
    return _read_cause(taught[-1], folder) if taught else None


def require_semantics(path: Path) -> tuple[SemanticsCause, Autoencoder]:
    """As `read_semantics`.

    Raises:
        OSError: A file cannot be read.
        ValueError: Nobody taught the map, or as for `read_semantics`.
    """
    found = read_semantics(path)
    if found is None:
        raise ValueError(f"{path} knows no words; gslts semantics teaches it")
    return found


def semantics_problems(store: MapStore) -> list[str]:
    """Every autoencoder that is missing or damaged, in one line each; none if all is well.

    Args:
        store: Of the map.
    """
    found = []
    for version in store.versions():
        try:
            if isinstance(version.cause, SemanticsCause):
                _read_cause(version.cause, store.folder)
        except (OSError, ValueError) as error:
            found.append(f"version {version.number}: {error}")
    return found


def _read_cause(cause: SemanticsCause, folder: Path) -> tuple[SemanticsCause, Autoencoder]:
    return cause, read_autoencoder(_path_of(folder, cause.autoencoder), cause.autoencoder)


def _path_of(folder: Path, digest: str) -> Path:
    return folder / FOLDER / f"{digest[:16]}.safetensors"
