"""Container, JSON and buffers of untrusted glTF files, read within limits and validated.

Source: glTF 2.0 specification, Khronos Group.
"""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, NoReturn, TypeGuard

import numpy as np
from numpy.typing import NDArray

from gslts.io.messages import to_line
from gslts.types import Floats

Tree = dict[str, Any]
MAX_JSON_BYTES = 32 << 20
"""Maximum size of the JSON, bytes: parsed, it takes up to 20 times that. Large scenes keep their
arrays in a GLB."""
MAX_NODES = 50_000
"""Maximum number of nodes; bounds the time that a hostile file takes."""
MAX_NODE_DEPTH = 200
"""Maximum depth of a node: trimesh walks from each node to the root."""
COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
"""Numbers of glTF's component types."""
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
"""Number of components of glTF's accessor types."""
Z_UP = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
"""Rotation [4,4] from glTF's axes, where y is up, to the world."""


class BadFileError(ValueError):
    """A file that cannot be used; the message says why in one line."""


@dataclass(frozen=True, eq=False)
class Accessor:
    """A validated list of numbers or vectors in a buffer view.

    Args:
        view: Index of the buffer view.
        data: Its bytes.
        offset: Of the first row in them, bytes.
        stride: From row to row, bytes.
        count: Number of rows.
        width: Numbers in a row.
        component: Key of `COMPONENTS`.
        normalized: Whether integers stand for numbers from 0 or -1 to 1.
    """

    view: int
    data: memoryview
    offset: int
    stride: int
    count: int
    width: int
    component: int
    normalized: bool

    def rows(self) -> NDArray[Any]:
        """Return [count,width] numbers as they are stored, without a copy."""
        dtype = np.dtype(COMPONENTS[self.component])
        shape, strides = (self.count, self.width), (self.stride, dtype.itemsize)
        return np.ndarray(shape, dtype, self.data, self.offset, strides)


def denormalize(values: NDArray[Any], accessor: Accessor) -> Floats:
    """Convert numbers of an accessor to float64, normalized ones to 0 to 1 or -1 to 1.

    Args:
        values: Of the accessor, any shape.
        accessor: The accessor.

    Returns:
        An array of the same shape.
    """
    numbers = np.array(values, np.float64)
    dtype = np.dtype(COMPONENTS[accessor.component])
    if accessor.normalized and dtype.kind in "iu":
        numbers = np.maximum(numbers / np.iinfo(dtype).max, -1)
    return numbers


class GltfFile:
    """Validated JSON of a file, and access to its buffers.

    Args:
        path: A .glb or .gltf file.

    Attributes:
        max_bytes: Maximum size of a file and all that it refers to, bytes.

    Raises:
        OSError: A file cannot be read.
        ValueError: It is not a glTF 2.0 file, damaged, too large, or needs an unknown extension.
    """

    max_bytes: ClassVar[int] = (1 << 32) - 1  # What the length of a GLB can say.

    def __init__(self, path: Path) -> None:
        self.path = path
        self._budget = self.max_bytes
        data = self._read(path)
        self._binary: memoryview | None = None
        self._buffers: dict[int, memoryview] = {}
        self._lists: dict[str, list[Tree]] = {}
        if data[:4] == b"glTF":
            data = self._json_of_glb(data)
        if len(data) > MAX_JSON_BYTES:
            self.reject(f"its JSON has {len(data)} bytes, more than {MAX_JSON_BYTES}")
        self.tree = self._parse(data)
        self._check_nodes()

    def reject(self, problem: str) -> NoReturn:
        """Raise a BadFileError that names the file, in one line.

        Args:
            problem: What is wrong.
        """
        raise BadFileError(f"{self.path}: {to_line(problem)[:300]}")

    def supports(self, extension: str) -> bool:
        """Return whether a file may require an extension; this class knows none.

        Args:
            extension: Its name.
        """
        del extension
        return False

    def items(self, key: str) -> list[Tree]:
        """Return one of the lists of the JSON; empty if it is missing.

        Args:
            key: Such as `nodes`.

        Raises:
            BadFileError: It is not a list of objects.
        """
        if key not in self._lists:
            found = self.tree.get(key, [])
            if not isinstance(found, list) or not all(isinstance(item, dict) for item in found):
                self.reject(f"{key}: expected a list of objects")
            self._lists[key] = found
        return self._lists[key]

    def item(self, key: str, index: Any) -> Tree:
        """Return an entry of one of the lists of the JSON.

        Args:
            key: Such as `nodes`.
            index: Of the entry, unvalidated.

        Raises:
            BadFileError: There is no such entry.
        """
        found = self.items(key)
        if not is_count(index) or index >= len(found):
            self.reject(f"{key}[{index}] does not exist")
        return found[index]

    def label(self, node: int) -> str:
        """Return the name of a node for messages.

        Args:
            node: Its index.
        """
        name = self.items("nodes")[node].get("name")
        return f"node {node} ({name})" if name else f"node {node}"

    def view(self, index: Any) -> memoryview:
        """Return the bytes of a buffer view.

        Args:
            index: Of the view, unvalidated.

        Raises:
            OSError: A file cannot be read.
            BadFileError: There is no such view, or its buffer is too short.
        """
        view = self.item("bufferViews", index)
        buffer = self._buffer(view.get("buffer"))
        start, length = view.get("byteOffset", 0), view.get("byteLength")
        if not is_count(start) or not is_count(length) or start + length > len(buffer):
            self.reject(
                f"bufferViews[{index}] has {length} bytes from {start} on, its buffer has "
                f"{len(buffer)}"
            )
        return buffer[start : start + length]

    def accessor(self, index: Any, kinds: tuple[str, ...]) -> Accessor:
        """Return an accessor after a check that its buffer holds what it declares.

        Args:
            index: Of the accessor, unvalidated.
            kinds: Types that it may have, such as `VEC3`.

        Raises:
            OSError: A file cannot be read.
            BadFileError: There is no such accessor, it is damaged, sparse, or has another type.
        """
        accessor = self.item("accessors", index)
        count, component = accessor.get("count"), accessor.get("componentType")
        offset = accessor.get("byteOffset", 0)
        if (
            accessor.get("type") not in kinds
            or not is_count(component)
            or component not in COMPONENTS
            or not is_count(count)
            or count == 0
        ):
            self.reject(f"accessors[{index}] is not a list of {' or '.join(kinds)}")
        if "sparse" in accessor or "bufferView" not in accessor:
            self.reject(f"accessors[{index}] is sparse or has no data, not supported")
        view, width = accessor["bufferView"], WIDTHS[accessor["type"]]
        data = self.view(view)
        row = np.dtype(COMPONENTS[component]).itemsize * width
        stride = self.item("bufferViews", view).get("byteStride", row)
        if not is_count(stride) or stride < row or not is_count(offset):
            self.reject(f"accessors[{index}]: rows of {row} bytes, {stride} apart")
        if offset + (count - 1) * stride + row > len(data):
            self.reject(
                f"accessors[{index}] says {count} entries, its {len(data)} bytes hold fewer"
            )
        normalized = accessor.get("normalized") is True
        return Accessor(view, data, offset, stride, count, width, component, normalized)

    def resource(self, uri: Any) -> memoryview:
        """Return the bytes of a URI; this class reads none.

        Args:
            uri: Of a buffer, unvalidated.

        Raises:
            BadFileError: Always.
        """
        self.reject(
            f"a buffer has the URI {str(uri)[:80]!r}; only buffers inside of a .glb file are read"
        )

    def roots(self) -> list[int]:
        """Return the root nodes of the default scene.

        Raises:
            BadFileError: A root does not exist, or is a child of another node.
        """
        scenes = self.items("scenes")
        nodes = range(len(self.items("nodes")))
        if not scenes:
            return [node for node in nodes if self.parents[node] is None]
        roots = self.item("scenes", self.tree.get("scene", 0)).get("nodes", [])
        if not isinstance(roots, list) or any(
            not is_count(node) or node not in nodes or self.parents[node] is not None
            for node in roots
        ):
            self.reject("a root of the scene does not exist or is a child of another node")
        return list(dict.fromkeys(roots))

    @cached_property
    def parents(self) -> list[int | None]:
        """Parent of each node; None for roots."""
        nodes = self.items("nodes")
        parents: list[int | None] = [None] * len(nodes)
        for index, node in enumerate(nodes):
            for child in as_list(node.get("children")):
                if not is_count(child) or child >= len(nodes):
                    self.reject(f"{self.label(index)}: its child {child} does not exist")
                if parents[child] is not None or child == index:
                    self.reject(f"{self.label(child)} is a child more than once")
                parents[child] = index
        return parents

    def _check_nodes(self) -> None:
        count = len(self.items("nodes"))
        if count > MAX_NODES:
            self.reject(f"it has {count} nodes, more than {MAX_NODES}")
        depths = [0 if parent is None else -1 for parent in self.parents]
        for node in range(count):
            path: list[int] = []
            at: int | None = node
            while at is not None and depths[at] < 0:
                if len(path) >= MAX_NODE_DEPTH:
                    self.reject(
                        f"{self.label(node)} is in a cycle or below {MAX_NODE_DEPTH} others"
                    )
                path.append(at)
                at = self.parents[at]
            for below in reversed(path):
                depths[below] = depths[self.parents[below] or 0] + 1

    def _read(self, path: Path) -> bytes:
        if not path.exists():
            raise FileNotFoundError(f"{path} does not exist")
        if not path.is_file():
            self.reject(f"{path.name} is not a file")
        size = path.stat().st_size
        self._budget -= size
        if self._budget < 0:
            self.reject(f"with {path.name} of {size} bytes it is larger than {self.max_bytes}")
        with path.open("rb") as file:
            return file.read(size)

    def _json_of_glb(self, data: bytes) -> bytes:
        """Return the JSON of a GLB, and keep its binary chunk."""
        if len(data) < 20:
            self.reject(f"it ends after {len(data)} bytes, before its JSON")
        version, length, json_length, kind = struct.unpack("<II I4s", data[4:20])
        if version != 2:
            self.reject(f"it is glTF {version}, not 2")
        if length != len(data):
            self.reject(f"its header says {length} bytes, it has {len(data)}")
        if kind != b"JSON" or 20 + json_length > length:
            self.reject(f"its first chunk, {json_length} bytes of {kind!r}, is not its JSON")
        rest = 20 + json_length
        if rest + 8 <= length:
            binary_length, kind = struct.unpack("<I4s", data[rest : rest + 8])
            if rest + 8 + binary_length > length:
                self.reject(f"its binary chunk says {binary_length} bytes, more than there are")
            if kind == b"BIN\0":
                self._binary = memoryview(data)[rest + 8 : rest + 8 + binary_length]
        return data[20:rest]

    def _parse(self, data: bytes) -> Tree:
        try:
            tree = json.loads(data.decode("utf-8"), parse_constant=_no_constant)
        except (ValueError, RecursionError) as error:
            self.reject(f"it is not a glTF: {error}")
        asset = tree.get("asset") if isinstance(tree, dict) else None
        version = asset.get("version") if isinstance(asset, dict) else None
        if not isinstance(version, str) or not version.startswith("2."):
            self.reject(f"it is not a glTF 2.0: asset.version is {version!r}")
        for name in as_list(tree.get("extensionsRequired")):
            if not isinstance(name, str) or not self.supports(name):
                self.reject(f"it needs the extension {name}, which is not supported")
        return dict(tree)

    def _buffer(self, index: Any) -> memoryview:
        buffer = self.item("buffers", index)
        if index not in self._buffers:
            inner = index == 0 and "uri" not in buffer and self._binary is not None
            data = self._binary if inner else self.resource(buffer.get("uri"))
            assert data is not None
            length = buffer.get("byteLength")
            if not is_count(length) or length > len(data):
                self.reject(f"buffers[{index}] says {length} bytes, there are {len(data)}")
            self._buffers[index] = data[:length]
        return self._buffers[index]


def _no_constant(name: str) -> NoReturn:
    """Reject NaN and Infinity, which Python's reader accepts beyond JSON."""
    raise ValueError(f"{name} is not a number")


def is_count(value: Any) -> TypeGuard[int]:
    """Return whether a JSON value is a non-negative integer.

    Args:
        value: A JSON value.
    """
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0


def as_list(value: Any) -> list[Any]:
    """Return a JSON value if it is a list, else an empty list.

    Args:
        value: A JSON value.
    """
    return value if isinstance(value, list) else []
