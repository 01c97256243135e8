"""Measurements of a map: what its recordings tell of its Gaussians, and what they measured.

Ids are never used again, so that one list serves all versions from the one on that it was made for;
what an update adds is not listed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gslts.store.recorded_depths import NO_RECORDED_DEPTHS, RecordedDepths
from gslts.types import Bools, Floats32, Indices, UInts64

TYPICAL_ERRORS = (0.012, 0.05)
"""Errors of depth, m, and colours where nothing is known: between those of simulated homes and of
real rooms."""
TYPICAL_NOISE = (0.0083, 0.002)
"""Noise of the depth, m and 1/m, where nothing is known: about a consumer depth camera with a map
whose poses err by millimetres."""


@dataclass(frozen=True, eq=False)
class Measurements:
    """Comparison of a map with its recordings, for each Gaussian.

    Behind windows, in black skies and on dark surfaces a sensor measures nothing, and mapping puts
    Gaussians anywhere along the ray: these are not measured.

    Args:
        ids: [M] ids of Gaussians, rising.
        is_measured: [M] False for those that no depth confirms.
        errors: [M,2] mean absolute errors where a training frame shows the surface: of the rendered
            depth, m, and of the rendered colours, summed over the channels; NaN where unknown.
        noise: (a, b), m and 1/m: the standard deviation of the difference of measured and rendered
            depths z of an unchanged surface is a + b z^2.
        depths: Small depth images of the recordings.

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

    def of_new(self, first_id: int) -> Measurements:
        """Return the measurements without those of older Gaussians.

        Args:
            first_id: Id of the first new Gaussian.
        """
        new = self.ids >= first_id
        return replace(
            self, ids=self.ids[new], is_measured=self.is_measured[new], errors=self.errors[new]
        )

    def extended(self, by: Measurements) -> Measurements:
        """Return the measurements with those of an extension of the map, but the same noise.

        Args:
            by: Of newer Gaussians.

        Raises:
            ValueError: An id is not newer.
        """
        return Measurements(
            np.concatenate([self.ids, by.ids]),
            np.concatenate([self.is_measured, by.is_measured]),
            np.concatenate([self.errors, by.errors]),
            self.noise,
            self.depths.extended(by.depths),
        )

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
