"""Version objects of a shared map: `versions/00000002.json` beside the blobs of all versions.

Version 1 brings the files that never change; a later version brings its own files. Each object has
the SHA-256 of the one before, so that nobody can exchange the history of a map.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal, Self

from pydantic import Field, ValidationError, model_validator

from gslts.io.messages import first_problem
from gslts.localization.landmark_files import LANDMARK_FILES
from gslts.semantics.files import autoencoder_path
from gslts.store.causes import Record, Sha256
from gslts.store.manifest import CAMERAS, MANIFEST, update_image_path
from gslts.store.measurement_files import MEASUREMENT_FILES
from gslts.store.records import Blob, ObjectEvent, Rejection, Snapshot, Version
from gslts.store.trajectory_file import TRAJECTORY

CONTROL_CHARACTERS = re.compile("[\\x00-\\x1f\\x7f-\\x9f]")
"""Characters by which a text of a version could write anywhere on a terminal."""
FORMAT_VERSION = 1
"""Layout of a version object. Raise it with the first change of the object or of a cause after a
release."""

FileName = Literal[
    "manifest", "cameras", "measurements", "trajectory", "landmarks", "autoencoder", "image"
]
"""Files of a version besides its Gaussians."""
LATER_FILES = {"landmarks", "measurements", "autoencoder", "image"}
"""Files that versions after the first one may have."""


class SharedVersion(Record):
    """Content of a version object.

    Attributes:
        format, format_version: Marks.
        origin: Identity of the map, the same in all of its clones.
        previous: SHA-256 of the version object before; None for version 1.
        version: The version.
        snapshot: File of all its Gaussians, if there is one.
        events: Object changes that it shows.
        rejections: Updates that its robot rejected since its previous version.
        files: Its files besides Gaussians.
    """

    format: Literal["gslts-shared-map"] = "gslts-shared-map"
    format_version: Literal[1] = 1
    origin: Sha256
    previous: Sha256 | None
    version: Version
    snapshot: Snapshot | None = None
    events: tuple[ObjectEvent, ...] = ()
    rejections: tuple[Rejection, ...] = ()
    files: dict[FileName, Blob] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _is_consistent(self) -> Self:
        number = self.version.number
        if (number == 1) != (self.previous is None):
            raise ValueError("previous: all versions but the first have one")
        if number == 1 and not {"manifest", "cameras"} <= self.files.keys():
            raise ValueError("files: the first version has a manifest and cameras")
        if number > 1 and not self.files.keys() <= LATER_FILES:
            raise ValueError("files: later versions do not change those of the first one")
        if any(rejection.version >= number for rejection in self.rejections):
            raise ValueError("rejections: they must be of earlier versions")
        return self

    def to_bytes(self) -> bytes:
        """Return the content of the object."""
        return self.model_dump_json().encode()


def parse_shared_version(content: bytes, name: str, number: int) -> SharedVersion:
    """Parse a version object.

    Args:
        content: Of the object.
        name: Of the object, for messages.
        number: Of the version.

    Returns:
        The version.

    Raises:
        ValueError: The object is damaged, of a newer format, or of another version.
    """
    try:
        try:
            marks = json.loads(content)
        except ValueError:
            marks = None
        if not isinstance(marks, dict) or marks.get("format") != "gslts-shared-map":
            raise ValueError("not a version of a shared map")
        found = marks.get("format_version")
        if isinstance(found, int) and found > FORMAT_VERSION:
            raise ValueError(
                f"its format is version {found}, this gslts reads {FORMAT_VERSION}; a newer gslts "
                "wrote it: install that version"
            )
        if any(CONTROL_CHARACTERS.search(text) for text in _texts(marks)):
            raise ValueError("a text has control characters")
        shared = SharedVersion.model_validate_json(content)
        if shared.version.number != number:
            raise ValueError(f"it holds version {shared.version.number}")
    except ValidationError as error:
        raise ValueError(f"{name}: {first_problem(error)}") from None
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{name}: {error}") from None
    return shared


def _texts(value: Any) -> Iterator[str]:
    """Yield all texts in a JSON value."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        for name, part in value.items():
            yield name
            yield from _texts(part)
    elif isinstance(value, list):
        for part in value:
            yield from _texts(part)


def file_path(folder: Path, name: FileName, number: int, blob: Blob) -> Path:
    """Return the path of a file of a version in a map folder.

    Args:
        folder: The map folder.
        name: Of the file.
        number: Of the version.
        blob: Its content.
    """
    paths = {
        "manifest": folder / MANIFEST,
        "cameras": folder / CAMERAS,
        "measurements": MEASUREMENT_FILES.path(folder, blob.key),
        "trajectory": folder / TRAJECTORY,
        "landmarks": LANDMARK_FILES.path(folder, blob.key),
        "autoencoder": autoencoder_path(folder, blob.key),
        "image": update_image_path(folder, number),
    }
    return paths[name]
