"""Ids of the Gaussians of a map as runs of consecutive numbers: known without reading the map."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gslts.types import Bools, Indices, UInts64


@dataclass(frozen=True, eq=False)
class IdRuns:
    """Rising ids; a map as it was made is one run, and each removed Gaussian may split one.

    Args:
        size: N, number of ids.
        rows: [R] first row of each run, rising from 0.
        first_ids: [R] id at that row.

    Raises:
        ValueError: The ids do not rise.
    """

    size: int
    rows: Indices
    first_ids: UInts64

    def __post_init__(self) -> None:
        ends = np.append(self.rows[1:], self.size)
        rising = (ends > self.rows).all() and (self.rows[:1] == 0).all()
        last_ids = self.first_ids + (ends - self.rows - 1).astype(np.uint64)
        rising &= (last_ids >= self.first_ids).all()  # Otherwise they exceed 64 bits.
        if not rising or (last_ids[:-1] >= self.first_ids[1:]).any():
            raise ValueError("IdRuns: ids must rise from Gaussian to Gaussian")
        if (len(self.rows) == 0) != (self.size == 0):
            raise ValueError(f"IdRuns: expected {self.size} ids")

    @classmethod
    def of(cls, ids: UInts64) -> IdRuns:
        """Return the runs of ids.

        Args:
            ids: [N] rising.
        """
        starts = np.ones(len(ids), np.bool_)
        starts[1:] = ids[1:] - ids[:-1] != 1
        rows = np.flatnonzero(starts)
        return cls(len(ids), rows, ids[rows])

    @property
    def next_id(self) -> int:
        """Number greater than all ids."""
        return int(self.at(np.array([self.size - 1]))[0]) + 1 if self.size else 0

    def at(self, rows: NDArray[np.integer]) -> UInts64:
        """Return the ids at some rows.

        Args:
            rows: [M] rows.
        """
        run = np.searchsorted(self.rows, rows, side="right") - 1
        ids: UInts64 = self.first_ids[run] + (rows - self.rows[run]).astype(np.uint64)
        return ids

    def find(self, ids: UInts64) -> tuple[Indices, Bools]:
        """Return the rows [M] of ids [M], and True for those that are there.

        Args:
            ids: [M] of Gaussians.
        """
        if self.size == 0:
            return np.zeros(len(ids), np.intp), np.zeros(len(ids), np.bool_)
        run = np.maximum(np.searchsorted(self.first_ids, ids, side="right") - 1, 0)
        ends = np.append(self.rows[1:], self.size)
        # Offsets below 0 wrap around to large numbers.
        offsets = ids - self.first_ids[run]
        found = offsets < (ends - self.rows)[run].astype(np.uint64)
        rows = self.rows[run] + np.where(found, offsets, 0).astype(np.intp)
        return rows, found

    def edit(self, removed: Indices, added: UInts64) -> IdRuns:
        """Return the ids without those of some rows, and with higher ones at the end.

        Args:
            removed: [K] rows, ascending.
            added: [A] rising ids above all others.
        """
        starts = np.unique(np.concatenate([self.rows, removed + 1]))
        starts = np.setdiff1d(starts[starts < self.size], removed, assume_unique=True)
        kept, new = self.size - len(removed), IdRuns.of(added)
        rows = starts - np.searchsorted(removed, starts)
        return IdRuns(
            kept + new.size,
            np.concatenate([rows, kept + new.rows]),
            np.concatenate([self.at(starts), new.first_ids]),
        )
