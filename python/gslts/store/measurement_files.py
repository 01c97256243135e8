"""Measurement files in a map folder, of its recording and of those that extended it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gslts.store.added_files import AddedFiles
from gslts.store.manifest import split_version
from gslts.store.map_folder import open_map
from gslts.store.measurements import NO_MEASUREMENTS, Measurements
from gslts.store.recorded_depths import RecordedDepths

MEASUREMENT_FILES = AddedFiles("measurements", 1 << 30)
"""The files. 60 million Gaussians take less."""


def write_measurements(measurements: Measurements, folder: Path) -> str:
    """Write measurements into a map folder, durable after a power loss.

    Args:
        measurements: Of the Gaussians of a recording.
        folder: Map folder.

    Returns:
        SHA-256 of the file, for the manifest or the cause of a version.

    Raises:
        OSError: The file cannot be written.
    """
    arrays = {
        "ids": measurements.ids,
        "is_measured": measurements.is_measured,
        "errors": measurements.errors,
        "noise": np.array(measurements.noise, np.float64),
        **measurements.depths.to_arrays(),
    }
    return MEASUREMENT_FILES.write(arrays, folder)


def read_measurements(path: Path) -> Measurements:
    """Read the measurements of a version of a map.

    Args:
        path: Map folder, a version of it such as MAP@3, or a PLY file.

    Returns:
        The measurements; none for a PLY file or an imported map.

    Raises:
        OSError: A file cannot be read.
        ValueError: There is no such version, or a file is damaged.
    """
    folder, number = split_version(path)
    if not folder.is_dir():
        return NO_MEASUREMENTS
    with open_map(folder) as store:
        versions = store.lineage(number)
    measurements: Measurements | None = None
    for _, digest in MEASUREMENT_FILES.digests(folder, versions):
        added = read_measurement_file(folder, digest)
        measurements = added if measurements is None else measurements.extended(added)
    return measurements or NO_MEASUREMENTS


def read_measurement_file(folder: Path, digest: str) -> Measurements:
    """Read the measurements that a version added.

    Args:
        folder: Map folder.
        digest: SHA-256 of the file.

    Raises:
        OSError: The file cannot be read.
        ValueError: The file is damaged.
    """
    arrays = MEASUREMENT_FILES.read(folder, digest)
    with MEASUREMENT_FILES.name_in_errors(folder, digest):
        constant_m, per_m = arrays["noise"].tolist()
        return Measurements(
            arrays["ids"],
            arrays["is_measured"],
            arrays["errors"],
            (constant_m, per_m),
            RecordedDepths.from_arrays(arrays),
        )
