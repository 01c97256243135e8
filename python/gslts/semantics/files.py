"""Autoencoder files of a map folder, and the record of where the features of a version come from.

The record is in the cause of the version that added the features. It names the autoencoder file by
its checksum, so that a version never uses the autoencoder of another.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from gslts.io.atomic_files import sync_folder, write_whole
from gslts.semantics.autoencoder import (
    MAX_CODE_DIMS,
    MIN_CODE_DIMS,
    Autoencoder,
    autoencoder_bytes,
    read_autoencoder,
)
from gslts.semantics.source import MAX_LEVELS
from gslts.store.map_folder import folder_of, open_map
from gslts.store.map_store import MapStore
from gslts.store.records import Version

FOLDER = "semantics"
"""Sub-folder of a map folder for autoencoder files."""


class SemanticsSetting(BaseModel):
    """Record of how the semantic features of a version were computed.

    Attributes:
        source: Name of the semantic source.
        dataset: Name of the dataset whose frames were segmented.
        levels: Number of levels of masks, L; a Gaussian has a code for each.
        code_dims: Length of a code, d.
        names: Names of the object types in the frames.
        models: Folders of the weights, by their use: "clip", "sam".
        autoencoder: SHA-256 of the autoencoder file, hexadecimal.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    source: Literal["oracle", "clip"]
    dataset: str
    levels: Annotated[int, Field(ge=1, le=MAX_LEVELS)]
    code_dims: Annotated[int, Field(ge=MIN_CODE_DIMS, le=MAX_CODE_DIMS)]
    names: tuple[str, ...]
    models: Mapping[str, str] = {}
    autoencoder: Annotated[str, Field(pattern="^[0-9a-f]{64}$")]


def write_autoencoder(model: Autoencoder, folder: Path) -> str:
    """Write an autoencoder into a map folder and sync it to disk.

    Args:
        model: The autoencoder.
        folder: The map folder.

    Returns:
        SHA-256 of the file, for `SemanticsSetting`.

    Raises:
        OSError: The file cannot be written.
    """
    content = autoencoder_bytes(model)
    digest = hashlib.sha256(content).hexdigest()
    path = _path_of(folder, digest)
    path.parent.mkdir(exist_ok=True)
    write_whole(path, content)
    sync_folder(folder)
    return digest


def read_semantics(path: Path) -> tuple[SemanticsSetting, Autoencoder] | None:
    """Read the record and the autoencoder of the features of a version.

    Args:
        path: A map folder, or a version of it such as MAP@3.

    Returns:
        Both; None if neither the version nor one that it came from added semantic features.

    Raises:
        OSError: A file cannot be read.
        ValueError: There is no such version, or a file is damaged.
    """
    folder, number = folder_of(path)
    with open_map(folder) as store:
        versions = [version for version in store.way_to(number) if version.kind == "semantics"]
    return _semantics_of(versions[-1], folder) if versions else None


def require_semantics(path: Path) -> tuple[SemanticsSetting, Autoencoder]:
    """Read the record and the autoencoder of a version that must have semantic features.

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
            if version.kind == "semantics":
                _semantics_of(version, store.folder)
        except (OSError, ValueError) as error:
            problems.append(f"version {version.number}: {error}")
    return problems


def _semantics_of(version: Version, folder: Path) -> tuple[SemanticsSetting, Autoencoder]:
    try:
        setting = SemanticsSetting.model_validate(dict[str, Any](version.cause))
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        field = ".".join(str(part) for part in first["loc"])
        raise ValueError(
            f"{folder}: the semantics of version {version.number} are damaged: {field}: "
            f"{first['msg']}"
        ) from None
    return setting, read_autoencoder(_path_of(folder, setting.autoencoder), setting.autoencoder)


def _path_of(folder: Path, digest: str) -> Path:
    return folder / FOLDER / f"{digest[:16]}.safetensors"
