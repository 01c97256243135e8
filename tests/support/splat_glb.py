"""Small .glb files of Gaussians, written by hand so that every field can be wrong."""

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np

EXTENSION = "KHR_gaussian_splatting"
TYPES = {"int8": 5120, "uint8": 5121, "int16": 5122, "uint16": 5123, "float32": 5126}


class SplatGlb:
    """Two Gaussians in one primitive, with y up, as another program would write them."""

    def __init__(self, harmonics: int = 1) -> None:
        self.data = b""
        self.tree: dict[str, Any] = {
            "asset": {"version": "2.0"},
            "extensionsUsed": [EXTENSION],
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}],
            "accessors": [],
            "bufferViews": [],
        }
        kernel = {"kernel": "ellipse", "colorSpace": "srgb_rec709_display"}
        self.extension: dict[str, Any] = kernel
        self.primitive: dict[str, Any] = {
            "mode": 0,
            "attributes": {},
            "extensions": {EXTENSION: self.extension},
        }
        self.tree["meshes"] = [{"primitives": [self.primitive]}]
        half = np.sqrt(0.5)
        self.add("POSITION", [[1, 2, 3], [-4, 5, -6]])
        self.add(f"{EXTENSION}:ROTATION", [[0, 0, 0, 1], [half, 0, 0, half]])
        self.add(f"{EXTENSION}:SCALE", [[0.1, 0.2, 0.3], [1, 2, 3]])
        self.add(f"{EXTENSION}:OPACITY", [[0.25], [0.5]])
        for basis, name in enumerate(["0_COEF_0", "1_COEF_0", "1_COEF_1", "1_COEF_2"][:harmonics]):
            self.add(f"{EXTENSION}:SH_DEGREE_{name}", [[basis, 1, 2], [3, 4, 5]])

    def add(self, name: str, rows: Any, dtype: Any = np.float32, **more: Any) -> None:
        """Add or replace an attribute."""
        array = np.array(rows, dtype)
        self.data += bytes(-len(self.data) % 4)
        self.tree["bufferViews"].append(
            {"buffer": 0, "byteOffset": len(self.data), "byteLength": array.nbytes}
        )
        self.data += array.tobytes()
        kind = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}[array.shape[1]]
        self.primitive["attributes"][name] = len(self.tree["accessors"])
        self.tree["accessors"].append(
            {
                "bufferView": len(self.tree["bufferViews"]) - 1,
                "componentType": TYPES[array.dtype.name],
                "count": len(array),
                "type": kind,
                **more,
            }
        )

    def accessor(self, name: str) -> dict[str, Any]:
        """Return the accessor of an attribute."""
        return self.tree["accessors"][self.primitive["attributes"][name]]

    def glb(self) -> bytes:
        """Return the file."""
        tree = {"buffers": [{"byteLength": len(self.data)}], **self.tree}
        text = json.dumps(tree).encode()
        text += b" " * (-len(text) % 4)
        data = self.data + bytes(-len(self.data) % 4)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text
        chunks += struct.pack("<I4s", len(data), b"BIN\0") + data
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks

    def write(self, path: Path) -> Path:
        """Write the file."""
        path.write_bytes(self.glb())
        return path
