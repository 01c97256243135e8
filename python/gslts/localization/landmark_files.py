"""Landmarks in the folder of a map, where they live with its versions.

The manifest names the file of those that the map was made with, and the cause of a version the file
of those that came with it, each by what is in it. Nothing tells which ones are gone: a landmark
names the Gaussian that it sits on, so that those of a version are all on the way to it whose
Gaussian is there. What an update removes is no landmark from then on, and is one again when an
older version is restored.
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
from gslts.localization.landmarks import Landmarks, bounded, joined
from gslts.store.blobs import SUFFIX
from gslts.store.causes import UpdateCause
from gslts.store.manifest import MANIFEST, read_manifest, split_version
from gslts.store.map_folder import open_map
from gslts.store.map_store import MapStore
from gslts.store.records import Version

FOLDER = "landmarks"
"""Of their files, in the folder of a map."""
KEY = "landmarks"
"""Of the SHA-256 of a file, in the manifest and in causes."""
MOST_FILE_BYTES = 16 << 20
MOST_BYTES = 8 << 20
"""Of the landmarks of a version: twice those that a map is made with. If updates brought more, an
even share of those of each keyframe is taken."""
REPAIR = "copy it from a backup, or make the map again with gslts map"

_DIGEST = re.compile("[0-9a-f]{64}")
_ARRAYS = tuple(field.name for field in fields(Landmarks))


def keep_landmarks(landmarks: Landmarks, folder: Path) -> str:
    """Writes them into the folder of a map, so that they outlast a power cut.

    Returns:
        The SHA-256 of their file, for the manifest or the cause of a version.

    Raises:
        OSError: They cannot be written.
    """
    content = _content(landmarks)
    digest = hashlib.sha256(content).hexdigest()
    path = _path_of(folder, digest)
    path.parent.mkdir(exist_ok=True)
    write_atomic(path, content)
    sync_folder(folder)
    return digest


def digest_of(landmarks: Landmarks) -> str:
    """What `keep_landmarks` returns for them."""
    return hashlib.sha256(_content(landmarks)).hexdigest()


def has_landmarks(folder: Path) -> bool:
    """Whether a map was made with landmarks.

    Args:
        folder: Of the map.

    Raises:
        OSError: The manifest cannot be read.
        ValueError: It is damaged.
    """
    return _digest_of_manifest(folder) is not None


def read_landmarks(path: Path, gaussian_map: GaussianMap | None = None) -> Landmarks | None:
    """The landmarks of a version; None if the map was made without any, or is a PLY file.

    Args:
        path: A map folder, or a version of it such as MAP@3.
        gaussian_map: That version, if it was read already: it is not read again, and the landmarks
            are of its Gaussians although another one may be the newest now.

    Raises:
        OSError: A file cannot be read.
        ValueError: There is no such version, or a file is damaged.
    """
    folder, number = split_version(path)
    if not (folder.is_dir() and has_landmarks(folder)):
        return None
    with open_map(folder) as store:
        way = store.lineage(number)
        ids = (store.read(way[-1].number) if gaussian_map is None else gaussian_map).ids
    # Two updates that found the same have one file.
    digests = dict.fromkeys(digest for _, digest in _digests(folder, way))
    parts = [_read(folder, digest).living(ids) for digest in digests]
    return bounded(joined(parts), MOST_BYTES)


def require_landmarks(path: Path, gaussian_map: GaussianMap | None = None) -> Landmarks:
    """As `read_landmarks`.

    Raises:
        OSError: A file cannot be read.
        ValueError: The map was made without any, or as for `read_landmarks`.
    """
    landmarks = read_landmarks(path, gaussian_map)
    if landmarks is None:
        raise ValueError(f"{path}: it has no landmarks; gslts map makes maps that do")
    return landmarks


def landmark_problems(store: MapStore) -> list[str]:
    """Every file of landmarks that is missing or damaged, in one line each; none if all is well.

    Args:
        store: Of the map.
    """
    found = []
    try:
        digests = list(_digests(store.folder, store.versions()))
    except (OSError, ValueError) as error:
        return [f"version 1: {error}"]
    for number, digest in digests:
        try:
            _read(store.folder, digest)
        except (OSError, ValueError) as error:
            found.append(f"version {number}: {error}")
    return found


def remove_unneeded_landmarks(store: MapStore) -> int:
    """Removes files that no version names, such as those of commits that were stopped.

    Args:
        store: Of the map, writable.

    Returns:
        The bytes that were freed.

    Raises:
        OSError: A file cannot be removed.
        ValueError: What names a file is damaged, or a file that is named is missing.
    """
    folder = store.folder
    needed = {_path_of(folder, digest) for _, digest in _digests(folder, store.versions())}
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
    """Yield the versions that brought landmarks, and the SHA-256 of their files.

    Raises:
        ValueError: The manifest is damaged.
    """
    digest = _digest_of_manifest(folder)
    if digest is not None:
        yield 1, digest
    for version in versions:
        if isinstance(version.cause, UpdateCause) and version.cause.landmarks is not None:
            yield version.number, version.cause.landmarks


def _digest_of_manifest(folder: Path) -> str | None:
    """Return the SHA-256 of the landmarks of mapping; None if the map was made without any."""
    digest = read_manifest(folder).get(KEY)
    if digest is None or (isinstance(digest, str) and _DIGEST.fullmatch(digest)):
        return digest
    raise ValueError(f"{folder / MANIFEST}: {KEY}: expected a SHA-256, got {str(digest)[:80]!r}")


def _path_of(folder: Path, digest: str) -> Path:
    return folder / FOLDER / f"{digest}{SUFFIX}"


def _content(landmarks: Landmarks) -> bytes:
    return save({name: np.ascontiguousarray(getattr(landmarks, name)) for name in _ARRAYS})


def _read(folder: Path, digest: str) -> Landmarks:
    path = _path_of(folder, digest)
    try:
        with name_in_errors(path), path.open("rb") as file:
            content = file.read(MOST_FILE_BYTES + 1)
    except FileNotFoundError:
        raise FileNotFoundError(f"{path}: it is missing; {REPAIR}") from None
    if len(content) > MOST_FILE_BYTES:
        raise ValueError(f"{path}: larger than {MOST_FILE_BYTES >> 20} MiB")
    if hashlib.sha256(content).hexdigest() != digest:
        raise ValueError(f"{path}: it is damaged: its content is not that of its name; {REPAIR}")
    try:
        return Landmarks(**load(content))
    except (SafetensorError, KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{path}: these are no landmarks: {error}") from None
