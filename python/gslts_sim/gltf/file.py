"""glTF files, which are not trusted: their JSON and bytes, read within limits and checked.

Source: glTF 2.0 specification, Khronos Group.
"""

from __future__ import annotations

import base64
import json
import struct
from functools import cached_property
from pathlib import Path
from typing import Any, NoReturn, TypeGuard
from urllib.parse import unquote

Tree = dict[str, Any]

FILE_BYTES = 1 << 30
"""Of one file, and of all that it refers to: what it holds must fit into memory several times."""
JSON_BYTES = 32 << 20
"""Parsed, JSON takes up to 20 times its size; larger scenes keep their arrays in a GLB."""
NODES = 50_000
NODE_DEPTH = 200
"""trimesh walks from each node to the root."""
EXTENSIONS = (
    *("KHR_texture_transform", "KHR_mesh_quantization", "KHR_lights_punctual"),
    *("KHR_materials_unlit", "EXT_texture_webp"),
)
"""Those that may be required: understood, or, as lights, left out."""


class BadFileError(ValueError):
    """The file cannot be a home; the message says why in one line."""


class GltfFile:
    """The checked tree of a file, and its parts.

    Args:
        path: A .glb or .gltf file; what a .gltf refers to must lie in its folder or below.

    Raises:
        OSError: A file cannot be read.
        ValueError: It is no glTF 2.0 file, damaged, too large, or needs an unknown extension.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._budget = FILE_BYTES
        data = self._read(path)
        self._binary: memoryview | None = None
        self._buffers: dict[int, memoryview] = {}
        self._lists: dict[str, list[Tree]] = {}
        if data[:4] == b"glTF":
            data = self._json_of_glb(data)
        if len(data) > JSON_BYTES:
            self.refuse(f"its JSON has {len(data)} bytes, more than {JSON_BYTES}")
        self.tree = self._parsed(data)
        self._check_nodes()

    def refuse(self, problem: str) -> NoReturn:
        """Raises a ValueError that names the file, in one line."""
        line = " ".join(problem.split())
        raise BadFileError(f"load_home: {self.path}: {line[:300]}")

    def items(self, key: str) -> list[Tree]:
        """One of the tree's lists; empty if it has none."""
        if key not in self._lists:
            found = self.tree.get(key, [])
            if not isinstance(found, list) or not all(isinstance(item, dict) for item in found):
                self.refuse(f"{key}: expected a list of objects")
            self._lists[key] = found
        return self._lists[key]

    def item(self, key: str, index: Any) -> Tree:
        """An entry of one of the tree's lists."""
        found = self.items(key)
        if not is_count(index) or index >= len(found):
            self.refuse(f"{key}[{index}] does not exist")
        return found[index]

    def label(self, node: int) -> str:
        """What to call a node in messages."""
        name = self.items("nodes")[node].get("name")
        return f"node {node} ({name})" if name else f"node {node}"

    def view(self, index: Any) -> memoryview:
        """The bytes of a buffer view."""
        view = self.item("bufferViews", index)
        buffer = self._buffer(view.get("buffer"))
        start, length = view.get("byteOffset", 0), view.get("byteLength")
        if not is_count(start) or not is_count(length) or start + length > len(buffer):
            self.refuse(
                f"bufferViews[{index}] has {length} bytes from {start} on, its buffer has "
                f"{len(buffer)}"
            )
        return buffer[start : start + length]

    def resource(self, uri: Any) -> memoryview:
        """The bytes of a data URI, or of a file beside this one or below."""
        if not isinstance(uri, str):
            self.refuse(f"a buffer has the URI {uri!r}; a file or data is missing")
        if uri.startswith("data:"):
            header, _, text = uri.partition(",")
            if not header.endswith(";base64"):
                self.refuse(f"URI {uri[:40]!r}: only base64 data is read")
            return memoryview(base64.b64decode(text))
        relative = Path(unquote(uri))
        inside = self.path.parent.resolve()
        target = (inside / relative).resolve()
        remote = ":" in uri or "\\" in uri or "\0" in unquote(uri)
        if remote or relative.is_absolute() or not target.is_relative_to(inside):
            self.refuse(f"URI {uri[:80]!r} does not lead into the folder of the file")
        return memoryview(self._read(target))

    def roots(self) -> list[int]:
        """The nodes without parents of the scene that is shown."""
        scenes = self.items("scenes")
        nodes = range(len(self.items("nodes")))
        if not scenes:
            return [node for node in nodes if self.parents[node] is None]
        roots = self.item("scenes", self.tree.get("scene", 0)).get("nodes", [])
        if not isinstance(roots, list) or any(
            not is_count(node) or node not in nodes or self.parents[node] is not None
            for node in roots
        ):
            self.refuse("a root of the scene does not exist or is a child of another node")
        return list(dict.fromkeys(roots))

    @cached_property
    def parents(self) -> list[int | None]:
        """The parent of each node; None for roots."""
        nodes = self.items("nodes")
        parents: list[int | None] = [None] * len(nodes)
        for index, node in enumerate(nodes):
            for child in as_list(node.get("children")):
                if not is_count(child) or child >= len(nodes):
                    self.refuse(f"{self.label(index)}: its child {child} does not exist")
                if parents[child] is not None or child == index:
                    self.refuse(f"{self.label(child)} is a child more than once")
                parents[child] = index
        return parents

    def _check_nodes(self) -> None:
        count = len(self.items("nodes"))
        if count > NODES:
            self.refuse(f"it has {count} nodes, more than {NODES}")
        depths = [0 if parent is None else -1 for parent in self.parents]
        for node in range(count):
            way: list[int] = []
            at: int | None = node
            while at is not None and depths[at] < 0:
                if len(way) >= NODE_DEPTH:
                    self.refuse(f"{self.label(node)} is in a cycle or below {NODE_DEPTH} others")
                way.append(at)
                at = self.parents[at]
            for below in reversed(way):
                depths[below] = depths[self.parents[below] or 0] + 1

    def _read(self, path: Path) -> bytes:
        if not path.exists():
            raise FileNotFoundError(f"load_home: {path} does not exist")
        if not path.is_file():
            self.refuse(f"{path.name} is not a file")
        size = path.stat().st_size
        self._budget -= size
        if self._budget < 0:
            self.refuse(f"with {path.name} of {size} bytes it is larger than {FILE_BYTES}")
        with path.open("rb") as file:
            return file.read(size)

    def _json_of_glb(self, data: bytes) -> bytes:
        """The JSON of a GLB; keeps its binary part."""
        if len(data) < 20:
            self.refuse(f"it ends after {len(data)} bytes, before its JSON")
        version, length, json_length, kind = struct.unpack("<II I4s", data[4:20])
        if version != 2:
            self.refuse(f"it is glTF {version}, not 2")
        if length != len(data):
            self.refuse(f"its header says {length} bytes, it has {len(data)}")
        if kind != b"JSON" or 20 + json_length > length:
            self.refuse(f"its first part, {json_length} bytes of {kind!r}, is not its JSON")
        rest = 20 + json_length
        if rest + 8 <= length:
            binary_length, kind = struct.unpack("<I4s", data[rest : rest + 8])
            if rest + 8 + binary_length > length:
                self.refuse(f"its binary part says {binary_length} bytes, more than there are")
            if kind == b"BIN\0":
                self._binary = memoryview(data)[rest + 8 : rest + 8 + binary_length]
        return data[20:rest]

    def _parsed(self, data: bytes) -> Tree:
        try:
            tree = json.loads(data.decode("utf-8"), parse_constant=_no_constant)
        except (ValueError, RecursionError) as error:
            self.refuse(f"it is no glTF: {error}")
        asset = tree.get("asset") if isinstance(tree, dict) else None
        version = asset.get("version") if isinstance(asset, dict) else None
        if not isinstance(version, str) or not version.startswith("2."):
            self.refuse(f"it is no glTF 2.0: asset.version is {version!r}")
        for name in as_list(tree.get("extensionsRequired")):
            known = isinstance(name, str) and name.startswith("KHR_materials_")
            if name not in EXTENSIONS and not known:
                self.refuse(f"it needs the extension {name}, which is not supported")
        return dict(tree)

    def _buffer(self, index: Any) -> memoryview:
        buffer = self.item("buffers", index)
        if index not in self._buffers:
            inner = index == 0 and "uri" not in buffer and self._binary is not None
            data = self._binary if inner else self.resource(buffer.get("uri"))
            assert data is not None
            length = buffer.get("byteLength")
            if not is_count(length) or length > len(data):
                self.refuse(f"buffers[{index}] says {length} bytes, there are {len(data)}")
            self._buffers[index] = data[:length]
        return self._buffers[index]


def _no_constant(name: str) -> NoReturn:
    """JSON has no NaN or Infinity, Python's reader has."""
    raise ValueError(f"{name} is not a number")


def is_count(value: Any) -> TypeGuard[int]:
    """Whether a value of JSON is an integer from 0 on."""
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0


def as_list(value: Any) -> list[Any]:
    """A value of JSON if it is a list, else an empty one."""
    return value if isinstance(value, list) else []
