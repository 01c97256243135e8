"""Landmark files in a map folder: a landmark names its Gaussian, see `gslts.store.added_files`."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

from gslts.core.gaussian_map import GaussianMap
from gslts.localization.constants import MAX_FILE_BYTES, VERSION_BYTES
from gslts.localization.landmarks import Landmarks, concatenate, limit_size
from gslts.store.added_files import AddedFiles
from gslts.store.manifest import split_version
from gslts.store.map_folder import open_map

LANDMARK_FILES = AddedFiles("landmarks", MAX_FILE_BYTES)
"""The files."""


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
    return LANDMARK_FILES.write({name: getattr(landmarks, name) for name in names}, folder)


def has_landmarks(folder: Path) -> bool:
    """Test if a map was made with landmarks.

    Args:
        folder: Map folder.

    Raises:
        OSError: The manifest cannot be read.
        ValueError: The manifest is damaged.
    """
    return LANDMARK_FILES.digest_of_manifest(folder) is not None


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
    digests = dict.fromkeys(digest for _, digest in LANDMARK_FILES.digests(folder, versions))
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
    arrays = LANDMARK_FILES.read(folder, digest)
    with LANDMARK_FILES.name_in_errors(folder, digest):
        return Landmarks(**arrays)
