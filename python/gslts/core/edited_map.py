"""Maps of which some Gaussians are changed, removed or added, also without reading the others."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gslts._core.map import CHUNK_SIZE
from gslts.core.chunks import Arrays, Chunks
from gslts.core.gaussian_map import MIN_BOUNDED, ROW_ARRAYS, GaussianMap
from gslts.types import Floats, Indices


def edit_map(
    gaussian_map: GaussianMap,
    rows: Indices,
    changed: GaussianMap,
    removed: Indices,
    added: GaussianMap,
) -> GaussianMap:
    """Change, remove and add Gaussians. A map that reads its chunks when asked is not read.

    Args:
        gaussian_map: The map.
        rows: [M] rows of Gaussians that change, ascending.
        changed: Their new values.
        removed: [R] rows of Gaussians to remove, ascending, none of `rows`.
        added: New Gaussians; they come last.

    Returns:
        The edited map.
    """
    chunks, size = gaussian_map.chunks, gaussian_map.size - len(removed) + added.size
    if chunks is not None and size >= MIN_BOUNDED:
        edits = _Edits.of(chunks, added).edit(rows, changed, removed, added)
        return GaussianMap.of_chunks(edits.chunks(), gaussian_map.origin)
    arrays, kept = {}, np.ones(gaussian_map.size + added.size, np.bool_)
    kept[removed] = False
    for name in ROW_ARRAYS:
        array = np.concatenate([getattr(gaussian_map, name), getattr(added, name)])
        array[rows] = getattr(changed, name)
        arrays[name] = array if kept.all() else array[kept]
    return GaussianMap(**arrays, origin=gaussian_map.origin)


def remove_from_id(gaussian_map: GaussianMap, first_id: int) -> GaussianMap:
    """Remove the Gaussians with an id or a greater one: what a map had before they were added.

    A map that reads its chunks when asked is not read.

    Args:
        gaussian_map: The map.
        first_id: Smallest id to remove.

    Returns:
        The other Gaussians.
    """
    chunks, none = gaussian_map.chunks, np.zeros(0, np.intp)
    if chunks is None:
        return gaussian_map.select(gaussian_map.ids < first_id)
    newer = np.arange(first_id, gaussian_map.next_id, dtype=np.uint64)
    rows, found = chunks.ids.find(newer)
    empty = gaussian_map.select(none)
    return edit_map(gaussian_map, none, empty, rows[found], empty)


def join_maps(*parts: GaussianMap) -> GaussianMap:
    """Return the Gaussians of several maps with one origin, in their order.

    Args:
        parts: At least one map; no id is in two of them.
    """
    arrays = {name: np.concatenate([getattr(part, name) for part in parts]) for name in ROW_ARRAYS}
    return GaussianMap(**arrays, origin=parts[0].origin)


@dataclass(frozen=True, eq=False)
class _Edits:
    """All that differs between a map whose chunks can be read and an edited one.

    Attributes:
        base: Chunks of the former.
        removed: [R] its rows of removed Gaussians, ascending.
        rows: [M] its rows of changed Gaussians, ascending.
        changed: Their values.
        added: New Gaussians, which come last.
    """

    base: Chunks
    removed: Indices
    rows: Indices
    changed: GaussianMap
    added: GaussianMap

    @classmethod
    def of(cls, chunks: Chunks, other: GaussianMap) -> _Edits:
        """Return the edits that chunks were made by: none if they are read from a file."""
        if isinstance(chunks.edits, cls):
            return chunks.edits
        empty, none = other.select(np.zeros(0, np.intp)), np.zeros(0, np.intp)
        return cls(chunks, none, none, empty, empty)

    @property
    def kept(self) -> int:
        """Number of Gaussians of the base that are in the edited map."""
        return self.base.size - len(self.removed)

    def base_rows(self, rows: Indices) -> Indices:
        """Return the rows in the base of rows of the edited map, which are below `kept`."""
        before = self.removed - np.arange(len(self.removed))
        return rows + np.searchsorted(before, rows, side="right")

    def edit(
        self, rows: Indices, changed: GaussianMap, removed: Indices, added: GaussianMap
    ) -> _Edits:
        """Edit the edited map, as `edit_map` does."""
        own, gone = rows < self.kept, removed[removed < self.kept]
        base_rows, base_gone = self.base_rows(rows[own]), self.base_rows(gone)
        left = np.flatnonzero(~np.isin(self.rows, np.concatenate([base_rows, base_gone])))
        all_rows = np.concatenate([self.rows[left], base_rows])
        values = join_maps(self.changed.select(left), changed.select(np.flatnonzero(own)))
        order = np.argsort(all_rows)
        new_rows, new = rows[~own] - self.kept, changed.select(np.flatnonzero(~own))
        tail = edit_map(self.added, new_rows, new, removed[len(gone) :] - self.kept, added)
        return _Edits(
            self.base,
            np.sort(np.concatenate([self.removed, base_gone])),
            all_rows[order],
            values.select(order),
            tail,
        )

    def chunks(self) -> Chunks:
        """Return the chunks of the edited map."""
        boxes, max_log_scales = self._bounds()
        base, names = self.base, [name for name in ROW_ARRAYS if name != "features"]
        # Consecutive chunks are read from common ones.
        read = lru_cache(2)(base.read)
        read_features = lru_cache(2)(lambda source: {"features": base.read_features(source)})
        return replace(
            base,
            ids=base.ids.edit(self.removed, self.added.ids),
            boxes=boxes,
            max_log_scales=max_log_scales,
            read=lambda chunk: self._read(chunk, names, read),
            read_features=lambda chunk: self._read(chunk, ["features"], read_features)["features"],
            edits=self,
        )

    def _read(
        self, chunk: int, names: Sequence[str], read: Callable[[int], Arrays]
    ) -> dict[str, NDArray[Any]]:
        """Return arrays of a chunk of the edited map; `read` returns those of one of the base."""
        first = chunk * CHUNK_SIZE
        rows = self.base_rows(np.arange(first, min(first + CHUNK_SIZE, self.kept)))
        tail = slice(max(first - self.kept, 0), max(first + CHUNK_SIZE - self.kept, 0))
        sources = [
            (read(source), rows[rows // CHUNK_SIZE == source] - source * CHUNK_SIZE)
            for source in np.unique(rows // CHUNK_SIZE).tolist()
        ]
        _, places, values = np.intersect1d(rows, self.rows, True, return_indices=True)
        arrays = {}
        for name in names:
            parts = [found[name][own] for found, own in sources]
            arrays[name] = np.concatenate([*parts, getattr(self.added, name)[tail]])
            arrays[name][places] = getattr(self.changed, name)[values]
        return arrays

    def _bounds(self) -> tuple[Floats, Floats]:
        """Return boxes [C,2,3] and logs of the largest standard deviations [C] of the chunks."""
        size = self.kept + self.added.size
        count = -(-size // CHUNK_SIZE)
        boxes = np.tile([[np.inf], [-np.inf]], (count, 1, 3))
        max_log_scales = np.full(count, -np.inf)

        def include(chunks: Indices, low: Floats, high: Floats, log_scales: Floats) -> None:
            np.minimum.at(boxes[:, 0], chunks, low)
            np.maximum.at(boxes[:, 1], chunks, high)
            np.maximum.at(max_log_scales, chunks, log_scales)

        ends = np.minimum(np.arange(len(self.base.boxes) + 1) * CHUNK_SIZE, self.base.size)
        ends -= np.searchsorted(self.removed, ends)  # In the edited map.
        left = np.flatnonzero(ends[1:] > ends[:-1])
        for rows in (ends[left], ends[left + 1] - 1):  # A chunk of the base is in at most two.
            low, high = self.base.boxes[left].swapaxes(0, 1)
            include(rows // CHUNK_SIZE, low, high, self.base.max_log_scales[left])
        changed_rows = self.rows - np.searchsorted(self.removed, self.rows)
        for rows, part in (
            (changed_rows, self.changed),
            (self.kept + np.arange(self.added.size), self.added),
        ):
            means = part.means.astype(np.float64)
            include(rows // CHUNK_SIZE, means, means, part.log_scales.max(axis=1, initial=-np.inf))
        return boxes, max_log_scales
