"""Chunks of a large map, which are read when they are asked for."""

from __future__ import annotations

import mmap
import threading
from collections.abc import Callable, Iterable, Mapping
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
        read: Returns the arrays of a chunk, but for the features, most of the bytes, which only
            semantics need.
        read_features: Returns the features of a chunk.
        edits: How they were made from the chunks of another map, for `gslts.core.edited_map`.
    """

    ids: IdRuns
    layout: Arrays
    boxes: Floats
    max_log_scales: Floats
    read: Callable[[int], Arrays]
    read_features: Callable[[int], NDArray[Any]]
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
        common: Memory of a map that differs in the features only.

    Attributes:
        chunks: Of the map.
        arrays: All arrays, with all rows; rows of chunks that were not loaded are zero.
    """

    def __init__(self, chunks: Chunks, common: ChunkMemory | None = None) -> None:
        self.chunks = chunks
        names = chunks.layout.keys() - {"features"}
        self._common: _Arrays = (
            _Arrays(chunks, names, chunks.read) if common is None else common._common
        )
        self._features = _Arrays(
            chunks, {"features"}, lambda chunk: {"features": chunks.read_features(chunk)}
        )
        self.arrays = {**self._common.arrays, **self._features.arrays}

    def load(self, chunks: NDArray[Any], *, features: bool = True) -> None:
        """Read chunks that are not in memory yet.

        Args:
            chunks: [K] their numbers.
            features: Read the features as well.

        Raises:
            OSError: A chunk cannot be read.
            ValueError: A chunk is damaged.
        """
        self._common.load(chunks)
        if features:
            self._features.load(chunks)

    def load_all(self, *, features: bool = True) -> None:
        """Read all chunks; raises as `load`.

        Args:
            features: Read the features as well.
        """
        self.load(np.arange(len(self.chunks.boxes)), features=features)

    def peek(self, chunk: int) -> Arrays:
        """Return the arrays of a chunk, which are not kept if they are read; raises as `load`.

        Args:
            chunk: Number of the chunk.
        """
        return {**self._common.peek(chunk), **self._features.peek(chunk)}

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
        ids = self.chunks.ids

        def read_features(chunk: int) -> NDArray[Any]:
            rows = self.chunks.rows(chunk)
            return features_of(ids.at(np.arange(rows.start, rows.stop)))

        layout = {**self.chunks.layout, "features": features_of(np.zeros(0, np.uint64))}
        chunks = replace(self.chunks, layout=layout, read_features=read_features, edits=None)
        return ChunkMemory(chunks, self)


class _Arrays:
    """Some arrays of a map, of whose chunks some are in memory."""

    def __init__(self, chunks: Chunks, names: Iterable[str], read: Callable[[int], Arrays]) -> None:
        self._chunks, self._read = chunks, read
        layout = {name: chunks.layout[name] for name in names}
        self.arrays = {
            name: _reserve((chunks.size, *rows.shape[1:]), rows.dtype)
            for name, rows in layout.items()
        }
        self._missing = np.ones(len(chunks.boxes), np.bool_)
        self._lock = threading.Lock()

    def load(self, chunks: NDArray[Any]) -> None:
        if not self._missing[chunks].any():
            return
        with self._lock:
            for chunk in chunks[self._missing[chunks]].tolist():
                rows, found = self._chunks.rows(chunk), self._read(chunk)
                for name, array in self.arrays.items():
                    array[rows] = found[name]
                self._missing[chunk] = False

    def peek(self, chunk: int) -> Arrays:
        if self._missing[chunk]:
            return self._read(chunk)
        rows = self._chunks.rows(chunk)
        return {name: array[rows] for name, array in self.arrays.items()}


def _reserve(shape: tuple[int, ...], dtype: np.dtype[Any]) -> NDArray[Any]:
    """Return an array of zeros that takes memory where it is written, page by page."""
    length = prod(shape) * dtype.itemsize
    if length == 0:
        return np.zeros(shape, dtype)
    pages = mmap.mmap(-1, length, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    # Huge pages, which arrays of NumPy get, would take 2 MiB for each array of a chunk of 50 KiB.
    pages.madvise(mmap.MADV_NOHUGEPAGE)
    return np.frombuffer(pages, dtype).reshape(shape)
