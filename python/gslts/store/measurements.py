"""Measurements of a map: what its recording tells of its Gaussians, and what it measured.

Ids are never used again, so that one list serves all versions; what an update adds is not listed.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load, save

from gslts.io.atomic_files import name_in_errors, sync_folder, write_atomic
from gslts.store.manifest import read_manifest, split_version
from gslts.store.recorded_depths import NO_RECORDED_DEPTHS, RecordedDepths
from gslts.types import Bools, Floats32, Indices, UInts64

FILE, KEY = "measurements.safetensors", "measurements"
"""Name of the file in a map folder, and key of its SHA-256 in the manifest."""
MAX_BYTES = 1 << 30
"""Bounds the memory for a hostile file; 60 million Gaussians take less."""
REPAIR = "copy it from a backup, or make the map again with gslts map"
"""Next step for error messages about a missing or damaged file."""
TYPICAL_ERRORS = (0.012, 0.05)
"""Errors of depth, m, and colours where nothing is known: between those of simulated homes and of
real rooms."""
TYPICAL_NOISE = (0.0083, 0.002)
"""Noise of the depth, m and 1/m, where nothing is known: about a consumer depth camera with a map
whose poses err by millimetres."""


@dataclass(frozen=True, eq=False)
class Measurements:
    """Comparison of a map with its recording, for each Gaussian.

    Behind windows, in black skies and on dark surfaces a sensor measures nothing, and mapping puts
    Gaussians anywhere along the ray: these are not measured.

    Args:
        ids: [M] ids of Gaussians, rising.
        is_measured: [M] False for those that no depth confirms.
        errors: [M,2] mean absolute errors where a training frame shows the surface: of the rendered
            depth, m, and of the rendered colours, summed over the channels; NaN where unknown.
        noise: (a, b), m and 1/m: the standard deviation of the difference of measured and rendered
            depths z of an unchanged surface is a + b z^2.
        depths: Small depth images of the recording.

    Raises:
        ValueError: The arrays do not fit together, or a number is out of range.
    """

    ids: UInts64
    is_measured: Bools
    errors: Floats32
    noise: tuple[float, float] = TYPICAL_NOISE
    depths: RecordedDepths = NO_RECORDED_DEPTHS

    def __post_init__(self) -> None:
        count = len(self.ids)
        for name, dtype, shape in (
            ("ids", np.uint64, (count,)),
            ("is_measured", np.bool_, (count,)),
            ("errors", np.float32, (count, 2)),
        ):
            array = getattr(self, name)
            if array.dtype != dtype or array.shape != shape:
                raise ValueError(
                    f"Measurements: {name}: expected {np.dtype(dtype)} {shape}, got {array.dtype} "
                    f"{array.shape}"
                )
        if (self.ids[1:] <= self.ids[:-1]).any():
            raise ValueError("Measurements: ids must rise")
        if np.isinf(self.errors).any() or (self.errors < 0).any():
            raise ValueError("Measurements: errors must not be negative or infinite")
        if not (np.isfinite(self.noise).all() and min(self.noise) >= 0 and max(self.noise) > 0):
            raise ValueError(f"Measurements: noise must be positive, got {self.noise}")

    def is_measured_of(self, ids: UInts64) -> Bools:
        """Return which Gaussians a depth confirms; those that are not listed count.

        Args:
            ids: [N] of Gaussians.
        """
        result = np.ones(len(ids), np.bool_)
        rows, found = self._find(ids)
        result[found] = self.is_measured[rows]
        return result

    def errors_of(self, ids: UInts64) -> Floats32:
        """Return the errors of Gaussians, typical ones where they are unknown.

        Args:
            ids: [N] of Gaussians.

        Returns:
            [N,2] as `errors`.
        """
        result = np.full((len(ids), 2), np.nan, np.float32)
        rows, found = self._find(ids)
        result[found] = self.errors[rows]
        return np.where(np.isfinite(result), result, np.array(TYPICAL_ERRORS, np.float32))

    def _find(self, ids: UInts64) -> tuple[Indices, Bools]:
        """Return the rows of the ids that are listed, and which of `ids` they are."""
        rows = np.searchsorted(self.ids, ids)
        found = rows < len(self.ids)
        found[found] = self.ids[rows[found]] == ids[found]
        return rows[found], found


NO_MEASUREMENTS = Measurements(
    np.zeros(0, np.uint64), np.zeros(0, np.bool_), np.zeros((0, 2), np.float32)
)
"""Measurements of a map of which nothing is known."""


def write_measurements(measurements: Measurements, folder: Path) -> str:
    """Write measurements into a map folder, durable after a power loss.

    Args:
        measurements: Of the map.
        folder: Map folder.

    Returns:
        SHA-256 of the file, for the manifest.

    Raises:
        OSError: The file cannot be written.
    """
    content = save(
        {
            "ids": np.ascontiguousarray(measurements.ids),
            "is_measured": np.ascontiguousarray(measurements.is_measured),
            "errors": np.ascontiguousarray(measurements.errors),
            "noise": np.array(measurements.noise, np.float64),
            **measurements.depths.to_arrays(),
        }
    )
    write_atomic(folder / FILE, content)
    sync_folder(folder)
    return hashlib.sha256(content).hexdigest()


def read_measurements(path: Path) -> Measurements:
    """Read the measurements of a map.

    Args:
        path: Map folder, a version of it such as MAP@3, or a PLY file.

    Returns:
        The measurements; none for a PLY file or an imported map.

    Raises:
        OSError: The file cannot be read.
        ValueError: The file is damaged.
    """
    folder, _ = split_version(path)
    digest = read_manifest(folder).get(KEY) if folder.is_dir() else None
    if digest is None:
        return NO_MEASUREMENTS
    file = folder / FILE
    try:
        with name_in_errors(file), file.open("rb") as opened:
            content = opened.read(MAX_BYTES + 1)
    except FileNotFoundError:
        raise FileNotFoundError(f"{file}: it is missing; {REPAIR}") from None
    if len(content) > MAX_BYTES or hashlib.sha256(content).hexdigest() != digest:
        raise ValueError(f"{file}: it is damaged: the manifest has another checksum; {REPAIR}")
    try:
        arrays = load(content)
        constant_m, per_m = arrays["noise"].tolist()
        return Measurements(
            arrays["ids"],
            arrays["is_measured"],
            arrays["errors"],
            (constant_m, per_m),
            RecordedDepths.from_arrays(arrays),
        )
    except (SafetensorError, KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{file}: these are no measurements: {error}") from None


def measurement_problems(folder: Path) -> list[str]:
    """Check the file of a map.

    Args:
        folder: Map folder.

    Returns:
        One line if the file is missing or damaged; none if it is valid.
    """
    try:
        read_measurements(folder)
    except (OSError, ValueError) as error:
        return [str(error)]
    return []
