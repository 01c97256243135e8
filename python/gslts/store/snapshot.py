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
GROUPS = (tuple(name for name in ROW_ARRAYS if name != "features"), ("features",))
"""Arrays of a chunk with one checksum each: the features are read for semantics alone."""
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
        _digest(rows[name][first : first + CHUNK_SIZE] for name in names)
        for first in range(0, gaussian_map.size, CHUNK_SIZE)
        for names in GROUPS
    ]
    checksums = np.frombuffer(b"".join(digests), np.uint8).reshape(-1, len(GROUPS), 32)
    table = (checksums, bounds.boxes(), bounds.max_log_scales(), ids.rows, ids.first_ids)
    named: dict[str, NDArray[Any]] = dict(zip(TABLE, (*table, gaussian_map.origin), strict=True))
    layout = {name: (array.dtype, array.shape) for name, array in {**named, **rows}.items()}
    head = b"".join([_header(layout), *(array.tobytes() for array in named.values())])
    blob = blobs.write_parts(
        [head, *(array.reshape(-1).view(np.uint8).data for array in rows.values())]
    )
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
    if not isinstance(blob, Snapshot) or blob.head is None:
        blobs.verify(blob)
        return
    path = blobs.path(blob.key)
    file = SnapshotFile(path, blob, str(path))
    try:
        blobs.verify(blob)
    except ValueError:
        file.require_intact()
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
            self._layout, self._starts, table = self._read_head(snapshot)
            self._checksums, self._boxes, self._max_log_scales, *runs, self.origin = table
            self._ids = IdRuns(self._layout["ids"][1][0], *runs)
        except (AttributeError, KeyError, TypeError, ValueError, RecursionError) as error:
            raise ValueError(f"{label}: its head is damaged: {error}; {REPAIR}") from None
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
        return Chunks(
            self._ids, layout, self._boxes, self._max_log_scales, self.read, self.read_features
        )

    def read(self, chunk: int) -> Arrays:
        """Read the arrays of a chunk but for the features; raises as `require_intact`.

        Args:
            chunk: Its number.
        """
        arrays, rows = self._read(chunk, 0), self._rows(chunk)
        try:
            GaussianMap(**arrays, origin=self.origin)  # Checks all values.
            if (arrays["ids"] != self._ids.at(np.arange(rows.start, rows.stop))).any():
                raise ValueError("its ids are not those of the head")
        except ValueError as error:
            raise self._damage_error(chunk, error) from None
        return arrays

    def read_features(self, chunk: int) -> NDArray[Any]:
        """Read the features of a chunk; raises as `require_intact`.

        Args:
            chunk: Its number.
        """
        features = self._read(chunk, 1)["features"]
        if not np.isfinite(features).all():
            raise self._damage_error(chunk, "features: must be finite")
        return features

    def require_intact(self) -> None:
        """Read all chunks.

        Raises:
            OSError: The file cannot be read.
            ValueError: A chunk is damaged.
        """
        for chunk in range(self.count):
            self.read(chunk)
            self.read_features(chunk)

    def _read(self, chunk: int, group: int) -> dict[str, NDArray[Any]]:
        """Read and check the arrays of a group of a chunk."""
        rows, contents = self._rows(chunk), {}
        for name in GROUPS[group]:
            dtype, (_, *shape) = self._layout[name]
            row_bytes = prod(shape) * dtype.itemsize
            start = self._starts[name] + rows.start * row_bytes
            length = (rows.stop - rows.start) * row_bytes
            contents[name] = os.pread(self._descriptor, length, start)
        if _digest(contents.values()) != self._checksums[chunk, group].tobytes():
            raise self._damage_error(chunk, "its checksum does not match")
        return {
            name: np.frombuffer(content, self._layout[name][0]).reshape(
                rows.stop - rows.start, *self._layout[name][1][1:]
            )
            for name, content in contents.items()
        }

    def _rows(self, chunk: int) -> slice:
        return slice(chunk * CHUNK_SIZE, min((chunk + 1) * CHUNK_SIZE, self._ids.size))

    def _damage_error(self, chunk: int, reason: object) -> ValueError:
        return ValueError(
            f"{self._label}: block {chunk + 1} of {self.count} is damaged: {reason}; {REPAIR}"
        )

    def _read_head(self, snapshot: Snapshot) -> tuple[Layout, dict[str, int], list[NDArray[Any]]]:
        """Return the layout of the file, where each array starts, and the arrays of the head."""
        if os.fstat(self._descriptor).st_size != snapshot.size:
            raise ValueError(f"the file has not {snapshot.size} bytes")
        length = int.from_bytes(os.pread(self._descriptor, 8, 0), "little")
        if length > MAX_HEADER_BYTES:
            raise ValueError("the header is too long")
        header = os.pread(self._descriptor, 8 + length, 0)
        layout: Layout = {
            name: (np.dtype(DTYPES[entry["dtype"]]), _parse_shape(entry["shape"]))
            for name, entry in json.loads(header[8:]).items()
        }
        sizes = [prod(shape) * dtype.itemsize for dtype, shape in layout.values()]
        chunks = -(-layout["means"][1][0] // CHUNK_SIZE)
        if (
            list(layout) != [*TABLE, *ROW_ARRAYS]
            or header != _header(layout)
            or len(header) + sum(sizes) != snapshot.size
            or len({layout[name][1][0] for name in ROW_ARRAYS}) != 1
            or layout[TABLE[0]][1] != (chunks, len(GROUPS), 32)
        ):
            raise ValueError("the header is not that of a snapshot")
        starts = dict(zip(layout, np.cumsum([len(header), *sizes]).tolist(), strict=False))
        head = os.pread(self._descriptor, starts[ROW_ARRAYS[0]], 0)
        if hashlib.sha256(head).hexdigest() != snapshot.head:
            raise ValueError("its checksum does not match")
        table = [
            np.frombuffer(head, layout[name][0], prod(layout[name][1]), starts[name]).reshape(
                layout[name][1]
            )
            for name in TABLE
        ]
        return layout, starts, table


def _parse_shape(value: Any) -> tuple[int, ...]:
    counts = value if isinstance(value, list) else []
    if not counts or not all(type(count) is int and 0 <= count < 1 << 48 for count in counts):
        raise ValueError(f"the shape of an array is {value!r:.40}")
    return tuple(counts)


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
