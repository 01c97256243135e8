"""Surfaces of the nodes of a glTF file, decoded by trimesh.

trimesh unpacks the accessors and multiplies the nodes' transforms. It gets a reduced JSON with only
what is used, under names that identify the source: given the file itself, it allocates whatever a
file declares, reads all images, names nodes at random and ignores sparse and normalised accessors.
"""

from __future__ import annotations

import io
import json
from dataclasses import dataclass
from typing import Any

import numpy as np

from gslts.io.gltf_file import Z_UP, Accessor, Tree, as_list, denormalize
from gslts.types import Bytes, Floats, Floats32, Ints
from gslts_sim.gltf.colour import BaseColour, Textures, palette
from gslts_sim.gltf.file import HomeFile
from gslts_sim.gltf.library import import_trimesh
from gslts_sim.mesh import Surface

MAX_CORNERS = 15_000_000
"""Maximum number of vertices and corners of triangles of all nodes; they take some GB of memory."""
MAX_DISTANCE_M = 10_000.0
"""Maximum coordinate of a vertex, m; rays are cast in single precision, which has a resolution of a
millimetre there."""
TRIANGLES, STRIP, FAN = 4, 5, 6
"""Modes of glTF's primitives."""


@dataclass(frozen=True, eq=False)
class Node:
    """A node of the default scene.

    Args:
        index: In the file.
        world_from_node: [4,4] float64, any affine transform, m.
        surfaces: Of its mesh, the vertices in the world; none without a mesh.
    """

    index: int
    world_from_node: Floats
    surfaces: tuple[Surface, ...]


def read_nodes(file: HomeFile) -> list[Node]:
    """Read the nodes of the default scene.

    Args:
        file: The glTF file.

    Returns:
        Nodes, parents before their children, in the order of the file.

    Raises:
        BadFileError: A part of it is damaged or not supported.
    """
    trimesh = import_trimesh()

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
        file.reject(f"trimesh cannot read it: {type(error).__name__}: {error}")
    textures = Textures(file)
    nodes = []
    for node in order:
        if not np.isfinite(placed[node]).all():
            file.reject(f"{file.label(node)}: its transform is not finite")
        try:
            surfaces = tuple(
                outline.surface(name, scene.geometry[name], placed[node], textures)
                for name in meshes[node]
            )
        except ValueError as error:
            message = str(error).removeprefix(f"load_home: {file.path}: ")
            file.reject(f"{file.label(node)}: {message}")
        nodes.append(Node(node, placed[node], surfaces))
    return nodes


def _depth_first(file: HomeFile) -> list[int]:
    stack = file.roots()[::-1]
    order = []
    while stack:
        order.append(stack.pop())
        stack += as_list(file.items("nodes")[order[-1]].get("children"))[::-1]
    return order


class _Outline:
    """Builder of the reduced JSON for trimesh."""

    def __init__(self, file: HomeFile) -> None:
        self.file = file
        self.resources: dict[str, memoryview] = {}
        self._accessors: list[Tree] = []
        self._validated: dict[int, Accessor] = {}
        self._rows: dict[int, int] = {}
        self._meshes: dict[str, Tree] = {}
        self._colours: dict[str, BaseColour] = {}
        self._views: dict[str, dict[str, int]] = {}
        self._corners = 0

    def tree(self, order: list[int]) -> Tree:
        """Return the reduced JSON: nodes are named by their index, each primitive is a mesh."""
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
        """Add the mesh of a node, if any, and return the names of its primitives."""
        index = self.file.items("nodes")[node].get("mesh")
        if index is None:
            return []
        names = []
        for k, primitive in enumerate(as_list(self.file.item("meshes", index).get("primitives"))):
            mode = primitive.get("mode", TRIANGLES)
            if mode == FAN:
                self.file.reject(f"{self.file.label(node)}: triangle fans are not supported")
            if mode in (TRIANGLES, STRIP):
                names.append(f"{index}.{k}")
                try:
                    self._add_primitive(names[-1], primitive)
                except ValueError as error:
                    message = str(error).removeprefix(f"load_home: {self.file.path}: ")
                    self.file.reject(f"{self.file.label(node)}: {message}")
        if not names:
            self.file.reject(f"{self.file.label(node)}: its mesh has no triangles")
        return names

    def _add_primitive(self, name: str, primitive: Tree) -> None:
        attributes = primitive["attributes"]
        colour = BaseColour.from_material(self.file, primitive.get("material"))
        wanted = {"POSITION": attributes.get("POSITION")}
        if colour.image is not None:
            wanted["_UV"] = attributes.get(f"TEXCOORD_{colour.uv_set}")
        wanted["_COLOR"] = attributes.get("COLOR_0")
        kinds = {"POSITION": ("VEC3",), "_UV": ("VEC2",), "_COLOR": ("VEC3", "VEC4")}
        if wanted["POSITION"] is None:
            self.file.reject("a primitive has no POSITION")
        result: Tree = {
            "mode": primitive.get("mode", TRIANGLES),
            "attributes": {
                key: self._add_accessor(index, kinds[key])
                for key, index in wanted.items()
                if index is not None
            },
        }
        if "indices" in primitive:
            result["indices"] = self._add_accessor(primitive["indices"], ("SCALAR",))
        counts = [self.file.item("accessors", i)["count"] for i in wanted.values() if i is not None]
        if len(set(counts)) > 1:
            self.file.reject(f"the arrays of a primitive have {counts} entries")
        indices = primitive.get("indices", wanted["POSITION"])
        self._corners += counts[0] + self.file.item("accessors", indices)["count"]
        if self._corners > MAX_CORNERS:
            self.file.reject(
                f"the scene has more than {MAX_CORNERS} vertices and corners of triangles"
            )
        self._meshes[name] = {"name": name, "primitives": [result]}
        self._colours[name] = colour

    def _add_accessor(self, index: Any, kinds: tuple[str, ...]) -> int:
        """Add an accessor after a check that its buffer holds what it declares."""
        accessor = self.file.accessor(index, kinds)
        if index not in self._rows:
            self._validated[index] = accessor
            self._rows[index] = len(self._accessors)
            kept = ("componentType", "count", "type")
            view = self._add_view(accessor.view, accessor.data)
            self._accessors.append(
                {key: self.file.item("accessors", index)[key] for key in kept}
                | {"byteOffset": accessor.offset, "bufferView": view}
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

    def surface(self, name: str, mesh: Any, world_from_node: Floats, textures: Textures) -> Surface:
        """Return the surface of a primitive, its vertices in the world."""
        mesh_index, k = map(int, name.split("."))
        attributes = self.file.items("meshes")[mesh_index]["primitives"][k]["attributes"]
        local = denormalize(mesh.vertices, self._validated[attributes["POSITION"]])
        if not np.isfinite(local).all():
            row = int(np.flatnonzero(~np.isfinite(local).all(axis=1))[0])
            self.file.reject(f"vertex {row} is {local[row].tolist()}")
        faces = np.array(mesh.faces)
        if len(faces) == 0:
            self.file.reject("its mesh has no triangles")
        if faces.min() < 0 or faces.max() >= len(local):
            self.file.reject(f"a triangle has vertex {faces.max()} of {len(local)}")
        if np.linalg.det(world_from_node[:3, :3]) < 0:
            faces = faces[:, ::-1]  # A mirror turns triangles inside out.
        texture, uvs = self._appearance(name, mesh, faces, attributes, textures)
        vertices = local @ world_from_node[:3, :3].T + world_from_node[:3, 3]
        if np.abs(vertices).max() > MAX_DISTANCE_M:
            self.file.reject(f"a vertex is over {MAX_DISTANCE_M:.0f} m from the origin")
        return Surface(vertices, faces.astype(np.int32), uvs, texture)

    def _appearance(
        self, name: str, mesh: Any, faces: Ints, attributes: Tree, textures: Textures
    ) -> tuple[Bytes, Floats32]:
        """Return the texture of a primitive, and the texture coordinates of its corners."""
        colour = self._colours[name]
        factor = colour.factor
        uvs = np.zeros((len(faces), 3, 2), np.float32)
        if "_UV" in mesh.vertex_attributes:
            accessor = self._validated[attributes[f"TEXCOORD_{colour.uv_set}"]]
            raw = denormalize(mesh.vertex_attributes["_UV"], accessor)
            uv = raw @ colour.uv_from_raw[:, :2].T + colour.uv_from_raw[:, 2]
            uvs = uv.astype(np.float32)[faces]
        if "_COLOR" in mesh.vertex_attributes:
            accessor = self._validated[attributes["COLOR_0"]]
            colours = denormalize(mesh.vertex_attributes["_COLOR"], accessor)
            of_faces = colours[faces, :3].mean(axis=1)
            if colour.image is None:
                return palette(of_faces * factor)
            factor = factor * of_faces.mean(axis=0)
        return textures.tint(colour.image, factor), uvs
