"""Triangle meshes with texture coordinates in metres: moved, joined, textured by projection."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from gslts.types import Floats, Ints32


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles with texture coordinates in metres.

    Args:
        vertices: [V,3] float64, m.
        faces: [F,3] int32, counter-clockwise seen from outside.
        uvs_m: [F,3,2] float64, m.
    """

    vertices: Floats
    faces: Ints32
    uvs_m: Floats

    def translate(self, x: float = 0, y: float = 0, z: float = 0) -> Mesh:
        """Return the mesh, shifted.

        Args:
            x: m.
            y: m.
            z: m.
        """
        return Mesh(self.vertices + np.array([x, y, z]), self.faces, self.uvs_m)

    def rotate(self, axis: str, angle_rad: float) -> Mesh:
        """Return the mesh, rotated about an axis through its origin.

        Args:
            axis: `x`, `y` or `z`.
            angle_rad: rad.
        """
        first, second = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
        cosine, sine = np.cos(angle_rad), np.sin(angle_rad)
        vertices = self.vertices.copy()
        vertices[:, first] = cosine * self.vertices[:, first] - sine * self.vertices[:, second]
        vertices[:, second] = sine * self.vertices[:, first] + cosine * self.vertices[:, second]
        return Mesh(vertices, self.faces, self.uvs_m)

    def scale(self, x: float = 1, y: float = 1, z: float = 1) -> Mesh:
        """Return the mesh, scaled; its texture is stretched, too.

        Args:
            x: Positive.
            y: Positive.
            z: Positive.
        """
        return Mesh(self.vertices * (x, y, z), self.faces, self.uvs_m)

    def shift_texture(self, u_m: float, v_m: float) -> Mesh:
        """Return the mesh with shifted texture coordinates.

        Args:
            u_m: m.
            v_m: m.
        """
        return Mesh(self.vertices, self.faces, self.uvs_m + np.array([u_m, v_m]))


def join(meshes: Sequence[Mesh]) -> Mesh:
    """Return several meshes as one.

    Args:
        meshes: At least one.
    """
    starts = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes[:-1]])
    return Mesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate(
            [mesh.faces + np.int32(start) for mesh, start in zip(meshes, starts, strict=True)]
        ),
        np.concatenate([mesh.uvs_m for mesh in meshes]),
    )


# For sides whose normal points along x, y or z: the axes of u and v.
_U_AXIS, _V_AXIS = np.array([1, 0, 0]), np.array([2, 2, 1])


def project_texture(vertices: Floats, faces: Ints32, along: int | None) -> Mesh:
    """Return a mesh whose texture is projected along the nearest axis of each triangle.

    Args:
        vertices: [V,3] float64, m.
        faces: [F,3] int32.
        along: Axis that u follows wherever the side holds it, for grain; None keeps prints upright.
    """
    corners = vertices[faces]
    edges = corners[:, 1:] - corners[:, :1]
    normals = cross(edges[:, 0], edges[:, 1])
    axis = np.abs(normals).argmax(axis=1)
    rows = np.arange(len(faces))
    positive = normals[rows, axis] > 0
    lower, upper = vertices.min(axis=0), vertices.max(axis=0)
    from_lower, from_upper = corners - lower, upper - corners
    u_axis, v_axis = _U_AXIS[axis], _V_AXIS[axis]
    # Seen from outside, u runs right: along +y on +x sides, along -x on +y sides.
    u_rises = np.where(axis == 1, ~positive, np.where(axis == 0, positive, True))
    v_rises = (axis == 2) & ~positive
    picks = rows[:, None], np.arange(3)[None, :]
    u = np.where(
        u_rises[:, None],
        from_lower[(*picks, u_axis[:, None])],
        from_upper[(*picks, u_axis[:, None])],
    )
    v = np.where(
        v_rises[:, None],
        from_lower[(*picks, v_axis[:, None])],
        from_upper[(*picks, v_axis[:, None])],
    )
    uvs = np.stack([u, v], axis=2)
    if along is not None:
        across = v_axis == along
        uvs[across] = uvs[across][:, :, ::-1]
    return Mesh(vertices, faces, uvs)


def cross(first: Floats, second: Floats) -> Floats:
    """Compute cross products [N,3]; for few rows several times as fast as numpy's.

    Args:
        first: [N,3] float64.
        second: [N,3] float64.
    """
    x, y, z = first.T
    a, b, c = second.T
    return np.stack([y * c - z * b, z * a - x * c, x * b - y * a], axis=1)


def split_quads(quads: ArrayLike) -> Ints32:
    """Split quads into triangles [2Q,3].

    Args:
        quads: [Q,4] int, counter-clockwise.
    """
    corners = np.asarray(quads, np.int32)
    return np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]])


def flip(mesh: Mesh) -> Mesh:
    """Return the mesh, turned inside out.

    Args:
        mesh: The mesh.
    """
    return Mesh(mesh.vertices, mesh.faces[:, ::-1], mesh.uvs_m[:, ::-1])
