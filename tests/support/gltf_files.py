"""Small glTF files, written by hand so that every field can be wrong."""

import io
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from sim_scenes import box_surface, plain

from gslts_sim import load_home
from gslts_sim.home import HomeObject

TYPES = {
    "int8": 5120, "uint8": 5121, "int16": 5122, "uint16": 5123, "uint32": 5125, "float32": 5126,
}  # fmt: skip


class Gltf:
    """Builder of the JSON and the buffer of a file."""

    def __init__(self) -> None:
        self.tree: dict[str, Any] = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{}]}
        for key in ("nodes", "meshes", "accessors", "bufferViews", "materials"):
            self.tree[key] = []
        self.tree |= {"images": [], "textures": []}
        self.data = b""

    def view(self, data: bytes, **more: Any) -> int:
        self.data += bytes(-len(self.data) % 4)
        view = {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data)}
        self.tree["bufferViews"].append(view | more)
        self.data += data
        return len(self.tree["bufferViews"]) - 1

    def array(self, values: np.ndarray, *, normalized: bool = False) -> int:
        kind = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}[values[0].size]
        accessor = {
            "bufferView": self.view(values.tobytes()),
            "componentType": TYPES[values.dtype.name],
            "count": len(values),
            "type": kind,
        }
        self.tree["accessors"].append(accessor | ({"normalized": True} if normalized else {}))
        return len(self.tree["accessors"]) - 1

    def material(self, image: Image.Image | None = None, **properties: Any) -> int:
        if image is not None:
            file = io.BytesIO()
            image.save(file, "PNG")
            self.tree["images"].append({"bufferView": self.view(file.getvalue())})
            self.tree["textures"].append({"source": len(self.tree["images"]) - 1})
            texture = {"index": len(self.tree["textures"]) - 1}
            properties["baseColorTexture"] = texture | properties.get("baseColorTexture", {})
        self.tree["materials"].append({"pbrMetallicRoughness": properties})
        return len(self.tree["materials"]) - 1

    def mesh(self, *primitives: dict[str, Any]) -> int:
        self.tree["meshes"].append({"name": "Mesh", "primitives": list(primitives)})
        return len(self.tree["meshes"]) - 1

    def primitive(self, corners: np.ndarray, **more: Any) -> dict[str, Any]:
        """Return a primitive of triangles [F,3,3] without indices."""
        attributes = more.pop("attributes", {})
        points = np.asarray(corners, np.float32).reshape(-1, 3)
        return {"attributes": {"POSITION": self.array(points)} | attributes} | more

    def node(self, *, root: bool = True, **fields: Any) -> int:
        self.tree["nodes"].append(fields)
        index = len(self.tree["nodes"]) - 1
        if root:
            self.tree["scenes"][0].setdefault("nodes", []).append(index)
        return index

    def glb(self) -> bytes:
        tree = {key: value for key, value in self.tree.items() if value != []}
        if self.data:
            tree["buffers"] = [{"byteLength": len(self.data)}, *self.tree.get("buffers", [])]
        return glb(json.dumps(tree).encode(), self.data)

    def write(self, path: Path) -> Path:
        path.write_bytes(self.glb())
        return path


def glb(text: bytes, data: bytes) -> bytes:
    text += b" " * (-len(text) % 4)
    data += bytes(-len(data) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    if data:
        chunks += struct.pack("<I4s", len(data), b"BIN\0") + data
    return b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks


def box(low: Any, high: Any) -> np.ndarray:
    """Return the outward triangles [12,3,3] of a box."""
    surface = box_surface(low, high, plain(128))
    return surface.vertices[surface.faces]


def y_up(corners: np.ndarray) -> np.ndarray:
    """Convert from the world's axes to those of glTF."""
    return np.stack([corners[..., 0], corners[..., 2], -corners[..., 1]], axis=-1)


CUBE = y_up(box([-0.5, -0.5, -0.5], [0.5, 0.5, 0.5]))


def sized(width: float, depth: float, height: float) -> np.ndarray:
    """Return a box in glTF's axes that stands on the origin; the sizes are in the world's."""
    return y_up(box([-width / 2, -depth / 2, 0], [width / 2, depth / 2, height]))


def flat() -> Gltf:
    """Return two rooms, nested as by Blender: groups, a shared mesh, parents of objects."""
    file = Gltf()
    wood = file.material(baseColorFactor=[0.5, 0.3, 0.2, 1])
    cup = file.mesh(file.primitive(sized(0.08, 0.08, 0.1), material=wood))
    top = file.primitive(y_up(box([-0.6, -0.4, 0.71], [0.6, 0.4, 0.75])), material=wood)
    legs = [
        box([x - 0.03, y - 0.03, 0], [x + 0.03, y + 0.03, 0.71])
        for x in (-0.5, 0.5)
        for y in (-0.3, 0.3)
    ]
    table = file.mesh(top, file.primitive(y_up(np.concatenate(legs))))
    floor = file.mesh(file.primitive(sized(4, 3, 0.1)))
    wall = file.mesh(file.primitive(sized(4, 0.1, 2.5)))
    ceiling = file.mesh(file.primitive(sized(4, 3, 0.1)))
    first = file.node(
        root=False, name="Cup.001", mesh=cup, translation=[0.2, 0.75, 0.1], extras={"movable": 1}
    )
    second = file.node(root=False, name="Cup", mesh=cup, translation=[-0.2, 0.75, 0.1])
    half = np.sqrt(0.5)
    # A quarter turn about the vertical; the scale is applied to the vertices.
    turned = {"translation": [1, 0, 0.5], "rotation": [0, half, 0, half], "scale": [1.5, 1, 1]}
    desk = file.node(root=False, name="Table|1", mesh=table, children=[first, second], **turned)
    kitchen = [
        file.node(root=False, name="Floor|1", mesh=floor, translation=[0, -0.1, 0],
                  extras={"room": "kitchen"}),
        file.node(root=False, name="Ceiling|1", mesh=ceiling, translation=[0, 2.6, 0]),
        file.node(root=False, name="Wall|1", mesh=wall, translation=[0, 0, -1.45]),
        desk,
    ]  # fmt: skip
    group = file.node(root=False, name="Kitchen", children=kitchen, extras={"type": "Room"})
    bed = file.node(root=False, name="Floor|2", mesh=floor, translation=[4, -0.1, 0])
    file.node(name="Flat", children=[group, bed], translation=[0, 1, 0])
    return file


QUAD = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
QUAD_UV = np.array([[0, 1], [1, 1], [1, 0], [0, 1], [1, 0], [0, 0]], np.float32)


def quad(image: Image.Image | None = None, uv: np.ndarray = QUAD_UV, **properties: object) -> Gltf:
    """Return a square in glTF's x and y with an upright image."""
    file = Gltf()
    attributes = {"TEXCOORD_0": file.array(uv)}
    material = file.material(image, **properties)
    primitive = file.primitive(QUAD, attributes=attributes, material=material)
    file.node(name="Picture", mesh=file.mesh(primitive))
    return file


def four_colours() -> Image.Image:
    pixels = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [200, 100, 50]]], np.uint8)
    return Image.fromarray(pixels)


def only_object(tmp_path: Path, file: Gltf) -> HomeObject:
    """Return the only object of a file."""
    return load_home(file.write(tmp_path / "one.glb")).objects[0]
