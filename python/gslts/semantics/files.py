"""What a map keeps to understand the features of its Gaussians.

The setting stands in the cause of the version that brought the features, and names the file of the
autoencoder by what is in it: a version never meets the autoencoder of another.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from gslts.io.atomic_files import sync_folder, write_whole
from gslts.semantics.autoencoder import Autoencoder, autoencoder_bytes, read_autoencoder
from gslts.store.map_folder import folder_of, open_map
from gslts.store.map_store import MapStore
from gslts.store.records import Version

FOLDER = "semantics"
"""Of autoencoders, in the folder of a map."""


class SemanticsSetting(BaseModel):
    """Where the features of a version are from.

    Attributes:
        source: Of what pictures mean.
        dataset: That was shown to it.
        levels: Of masks; each has a code.
        code: Length of a code.
        names: Of what the source has words for.
        models: Folders of the weights, by what they are for.
        autoencoder: SHA-256 of its file, in hexadecimal digits.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    source: Literal["oracle", "clip"]
    dataset: str
    levels: Annotated[int, Field(ge=1, le=3)]
    code: Annotated[int, Field(ge=8, le=64)]
    names: tuple[str, ...]
    models: Mapping[str, str] = {}
    autoencoder: Annotated[str, Field(pattern="^[0-9a-f]{64}$")]


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
    write_whole(path, content)
    sync_folder(folder)
    return digest


def read_semantics(path: Path) -> tuple[SemanticsSetting, Autoencoder] | None:
    """What the features of a version mean; None if nobody taught it or one before it.

    Args:
        path: A map folder, or a version of it such as MAP@3.

    Raises:
        OSError: A file cannot be read.
        ValueError: There is no such version, or a file is damaged.
    """
    folder, number = folder_of(path)
    with open_map(folder) as store:
        taught = [one for one in store.way_to(number) if one.kind == "semantics"]
    return _taught_by(taught[-1], folder) if taught else None


def require_semantics(path: Path) -> tuple[SemanticsSetting, Autoencoder]:
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
            if version.kind == "semantics":
                _taught_by(version, store.folder)
        except (OSError, ValueError) as error:
            found.append(f"version {version.number}: {error}")
    return found


def _taught_by(version: Version, folder: Path) -> tuple[SemanticsSetting, Autoencoder]:
    try:
        setting = SemanticsSetting.model_validate(dict[str, Any](version.cause))
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(str(part) for part in first["loc"])
        what = f"the semantics of version {version.number} are damaged"
        raise ValueError(f"{folder}: {what}: {where}: {first['msg']}") from None
    return setting, read_autoencoder(_path_of(folder, setting.autoencoder), setting.autoencoder)


def _path_of(folder: Path, digest: str) -> Path:
    return folder / FOLDER / f"{digest[:16]}.safetensors"
