"""Chunks of a large map, which are read when they are asked for."""

from __future__ import annotations

import mmap
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gslts._core.map import CHUNK_SIZE, ChunkBounds
from gslts.core.id_runs import IdRuns
from gslts.types import Floats, Indices, UInts64

Arrays = Mapping[str, NDArray[Any]]
"""Arrays of a map by name."""


@dataclass(frozen=True, eq=False)
class Chunks:
    """Runs of `CHUNK_SIZE` consecutive Gaussians of a map, and what is known before they are read.

    Args:
        ids: Of all N Gaussians.
        layout: Arrays with a row per Gaussian, without rows.
        boxes: [C,2,3] lowest and highest centres of each chunk, m, relative to the origin, or a
            larger box.
        max_log_scales: [C] log of the largest standard deviation of each chunk in m, or more.
        read: Returns the arrays of a chunk.
        edits: How they were made from the chunks of another map, for `gslts.core.edited_map`.
    """

    ids: IdRuns
    layout: Arrays
    boxes: Floats
    max_log_scales: Floats
    read: Callable[[int], Arrays]
    edits: object = None

    @property
    def size(self) -> int:
        """Number of Gaussians, N."""
        return self.ids.size

    def rows(self, chunk: int) -> slice:
        """Return the rows of a chunk.

        Args:
            chunk: Number of the chunk.
        """
        return slice(chunk * CHUNK_SIZE, min((chunk + 1) * CHUNK_SIZE, self.size))

    def of_rows(self, rows: NDArray[Any]) -> Indices:
        """Return the chunks that hold some rows, ascending.

        Args:
            rows: [M] rows.
        """
        marks = np.zeros(len(self.boxes), np.bool_)
        marks[rows // CHUNK_SIZE] = True
        return np.flatnonzero(marks)


class ChunkMemory:
    """Memory for all Gaussians of a map, of which the system provides what is written to.

    Several threads may use it.

    Args:
        chunks: Of the map.
        shared: Arrays with all rows that `read` of the chunks fills, by name.

    Attributes:
        chunks: Of the map.
        arrays: All arrays, with all rows; rows of chunks that were not loaded are zero.
    """

    def __init__(self, chunks: Chunks, shared: Arrays | None = None) -> None:
        self.chunks = chunks
        self._own = {
            name: _reserve((chunks.size, *array.shape[1:]), array.dtype)
            for name, array in chunks.layout.items()
            if name not in (shared or {})
        }
        self.arrays = {**(shared or {}), **self._own}
        self._missing = np.ones(len(chunks.boxes), np.bool_)
        self._lock = threading.Lock()

    def load(self, chunks: NDArray[Any]) -> None:
        """Read chunks that are not in memory yet.

        Args:
            chunks: [K] their numbers.

        Raises:
            OSError: A chunk cannot be read.
            ValueError: A chunk is damaged.
        """
        if not self._missing[chunks].any():
            return
        with self._lock:
            for chunk in chunks[self._missing[chunks]].tolist():
                rows, found = self.chunks.rows(chunk), self.chunks.read(chunk)
                for name, array in self._own.items():
                    array[rows] = found[name]
                self._missing[chunk] = False

    def load_all(self) -> None:
        """Read all chunks; raises as `load`."""
        self.load(np.arange(len(self._missing)))

    def read(self, chunk: int) -> Arrays:
        """Return the arrays of a chunk, without a copy; raises as `load`.

        Args:
            chunk: Number of the chunk.
        """
        self.load(np.array([chunk]))
        rows = self.chunks.rows(chunk)
        return {name: array[rows] for name, array in self.arrays.items()}

    def bounds(self) -> ChunkBounds:
        """Return the bounds of the chunks, with which renderers load what they read."""
        return ChunkBounds(
            size=self.chunks.size,
            boxes=self.chunks.boxes,
            max_log_scales=self.chunks.max_log_scales,
            load=self.load,
        )

    def with_features(self, features_of: Callable[[UInts64], NDArray[Any]]) -> ChunkMemory:
        """Return the memory with other features, which are computed when a chunk is loaded.

        Args:
            features_of: Returns the features [M,D] of Gaussians by their ids [M].
        """
        layout = {**self.chunks.layout, "features": features_of(np.zeros(0, np.uint64))}

        def read(chunk: int) -> Arrays:
            arrays = self.read(chunk)
            return {**arrays, "features": features_of(arrays["ids"])}

        chunks = replace(self.chunks, layout=layout, read=read, edits=None)
        shared = {name: array for name, array in self.arrays.items() if name != "features"}
        return ChunkMemory(chunks, shared)


def _reserve(shape: tuple[int, ...], dtype: np.dtype[Any]) -> NDArray[Any]:
    """Return an array of zeros that takes memory where it is written, page by page."""
    length = prod(shape) * dtype.itemsize
    if length == 0:
        return np.zeros(shape, dtype)
    pages = mmap.mmap(-1, length, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    # Huge pages, which arrays of NumPy get, would take 2 MiB for each array of a chunk of 50 KiB.
    pages.madvise(mmap.MADV_NOHUGEPAGE)
    return np.frombuffer(pages, dtype).reshape(shape)
