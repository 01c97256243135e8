"""Files of all Gaussians of a version, of which chunks can be read, each with its own checksum.

A snapshot is a safetensors file that begins with what is known of the map before it is read: a
table with bounds and SHA-256 of each chunk of Gaussians, the ids as runs, and the origin. The index
of the versions names the SHA-256 of this head: whatever is read of the file is checked.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable, Mapping
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gslts._core.map import CHUNK_SIZE
from gslts.core.chunks import Arrays, Chunks
from gslts.core.gaussian_map import ROW_ARRAYS, GaussianMap
from gslts.core.id_runs import IdRuns
from gslts.store.blobs import REPAIR, Blobs, missing_file
from gslts.store.records import Blob, Snapshot

PREFIX = "chunks."
"""Of the names of the arrays of the table."""
TABLE = (*(PREFIX + name for name in ("sha256", "boxes", "log_scales", "id_rows", "ids")), "origin")
"""Arrays of the head, which stand before those of the Gaussians."""
MAX_HEADER_BYTES = 1 << 16
"""Bounds the memory for a hostile file; the header takes 1 KiB."""
DTYPES = {"U8": np.uint8, "U64": np.uint64, "I64": np.int64, "F32": np.float32, "F64": np.float64}
"""Types by their names in safetensors."""
_DTYPE_NAMES = {np.dtype(dtype): name for name, dtype in DTYPES.items()}

Layout = Mapping[str, tuple[np.dtype[Any], tuple[int, ...]]]
"""Types and shapes of the arrays of a file by name, in their order."""


def write_snapshot(blobs: Blobs, gaussian_map: GaussianMap) -> Snapshot:
    """Write the snapshot of a map, durably.

    Args:
        blobs: Folder of the file.
        gaussian_map: With rising ids.

    Returns:
        Key, size and checksum of the head, to read it with.

    Raises:
        OSError: The file cannot be written; then there is no new file.
    """
    rows = {name: getattr(gaussian_map, name) for name in ROW_ARRAYS}
    bounds, ids = gaussian_map.view().chunk_bounds("write_snapshot"), IdRuns.of(gaussian_map.ids)
    digests = [
        _digest(array[first : first + CHUNK_SIZE] for array in rows.values())
        for first in range(0, gaussian_map.size, CHUNK_SIZE)
    ]
    checksums = np.frombuffer(b"".join(digests), np.uint8).reshape(-1, 32)
    table = (checksums, bounds.boxes(), bounds.max_log_scales(), ids.rows, ids.first_ids)
    named = dict(zip(TABLE, (*table, gaussian_map.origin), strict=True))
    layout = {name: (array.dtype, array.shape) for name, array in {**named, **rows}.items()}
    head = b"".join([_header(layout), *(array.tobytes() for array in named.values())])
    blob = blobs.write_parts([head, *(array.reshape(-1).view(np.uint8) for array in rows.values())])
    return Snapshot(**dict(blob), head=hashlib.sha256(head).hexdigest())


def open_snapshot(path: Path, snapshot: Snapshot, label: str) -> GaussianMap:
    """Open the map of a snapshot; its chunks are read when they are asked for.

    Args:
        path: Of the file.
        snapshot: Its size, and the checksum of its head.
        label: Start of messages, which names map and version.

    Returns:
        The map, which stays readable if the file is removed from its folder.

    Raises:
        OSError: The file cannot be read.
        ValueError: The head is damaged.
    """
    file = SnapshotFile(path, snapshot, label)
    return GaussianMap.of_chunks(file.chunks(), file.origin)


def require_intact(blobs: Blobs, blob: Blob) -> None:
    """Check a file against its checksum, and name the damaged block of a snapshot.

    Args:
        blobs: Folder of the file.
        blob: The file.

    Raises:
        OSError: The file cannot be read.
        ValueError: The file is damaged.
    """
    file = None
    if isinstance(blob, Snapshot) and blob.head is not None:
        path = blobs.path(blob.key)
        file = SnapshotFile(path, blob, str(path))
    try:
        blobs.verify(blob)
    except ValueError:
        for chunk in range(file.count if file is not None else 0):
            file.read(chunk)
        raise


class SnapshotFile:
    """Reads and checks parts of a snapshot.

    Args:
        path: Of the file.
        snapshot: Its size, and the checksum of its head.
        label: Start of messages.

    Attributes:
        origin: (3,) origin of the map in the world, m.
        count: Number of chunks.

    Raises:
        OSError: The file cannot be read.
        ValueError: The head is damaged.
    """

    def __init__(self, path: Path, snapshot: Snapshot, label: str) -> None:
        self._label = label
        with missing_file(path):
            self._descriptor = os.open(path, os.O_RDONLY)
        try:
            self._layout, table, self._begin = self._read_head(snapshot)
            checksums, self._boxes, self._max_log_scales, rows, first_ids, self.origin = table
            self._ids = IdRuns(self._layout["ids"][1][0], rows, first_ids)
        except (KeyError, TypeError, ValueError, RecursionError) as error:
            raise ValueError(f"{label}: its head is damaged: {error}; {REPAIR}") from None
        self._checksums = [row.tobytes() for row in checksums]
        self.count = len(self._checksums)

    def __del__(self) -> None:
        if hasattr(self, "_descriptor"):
            os.close(self._descriptor)

    def chunks(self) -> Chunks:
        """Return the chunks of the map, which are read from the file when they are asked for."""
        layout = {
            name: np.zeros((0, *shape[1:]), dtype)
            for name, (dtype, shape) in self._layout.items()
            if name in ROW_ARRAYS
        }
        return Chunks(self._ids, layout, self._boxes, self._max_log_scales, self.read)

    def read(self, chunk: int) -> Arrays:
        """Read a chunk.

        Args:
            chunk: Its number.

        Returns:
            The arrays of its Gaussians.

        Raises:
            OSError: The file cannot be read.
            ValueError: The chunk is damaged.
        """
        first = chunk * CHUNK_SIZE
        offset, parts = self._begin, {}
        for name in ROW_ARRAYS:
            dtype, (size, *shape) = self._layout[name]
            row_bytes = prod(shape) * dtype.itemsize
            count = min(CHUNK_SIZE, size - first)
            content = os.pread(self._descriptor, count * row_bytes, offset + first * row_bytes)
            parts[name] = (content, dtype, (count, *shape))
            offset += size * row_bytes
        try:
            if _digest(content for content, _, _ in parts.values()) != self._checksums[chunk]:
                raise ValueError("its checksum does not match")
            arrays = {
                name: np.frombuffer(content, dtype).reshape(shape)
                for name, (content, dtype, shape) in parts.items()
            }
            GaussianMap(**arrays, origin=self.origin)  # Checks all values.
            if (arrays["ids"] != self._ids.at(np.arange(first, first + count))).any():
                raise ValueError("its ids are not those of the head")
        except ValueError as error:
            raise ValueError(
                f"{self._label}: block {chunk + 1} of {self.count} is damaged: {error}; {REPAIR}"
            ) from None
        return arrays

    def _read_head(self, snapshot: Snapshot) -> tuple[Layout, list[NDArray[Any]], int]:
        """Return the layout of the file, the arrays of the head, and the end of the head, bytes."""
        if os.fstat(self._descriptor).st_size != snapshot.size:
            raise ValueError(f"the file has not {snapshot.size} bytes")
        length = int.from_bytes(os.pread(self._descriptor, 8, 0), "little")
        if length > MAX_HEADER_BYTES:
            raise ValueError("the header is too long")
        header = os.pread(self._descriptor, 8 + length, 0)
        layout: Layout = {
            name: (np.dtype(DTYPES[entry["dtype"]]), tuple(entry["shape"]))
            for name, entry in json.loads(header[8:]).items()
        }
        sizes = [prod(shape) * dtype.itemsize for dtype, shape in layout.values()]
        chunks = -(-layout["means"][1][0] // CHUNK_SIZE)
        if (
            list(layout) != [*TABLE, *ROW_ARRAYS]
            or header != _header(layout)
            or len(header) + sum(sizes) != snapshot.size
            or len({layout[name][1][0] for name in ROW_ARRAYS}) != 1
            or layout[TABLE[0]][1] != (chunks, 32)
        ):
            raise ValueError("the header is not that of a snapshot")
        ends = np.cumsum([len(header), *sizes[: len(TABLE)]]).tolist()
        head = os.pread(self._descriptor, ends[-1], 0)
        if hashlib.sha256(head).hexdigest() != snapshot.head:
            raise ValueError("its checksum does not match")
        arrays = [
            np.frombuffer(head[start:end], layout[name][0]).reshape(layout[name][1])
            for name, start, end in zip(TABLE, ends, ends[1:], strict=False)
        ]
        return layout, arrays, ends[-1]


def _header(layout: Layout) -> bytes:
    """Return the header of a safetensors file."""
    entries, end = {}, 0
    for name, (dtype, shape) in layout.items():
        begin, end = end, end + prod(shape) * dtype.itemsize
        entries[name] = {
            "dtype": _DTYPE_NAMES[dtype],
            "shape": list(shape),
            "data_offsets": [begin, end],
        }
    text = json.dumps(entries, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 8)
    return len(text).to_bytes(8, "little") + text


def _digest(parts: Iterable[Any]) -> bytes:
    """Return the SHA-256 of the bytes of some arrays."""
    digest = hashlib.sha256()
    for part in parts:
        digest.update(part)
    return digest.digest()
