"""Landmark files in a map folder, which live with the versions of the map.

The manifest names the file of the landmarks of the first version, the cause of a later version the
file of those that it added, each by the SHA-256 of its content. Removals are not recorded: a
landmark names its Gaussian, so that the landmarks of a version are those of all files up to it
whose Gaussian is in it. A removed landmark is there again when an older version is restored.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Iterator
from dataclasses import fields
from pathlib import Path

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load, save

from gslts.core.gaussian_map import GaussianMap
from gslts.io.atomic_files import name_in_errors, remove_tree, sync_folder, write_atomic
from gslts.localization.constants import MAX_FILE_BYTES, VERSION_BYTES
from gslts.localization.landmarks import Landmarks, concatenate, limit_size
from gslts.store.blobs import SUFFIX
from gslts.store.causes import ExtensionCause, UpdateCause
from gslts.store.manifest import MANIFEST, read_manifest, split_version
from gslts.store.map_folder import open_map
from gslts.store.map_store import MapStore
from gslts.store.measurements import REPAIR
from gslts.store.records import Version

FOLDER = "landmarks"
"""Folder of the files, in a map folder."""
KEY = "landmarks"
"""Key of the SHA-256 of the file, in the manifest."""


def write_landmarks(landmarks: Landmarks, folder: Path) -> str:
    """Write landmarks into a map folder, durable after a power loss.

    Args:
        landmarks: Landmarks of the map.
        folder: Map folder.

    Returns:
        SHA-256 of the file, for the manifest or the cause of a version.

    Raises:
        OSError: The file cannot be written.
    """
    names = [field.name for field in fields(Landmarks)]
    content = save({name: np.ascontiguousarray(getattr(landmarks, name)) for name in names})
    digest = hashlib.sha256(content).hexdigest()
    path = landmark_path(folder, digest)
    path.parent.mkdir(exist_ok=True)
    write_atomic(path, content)
    sync_folder(folder)
    return digest


def has_landmarks(folder: Path) -> bool:
    """Test if a map was made with landmarks.

    Args:
        folder: Map folder.

    Raises:
        OSError: The manifest cannot be read.
        ValueError: The manifest is damaged.
    """
    return _digest_of_manifest(folder) is not None


def read_landmarks(path: Path, gaussian_map: GaussianMap | None = None) -> Landmarks | None:
    """Read the landmarks of a version of a map.

    Args:
        path: Map folder, or a version of it such as MAP@3.
        gaussian_map: Gaussians of that version, if they were read already: they are not read
            again, and the landmarks are theirs even if a newer version was published meanwhile.

    Returns:
        The landmarks, at most `VERSION_BYTES`; None if the map was made without, or is a PLY file.

    Raises:
        OSError: A file cannot be read.
        ValueError: There is no such version, or a file is damaged.
    """
    folder, number = split_version(path)
    if not (folder.is_dir() and has_landmarks(folder)):
        return None
    with open_map(folder) as store:
        versions = store.lineage(number)
        if gaussian_map is None:
            gaussian_map = store.read(versions[-1].number)
    # Two updates that added the same landmarks share one file.
    digests = dict.fromkeys(digest for _, digest in _digests(folder, versions))
    parts = [read_landmark_file(folder, digest).of_gaussians(gaussian_map) for digest in digests]
    return limit_size(concatenate(parts), VERSION_BYTES)


def require_landmarks(path: Path, gaussian_map: GaussianMap | None = None) -> Landmarks:
    """Read the landmarks of a version of a map that must have some; see `read_landmarks`.

    Args:
        path: Map folder, or a version of it such as MAP@3.
        gaussian_map: Gaussians of that version, if they were read already.

    Raises:
        OSError: A file cannot be read.
        ValueError: The map has no landmarks, there is no such version, or a file is damaged.
    """
    landmarks = read_landmarks(path, gaussian_map)
    if landmarks is None:
        raise ValueError(f"{path}: it has no landmarks; gslts map makes maps that do")
    return landmarks


def landmark_problems(store: MapStore) -> list[str]:
    """List the landmark files that are missing or damaged.

    Args:
        store: Store of the map.

    Returns:
        One line per file; none if all files are valid.
    """
    problems = []
    try:
        digests = list(_digests(store.folder, store.versions()))
    except (OSError, ValueError) as error:
        return [f"version 1: {error}"]
    for number, digest in digests:
        try:
            read_landmark_file(store.folder, digest)
        except (OSError, ValueError) as error:
            problems.append(f"version {number}: {error}")
    return problems


def remove_unneeded_landmarks(store: MapStore) -> int:
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
    needed = {landmark_path(folder, digest) for _, digest in _digests(folder, store.versions())}
    missing = [path for path in needed if not path.exists()]
    if missing:
        raise ValueError(f"{missing[0]}: it is missing; {REPAIR}; nothing was removed")
    freed = 0
    for path in sorted((folder / FOLDER).glob(f"*{SUFFIX}")):
        if path not in needed:
            freed += path.stat().st_size
            path.unlink()
    for part in (folder / FOLDER).glob(".*.part"):  # There is no other writer.
        remove_tree(part)
    return freed


def _digests(folder: Path, versions: Iterable[Version]) -> Iterator[tuple[int, str]]:
    """Yield the versions that added landmarks, and the SHA-256 of their files.

    Raises:
        ValueError: The manifest is damaged.
    """
    digest = _digest_of_manifest(folder)
    if digest is not None:
        yield 1, digest
    for version in versions:
        cause = version.cause
        if isinstance(cause, UpdateCause | ExtensionCause) and cause.landmarks is not None:
            yield version.number, cause.landmarks


def _digest_of_manifest(folder: Path) -> str | None:
    """Return the SHA-256 of the landmarks of mapping; None if the map was made without any."""
    digest = read_manifest(folder).get(KEY)
    if digest is None or (isinstance(digest, str) and re.fullmatch("[0-9a-f]{64}", digest)):
        return digest
    raise ValueError(f"{folder / MANIFEST}: {KEY}: expected a SHA-256, got {str(digest)[:80]!r}")


def landmark_path(folder: Path, digest: str) -> Path:
    """Return the path of a file of landmarks.

    Args:
        folder: Map folder.
        digest: SHA-256 of the file.
    """
    return folder / FOLDER / f"{digest}{SUFFIX}"


def read_landmark_file(folder: Path, digest: str) -> Landmarks:
    """Read the landmarks that a version added.

    Args:
        folder: Map folder.
        digest: SHA-256 of the file.

    Returns:
        Landmarks of any Gaussians.

    Raises:
        OSError: The file cannot be read.
        ValueError: The file is damaged.
    """
    path = landmark_path(folder, digest)
    try:
        with name_in_errors(path), path.open("rb") as file:
            content = file.read(MAX_FILE_BYTES + 1)
    except FileNotFoundError:
        raise FileNotFoundError(f"{path}: it is missing; {REPAIR}") from None
    if len(content) > MAX_FILE_BYTES:
        raise ValueError(f"{path}: larger than {MAX_FILE_BYTES >> 20} MiB")
    if hashlib.sha256(content).hexdigest() != digest:
        raise ValueError(f"{path}: it is damaged: its content is not that of its name; {REPAIR}")
    try:
        return Landmarks(**load(content))
    except (SafetensorError, KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{path}: these are no landmarks: {error}") from None
