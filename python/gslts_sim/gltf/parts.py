"""The triangles of a glTF file, placed by trimesh.

trimesh unpacks arrays and multiplies the nodes' transforms. It gets a tree with only what is used,
with names that tell where it comes from: left alone, it takes memory for whatever a file declares,
reads all images, names nodes at random and leaves out what sparse and normalised arrays mean.
"""

from __future__ import annotations

import io
import json
from dataclasses import dataclass
from typing import Any

import numpy as np

from gslts.types import Floats
from gslts_sim.gltf.colour import BaseColour, Textures, palette
from gslts_sim.gltf.file import GltfFile, Tree, as_list, is_count
from gslts_sim.mesh import Surface

CORNERS = 15_000_000
"""Vertices, and corners of triangles, of all nodes: some GB of memory in all."""

FARTHEST_M = 10_000.0
"""From the origin; single precision, in which rays are cast, is exact to a millimetre there."""

SIZES = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
"""Bytes of glTF's component types."""
HIGHEST = {5120: 127, 5121: 255, 5122: 32767, 5123: 65535, 5125: 2**32 - 1}
"""Integers that stand for 1 in normalised arrays."""
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
TRIANGLES, STRIP, FAN = 4, 5, 6

Z_UP = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
"""From glTF's axes, where y is up, to ours."""


@dataclass(frozen=True, eq=False)
class Node:
    """A node that the scene shows.

    Args:
        index: In the file.
        world_from_node: [4,4] float64, any affine transform; z is up in the world.
        surfaces: What its mesh looks like, the vertices in the world; none without a mesh.
    """

    index: int
    world_from_node: Floats
    surfaces: tuple[Surface, ...]


def read_nodes(file: GltfFile) -> list[Node]:
    """The nodes of the scene, parents before their children, in the order of the file."""
    import trimesh

    order = _depth_first(file)
    outline = _Outline(file)
    meshes = {node: outline.add_node(node) for node in order}
    text = io.BytesIO(json.dumps(outline.tree(order)).encode())
    try:
        scene = trimesh.load_scene(
            text, file_type="gltf", resolver=outline.resources, skip_materials=True
        )
        placed = {node: Z_UP @ scene.graph.get(str(node))[0] for node in order}
    except MemoryError:
        raise
    except Exception as error:
        file.refuse(f"trimesh cannot read it: {type(error).__name__}: {error}")
    textures = Textures(file)
    nodes = []
    for node in order:
        if not np.isfinite(placed[node]).all():
            file.refuse(f"{file.label(node)}: its transform is not finite")
        try:
            surfaces = tuple(
                outline.surface(name, scene.geometry[name], placed[node], textures)
                for name in meshes[node]
            )
        except ValueError as error:
            message = str(error).removeprefix(f"load_home: {file.path}: ")
            file.refuse(f"{file.label(node)}: {message}")
        nodes.append(Node(node, placed[node], surfaces))
    return nodes


def _depth_first(file: GltfFile) -> list[int]:
    stack = file.roots()[::-1]
    order = []
    while stack:
        order.append(stack.pop())
        stack += as_list(file.items("nodes")[order[-1]].get("children"))[::-1]
    return order


class _Outline:
    """The tree that trimesh gets, in the making."""

    def __init__(self, file: GltfFile) -> None:
        self.file = file
        self.resources: dict[str, memoryview] = {}
        self._accessors: list[Tree] = []
        self._rows: dict[int, int] = {}
        self._meshes: dict[str, Tree] = {}
        self._looks: dict[str, BaseColour] = {}
        self._views: dict[str, dict[str, int]] = {}
        self._corners = 0

    def tree(self, order: list[int]) -> Tree:
        """The whole; nodes bear their numbers as names, each primitive is a mesh."""
        nodes = self.file.items("nodes")
        kept = ("children", "matrix", "translation", "rotation", "scale")
        return {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": self.file.roots()}],
            "nodes": [
                {"name": str(k)} | {key: node[key] for key in kept if key in node and k in wanted}
                for wanted in (set(order),)
                for k, node in enumerate(nodes)
            ],
            "meshes": list(self._meshes.values()),
            "accessors": self._accessors,
            "bufferViews": list(self._views.values()),
            "buffers": [{"uri": name} for name in self.resources],
        }

    def add_node(self, node: int) -> list[str]:
        """Adds the mesh of a node, if any; returns the names of its primitives."""
        index = self.file.items("nodes")[node].get("mesh")
        if index is None:
            return []
        names = []
        for k, primitive in enumerate(as_list(self.file.item("meshes", index).get("primitives"))):
            mode = primitive.get("mode", TRIANGLES)
            if mode == FAN:
                self.file.refuse(f"{self.file.label(node)}: triangle fans are not supported")
            if mode in (TRIANGLES, STRIP):
                names.append(f"{index}.{k}")
                try:
                    self._add_primitive(names[-1], primitive)
                except ValueError as error:
                    message = str(error).removeprefix(f"load_home: {self.file.path}: ")
                    self.file.refuse(f"{self.file.label(node)}: {message}")
        if not names:
            self.file.refuse(f"{self.file.label(node)}: its mesh has no triangles")
        return names

    def _add_primitive(self, name: str, primitive: Tree) -> None:
        attributes = primitive["attributes"]
        look = BaseColour.of(self.file, primitive.get("material"))
        wanted = {"POSITION": attributes.get("POSITION")}
        if look.image is not None:
            wanted["_UV"] = attributes.get(f"TEXCOORD_{look.uv_set}")
        wanted["_COLOR"] = attributes.get("COLOR_0")
        kinds = {"POSITION": ("VEC3",), "_UV": ("VEC2",), "_COLOR": ("VEC3", "VEC4")}
        if wanted["POSITION"] is None:
            self.file.refuse("a primitive has no POSITION")
        result: Tree = {
            "mode": primitive.get("mode", TRIANGLES),
            "attributes": {
                key: self._add_array(index, kinds[key])
                for key, index in wanted.items()
                if index is not None
            },
        }
        if "indices" in primitive:
            result["indices"] = self._add_array(primitive["indices"], ("SCALAR",))
        counts = [self.file.item("accessors", i)["count"] for i in wanted.values() if i is not None]
        if len(set(counts)) > 1:
            self.file.refuse(f"the arrays of a primitive have {counts} entries")
        indices = primitive.get("indices", wanted["POSITION"])
        self._corners += counts[0] + self.file.item("accessors", indices)["count"]
        if self._corners > CORNERS:
            self.file.refuse(f"the scene has more than {CORNERS} vertices and corners of triangles")
        self._meshes[name] = {"name": name, "primitives": [result]}
        self._looks[name] = look

    def _add_array(self, index: Any, kinds: tuple[str, ...]) -> int:
        """Adds an accessor after a check that its buffer holds what it declares."""
        accessor = self.file.item("accessors", index)
        count, size = accessor.get("count"), SIZES.get(accessor.get("componentType", 0))
        offset = accessor.get("byteOffset", 0)
        if accessor.get("type") not in kinds or size is None or not is_count(count) or count == 0:
            self.file.refuse(f"accessors[{index}] is not a list of {' or '.join(kinds)}")
        if "sparse" in accessor or "bufferView" not in accessor:
            self.file.refuse(f"accessors[{index}] is sparse or has no data, not supported")
        view = accessor["bufferView"]
        data = self.file.view(view)
        row = size * WIDTHS[accessor["type"]]
        stride = self.file.item("bufferViews", view).get("byteStride", row)
        if not is_count(stride) or stride < row or not is_count(offset):
            self.file.refuse(f"accessors[{index}]: rows of {row} bytes, {stride} apart")
        if offset + (count - 1) * stride + row > len(data):
            self.file.refuse(
                f"accessors[{index}] says {count} entries, its {len(data)} bytes hold fewer"
            )
        if index not in self._rows:
            self._rows[index] = len(self._accessors)
            kept = ("componentType", "count", "type")
            self._accessors.append(
                {key: accessor[key] for key in kept}
                | {"byteOffset": offset, "bufferView": self._add_view(view, data)}
            )
        return self._rows[index]

    def _add_view(self, index: int, data: memoryview) -> int:
        name = f"view {index}"
        if name not in self.resources:
            self.resources[name] = data
            view = {"buffer": len(self._views), "byteLength": len(data)}
            if "byteStride" in self.file.item("bufferViews", index):
                view["byteStride"] = self.file.item("bufferViews", index)["byteStride"]
            self._views[name] = view
        return self._views[name]["buffer"]

    def _unpacked(self, values: Any, index: int) -> Floats:
        """Numbers of an accessor as trimesh gives them, with normalised ones brought to 1."""
        accessor = self.file.item("accessors", index)
        numbers = np.array(values, np.float64)
        if accessor.get("normalized") and accessor["componentType"] in HIGHEST:
            numbers = np.maximum(numbers / HIGHEST[accessor["componentType"]], -1)
        return numbers

    def surface(self, name: str, mesh: Any, world_from_node: Floats, textures: Textures) -> Surface:
        """A primitive at its place in the world."""
        mesh_index, k = map(int, name.split("."))
        attributes = self.file.items("meshes")[mesh_index]["primitives"][k]["attributes"]
        local = self._unpacked(mesh.vertices, attributes["POSITION"])
        if not np.isfinite(local).all():
            row = int(np.flatnonzero(~np.isfinite(local).all(axis=1))[0])
            self.file.refuse(f"vertex {row} is {local[row].tolist()}")
        faces = np.array(mesh.faces)
        if len(faces) == 0:
            self.file.refuse("its mesh has no triangles")
        if faces.min() < 0 or faces.max() >= len(local):
            self.file.refuse(f"a triangle has vertex {faces.max()} of {len(local)}")
        if np.linalg.det(world_from_node[:3, :3]) < 0:
            faces = faces[:, ::-1]  # A mirror turns triangles inside out.
        look = self._looks[name]
        image, factor = look.image, look.factor
        uvs = np.zeros((len(faces), 3, 2), np.float32)
        if "_UV" in mesh.vertex_attributes:
            raw = self._unpacked(
                mesh.vertex_attributes["_UV"], attributes[f"TEXCOORD_{look.uv_set}"]
            )
            uv = raw @ look.uv_from_raw[:, :2].T + look.uv_from_raw[:, 2]
            uvs = uv.astype(np.float32)[faces]
        texture = None
        if "_COLOR" in mesh.vertex_attributes:
            colours = self._unpacked(mesh.vertex_attributes["_COLOR"], attributes["COLOR_0"])
            of_faces = colours[faces, :3].mean(axis=1)
            if image is None:
                texture, uvs = palette(of_faces * factor)
            else:
                factor = factor * of_faces.mean(axis=0)
        if texture is None:
            texture = textures.tinted(image, factor)
        vertices = local @ world_from_node[:3, :3].T + world_from_node[:3, 3]
        if np.abs(vertices).max() > FARTHEST_M:
            self.file.refuse(f"a vertex is over {FARTHEST_M:.0f} m from the origin")
        return Surface(vertices, faces.astype(np.int32), uvs, texture)
