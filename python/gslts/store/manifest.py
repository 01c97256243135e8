"""What lies in the folder of a map, and what is known of the frames that it was made of.

Without NumPy, so that what is told of a map is told at once.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

FORMAT, VERSION = "gslts-map", 2
MANIFEST, CAMERAS = "manifest.json", "cameras.json"
MAX_MANIFEST_BYTES = 16 << 20
OF_VERSION = re.compile(r"(.+)@(\d{1,9})")
"""How a version of a map is named: the folder, and its number."""


def read_manifest(folder: Path) -> dict[str, Any]:
    """What is known of the frames that a map was made of.

    Raises:
        OSError: The file cannot be read.
        ValueError: It is no map, or of another version.
    """
    path = folder / MANIFEST
    with path.open("rb") as file:
        content = file.read(MAX_MANIFEST_BYTES + 1)
    try:
        manifest = json.loads(content[:MAX_MANIFEST_BYTES])
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{path}: {error}") from None
    if not isinstance(manifest, dict) or manifest.get("format") != FORMAT:
        raise ValueError(f"{path}: it is not the manifest of a map")
    if manifest.get("version") != VERSION:
        raise ValueError(
            f"{path}: version is {manifest.get('version')!r}, this gslts reads {VERSION}"
        )
    return manifest


def require_versions(path: Path) -> None:
    """Checks that a folder is one of a map with versions.

    Args:
        path: Of the folder.

    Raises:
        OSError: It cannot be read.
        ValueError: It is no folder of a map.
    """
    if path.is_file():
        raise ValueError(f"{path}: a file has no versions; gslts import makes a map of it")
    read_manifest(path)


def picture_path(folder: Path, number: int) -> Path:
    """Where the picture of what led to a version is."""
    return folder / "updates" / f"{number:05}.jpg"


def folder_of(path: Path) -> tuple[Path, int | None]:
    """The folder of what `read_map` takes, and the number of the version that is named."""
    named = OF_VERSION.fullmatch(str(path))
    if named is None or path.exists():
        return path, None
    return Path(named[1]), int(named[2])
