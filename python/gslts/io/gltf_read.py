"""Reading of maps from binary glTF files; `gslts.io.gltf_write` describes their contents."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gslts.core.gaussian_map import GaussianMap
from gslts.core.se3 import product, rotation_of_quat
from gslts.core.similarity import transform_map
from gslts.io.activation import log_scales_of, logits_of
from gslts.io.gltf_file import Z_UP, Accessor, GltfFile, Tree, as_list, denormalize
from gslts.io.gltf_write import (
    COLOR_SPACE,
    EXTENSION,
    KERNEL,
    POINTS,
    PROJECTION,
    derive_opacities,
    derive_rotations,
    derive_scales,
    harmonic_name,
)
from gslts.types import Bools, Floats, Floats32

STORED_TOLERANCE = 1e-6
"""Maximum relative difference between an attribute and the one computed from what the map stored;
beyond it, another program changed the attribute. It is some roundings of float32."""
MAX_UNIT_ERROR = 1e-2
"""Maximum deviation of the squared length of a quaternion of a node from 1: roundings are less."""


def read_glb(path: Path) -> GaussianMap:
    """Read a map from a .glb file, of this or another program.

    The transform of the node is applied, and z points up in the map.

    Args:
        path: A regular file. It is untrusted: memory is bounded by its size, and nothing that it
            refers to is read.

    Returns:
        The map, float32. Its ids are 0, 1, ... unless the file has others.

    Raises:
        OSError: The file cannot be read.
        ValueError: The contents are wrong or not supported; one line names the file and the part.
    """
    file = _SplatFile(path)
    node, attributes = _find_splats(file)
    reader = _Reader(file, attributes)
    arrays: dict[str, Any] = {
        "means": reader.floats("POSITION", "VEC3"),
        "quats": reader.quats(),
        "log_scales": reader.log_scales(),
        "logit_opacities": reader.logit_opacities(),
        "sh": reader.harmonics(),
        "features": reader.features(path.stat().st_size),
        "ids": reader.ids(),
    }
    with np.errstate(all="ignore"):  # What is not finite is rejected below.
        world_from_node = product(Z_UP, _root_from_node(file, node))
    try:
        return transform_map(GaussianMap(**arrays), world_from_node)
    except ValueError as error:
        file.reject(f"{file.label(node)}: {error}")


class _SplatFile(GltfFile):
    """A file that may need the extension, and integers as positions."""

    def supports(self, extension: str) -> bool:
        return extension in (EXTENSION, "KHR_mesh_quantization")


def _find_splats(file: GltfFile) -> tuple[int, Tree]:
    """Return the node of the default scene that shows Gaussians, and their attributes."""
    found: list[tuple[int, Tree]] = []
    stack = file.roots()
    nodes = file.items("nodes")
    while stack:
        node = stack.pop()
        stack += as_list(nodes[node].get("children"))
        if "mesh" not in nodes[node]:
            continue
        for primitive in as_list(file.item("meshes", nodes[node]["mesh"]).get("primitives")):
            extensions = primitive.get("extensions") if isinstance(primitive, dict) else None
            if isinstance(extensions, dict) and EXTENSION in extensions:
                found.append((node, primitive))
    if len(found) != 1:
        file.reject(
            f"expected one primitive with {EXTENSION} in the scene, got {len(found)}"
            + ("; merge them in the program that wrote the file" if found else "")
        )
    node, primitive = found[0]
    _require_known(file, primitive)
    attributes = primitive.get("attributes")
    if not isinstance(attributes, dict):
        file.reject(f"{file.label(node)}: its primitive has no attributes")
    return node, attributes


def _require_known(file: GltfFile, primitive: Tree) -> None:
    extension = primitive["extensions"][EXTENSION]
    if not isinstance(extension, dict) or primitive.get("mode") != POINTS:
        file.reject(f"{EXTENSION} belongs to points, mode 0, got mode {primitive.get('mode')!r}")
    for key, known, default in (
        ("kernel", KERNEL, None),
        ("colorSpace", COLOR_SPACE, None),
        ("projection", PROJECTION, PROJECTION),
    ):
        if extension.get(key, default) != known:
            file.reject(f"{EXTENSION}: {key} is {extension.get(key)!r}, only {known!r} is read")
    if extension.get("extensions"):
        file.reject(f"{EXTENSION} is extended by {extension['extensions']}, not supported")


def _root_from_node(file: GltfFile, node: int) -> Floats:
    """Return the transform [4,4] of a node and those above it."""
    result = np.eye(4)
    at: int | None = node
    while at is not None:
        result = product(_own_transform(file, at), result)
        at = file.parents[at]
    return result


def _own_transform(file: GltfFile, node: int) -> Floats:
    fields = file.items("nodes")[node]

    def numbers(key: str, default: Floats) -> Floats:
        try:
            values = np.array(fields.get(key, default.tolist()), np.float64)
        except (TypeError, ValueError, OverflowError):
            values = np.zeros(0)
        if values.shape != default.shape or not np.isfinite(values).all():
            file.reject(f"{file.label(node)}: {key}: expected {default.size} finite numbers")
        return values

    matrix: Floats = numbers("matrix", np.eye(4).ravel()).reshape(4, 4).T
    if "matrix" in fields:
        if not np.array_equal(matrix[3], [0, 0, 0, 1]):
            file.reject(f"{file.label(node)}: its matrix is not affine")
        return matrix
    x, y, z, w = numbers("rotation", np.array([0.0, 0, 0, 1]))
    if not abs(x * x + y * y + z * z + w * w - 1) < MAX_UNIT_ERROR:
        file.reject(f"{file.label(node)}: its rotation is no unit quaternion")
    matrix[:3, :3] = rotation_of_quat(np.array([w, x, y, z])) * numbers("scale", np.ones(3))
    matrix[:3, 3] = numbers("translation", np.zeros(3))
    return matrix


class _Reader:
    """Reads the attributes of a primitive, [N] or [N,width] in float32."""

    def __init__(self, file: GltfFile, attributes: Tree) -> None:
        self.file = file
        self.attributes = attributes
        self.count: int | None = None
        self.count = self._accessor("POSITION", "VEC3").count

    def floats(self, name: str, kind: str) -> Floats32:
        accessor = self._accessor(name, kind)
        with np.errstate(over="ignore"):
            values = denormalize(accessor.rows(), accessor).astype(np.float32)
        self._require(name, values, np.isfinite(values), "a finite float")
        return values[:, 0] if kind == "SCALAR" else values

    def quats(self) -> Floats32:
        rotations = self.floats(f"{EXTENSION}:ROTATION", "VEC4")
        exact = self._stored_array("_ROTATION", "VEC4", rotations, derive_rotations)
        return np.roll(rotations if exact is None else exact, 1, axis=1)

    def log_scales(self) -> Floats32:
        name = f"{EXTENSION}:SCALE"
        scales = self.floats(name, "VEC3")
        self._require(name, scales, scales >= 0, "0 or more")
        exact = self._stored_array("_LOG_SCALE", "VEC3", scales, derive_scales)
        return log_scales_of(scales).astype(np.float32) if exact is None else exact

    def logit_opacities(self) -> Floats32:
        name = f"{EXTENSION}:OPACITY"
        opacities = self.floats(name, "SCALAR")
        self._require(name, opacities, (opacities >= 0) & (opacities <= 1), "0 to 1")
        exact = self._stored_array("_LOGIT_OPACITY", "SCALAR", opacities, derive_opacities)
        return logits_of(opacities).astype(np.float32) if exact is None else exact

    def harmonics(self) -> Floats32:
        degree = max((d for d in range(4) if harmonic_name(d**2) in self.attributes), default=0)
        bases = range((degree + 1) ** 2)
        return np.stack([self.floats(harmonic_name(basis), "VEC3") for basis in bases], axis=1)

    def features(self, file_bytes: int) -> Floats32:
        names: list[str] = []
        while f"_FEATURE_{len(names)}" in self.attributes:
            names.append(f"_FEATURE_{len(names)}")
        size = self.count or 0
        if 4 * size * len(names) > file_bytes:
            self.file.reject(f"{len(names)} features of {size} Gaussians share their numbers")
        columns = [self.floats(name, "SCALAR") for name in names]
        return np.stack(columns, axis=1) if columns else np.zeros((size, 0), np.float32)

    def ids(self) -> NDArray[np.uint64] | None:
        if "_ID" not in self.attributes:
            return None
        quarters = self._accessor("_ID", "VEC4").rows()
        if quarters.dtype != np.dtype("<u2"):
            self.file.reject(f"_ID: expected 16-bit numbers, got {quarters.dtype}")
        return np.ascontiguousarray(quarters).view("<u8")[:, 0].astype(np.uint64)

    def _accessor(self, name: str, kind: str) -> Accessor:
        if name not in self.attributes:
            self.file.reject(f"the Gaussians have no attribute {name}")
        accessor = self.file.accessor(self.attributes[name], (kind,))
        if self.count not in (None, accessor.count):
            self.file.reject(f"{name} has {accessor.count} entries, POSITION {self.count}")
        return accessor

    def _stored_array(
        self, name: str, kind: str, derived: Floats32, derive: Callable[[Floats32], Floats32]
    ) -> Floats32 | None:
        """Return what a map stored, if the attribute derived from it is still that of the file."""
        if name not in self.attributes:
            return None
        stored = self.floats(name, kind)
        same = np.allclose(derive(stored), derived, rtol=STORED_TOLERANCE, atol=0)
        return stored if same else None

    def _require(self, name: str, values: Floats32, good: Bools, expected: str) -> None:
        if not good.all():
            row = int(np.flatnonzero(~good.reshape(len(good), -1).all(axis=1))[0])
            value = np.array(values[row]).tolist()
            self.file.reject(f"Gaussian {row}: {name}: expected {expected}, got {value}")
