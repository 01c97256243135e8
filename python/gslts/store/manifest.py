"""Layout of a map folder, and its manifest. Does not import NumPy."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

from gslts.io.bounded_files import read_bounded

FORMAT, FORMAT_VERSION = "gslts-map", 2
"""Marks of the manifest; another version is rejected."""
MANIFEST, CAMERAS = "manifest.json", "cameras.json"
"""File names in the folder."""
MAX_MANIFEST_BYTES = 16 << 20
"""Bounds the memory for a hostile file; a manifest of 1,000 frames takes less than 1 MB."""


def read_manifest(folder: Path) -> dict[str, Any]:
    """Read the manifest of a map: how the first version was made.

    Args:
        folder: Folder of the map.

    Returns:
        The JSON object.

    Raises:
        OSError: The file cannot be read.
        ValueError: The file is no manifest, or of another version.
    """
    path = folder / MANIFEST
    try:
        content = read_bounded(path, MAX_MANIFEST_BYTES)
    except (FileNotFoundError, NotADirectoryError):
        found = f"it has no {MANIFEST}" if folder.is_dir() else "there is no such folder"
        raise FileNotFoundError(f"{folder}: {found}; gslts map makes a map") from None
    try:
        manifest = json.loads(content)
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{path}: {error}") from None
    if not isinstance(manifest, dict) or manifest.get("format") != FORMAT:
        raise ValueError(f"{path}: not the manifest of a map")
    if manifest.get("version") != FORMAT_VERSION:
        raise ValueError(
            f"{path}: version is {manifest.get('version')!r}, this gslts reads {FORMAT_VERSION}"
        )
    return manifest


def require_map_folder(path: Path) -> None:
    """Check that a path is the folder of a map.

    Args:
        path: To check.

    Raises:
        OSError: The folder cannot be read.
        ValueError: The path is no folder of a map.
    """
    if path.is_file():
        raise ValueError(f"{path}: a file has no versions; gslts import makes a map of it")
    folder, number = split_version(path)
    if number is not None:
        raise ValueError(f"{path}: give the folder of the map, {folder}, not one version of it")
    read_manifest(path)


def update_image_path(folder: Path, number: int) -> Path:
    """Return the path of the image of an update: frames, and the map before and after.

    Args:
        folder: Folder of the map.
        number: Of the version.

    Returns:
        The path; the file may be missing.
    """
    return folder / "updates" / f"{number:05}.jpg"


def split_version(path: Path) -> tuple[Path, int | None]:
    """Split the path of a version, such as `out/map@3`.

    Args:
        path: With or without a number. A path that exists is never split.

    Returns:
        The folder, and the number; None if the path has none.
    """
    match = re.fullmatch(r"(.+)@(\d{1,9})", str(path))
    if match is None or path.exists():
        return path, None
    return Path(match[1]), int(match[2])
