"""Closed meshes of simple shapes, with texture coordinates in metres.

Every shape stands on z = 0 with its middle at x = y = 0; its front looks towards -y. Faces are
counter-clockwise seen from outside. Texture coordinates start at the upper left corner of a side,
u to the right and v down as seen from outside, so that prints fit without further thought.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from gslts.types import Floats, Ints, Ints32
from gslts_sim.procedural.mesh import Mesh, cross, flip, join, project_texture, split_quads


@cache
def _unit_box(along: int | None) -> tuple[Floats, Ints32, Floats, Ints]:
    """Return a unit box: vertices, faces, uvs [12,3,2] and the axes [12,2] that they follow."""
    vertices = np.array([[x, y, z] for z in (0, 1) for y in (-0.5, 0.5) for x in (-0.5, 0.5)])
    quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
    mesh = project_texture(vertices, split_quads(np.array(quads)), along)
    # In a box of sizes 1, 2 and 3 each coordinate tells which axis it follows.
    longer = project_texture(vertices * (1, 2, 3), mesh.faces, along)
    return vertices, mesh.faces, mesh.uvs_m, longer.uvs_m.max(axis=1).round().astype(int) - 1


def box(width: float, depth: float, height: float, *, upright: bool = False) -> Mesh:
    """Make a box on the x-y plane, centred in x and y.

    Args:
        width: Along x, m.
        depth: Along y, m.
        height: Along z, m.
        upright: Keep prints upright; else the grain runs along the longest edge.
    """
    size = np.array([width, depth, height])
    vertices, faces, uvs, axes = _unit_box(None if upright else int(size.argmax()))
    return Mesh(vertices * size, faces, uvs * size[axes][:, None, :])


def cushion(
    width: float, depth: float, height: float, radius: float, puff: float = 0.0, steps: int = 3
) -> Mesh:
    """Make a box with round edges.

    Args:
        width: Along x, m.
        depth: Along y, m.
        height: Along z without the bulge, m.
        radius: Of the edges, m, at most half of the smallest side.
        puff: How much thinner it gets towards its rim, as a share of the height.
        steps: Facets across half of a round edge.
    """
    half = np.array([width, depth, height]) / 2
    radius = min(radius, float(half.min()) * 0.999)
    # tan spreads the facets evenly over the angle.
    edge = radius * np.tan(np.linspace(0, np.pi / 4, steps + 1))
    vertices: list[Floats] = []
    quads: list[Ints32] = []
    for axis in range(3):
        first, second = (axis + 1) % 3, (axis + 2) % 3
        u, v = (_spacing(half[k] - radius, edge, 7 if puff else 2) for k in (first, second))
        for sign in (-1.0, 1.0):
            start = np.int32(sum(len(points) for points in vertices))
            block = np.empty((len(u), len(v), 3))
            block[:, :, axis] = sign * half[axis]
            block[:, :, first], block[:, :, second] = u[:, None], v[None, :]
            vertices.append(block.reshape(-1, 3))
            quads.append(_grid_quads(len(u), len(v), flip=sign < 0) + start)
    points = np.concatenate(vertices)
    inner = np.clip(points, radius - half, half - radius)
    offset = points - inner
    points = inner + radius * offset / np.linalg.norm(offset, axis=1, keepdims=True)
    if puff:
        x, y = points[:, 0] / half[0], points[:, 1] / half[1]
        points[:, 2] *= 1 - puff + puff * (1 - x**4) * (1 - y**4)
        # The rim of a cushion is drawn in between its corners.
        points[:, 0] *= 1 - 0.08 * puff * (1 - y**2)
        points[:, 1] *= 1 - 0.08 * puff * (1 - x**2)
    points[:, 2] -= points[:, 2].min()
    return project_texture(points, split_quads(np.concatenate(quads)), None)


def _spacing(flat_half: float, edge: Floats, count: int) -> Floats:
    """Return the coordinates across a side: `count` in its middle, and the two round edges."""
    middle = np.linspace(-flat_half, flat_half, count)
    return np.concatenate([-flat_half - edge[:0:-1], middle, flat_half + edge[1:]])


def _grid_quads(rows: int, columns: int, *, flip: bool = False) -> Ints32:
    """Return the quads of a grid [rows,columns]; normals are cross(row step, column step)."""
    index = np.arange(rows * columns, dtype=np.int32).reshape(rows, columns)
    corners = [index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]]
    return np.stack([c.ravel() for c in (corners[::-1] if flip else corners)], axis=1)


def lathe(profile: ArrayLike, segments: int = 32) -> Mesh:
    """Rotate a profile about the z axis.

    Args:
        profile: [K,2] float, m: radius and z, from the lower middle around the outside to the upper
            middle; it is closed if it begins and ends with radius 0.
        segments: Facets around.
    """
    points = np.asarray(profile, np.float64)
    angles = np.linspace(-np.pi / 2, 1.5 * np.pi, segments + 1)
    vertices = np.empty((segments, len(points), 3))
    vertices[:, :, 0] = points[:, 0] * np.cos(angles[:-1, None])
    vertices[:, :, 1] = points[:, 0] * np.sin(angles[:-1, None])
    vertices[:, :, 2] = points[:, 1]
    rows = np.arange(segments)[:, None]
    ring = np.arange(len(points) - 1)[None, :]
    here, there = rows * len(points) + ring, (rows + 1) % segments * len(points) + ring
    quads = np.stack([here, there, there + 1, here + 1], axis=2).reshape(-1, 4)
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    around = np.linspace(0, 2 * np.pi * points[:, 0].max(), segments + 1)
    v = lengths[-1] - lengths
    left, right = np.broadcast_arrays(around[:-1, None], v[:-1])[0], around[1:, None]
    corner_uvs = np.empty((segments, len(points) - 1, 4, 2))
    corner_uvs[:, :, 0, 0] = corner_uvs[:, :, 3, 0] = left
    corner_uvs[:, :, 1, 0] = corner_uvs[:, :, 2, 0] = right
    corner_uvs[:, :, :2, 1], corner_uvs[:, :, 2:, 1] = v[:-1, None], v[1:, None]
    uvs = corner_uvs.reshape(-1, 4, 2)
    faces = split_quads(quads)
    face_uvs = np.concatenate([uvs[:, [0, 1, 2]], uvs[:, [0, 2, 3]]])
    # On the axis one of the two triangles of a quad has no area.
    on_axis = np.tile(points[:, 0] <= 0, segments)
    is_flat = on_axis[faces].sum(axis=1) > 1
    return Mesh(vertices.reshape(-1, 3), faces[~is_flat], face_uvs[~is_flat])


def cylinder(radius: float, height: float, top_radius: float | None = None, n: int = 24) -> Mesh:
    """Make a cylinder or a frustum of a cone; the ends are textured as flat discs.

    Args:
        radius: Of the bottom, m.
        height: Along z, m.
        top_radius: m; None for a cylinder.
        n: Number of facets.
    """
    top = radius if top_radius is None else top_radius
    side = lathe([(radius, 0), (top, height)], n)
    ends = [disc(top, n).translate(z=height)] if top > 0 else []
    return join([side, *ends, flip(disc(radius, n))])


def disc(radius: float, n: int = 32) -> Mesh:
    """Make a flat disc at z = 0 that faces up.

    Args:
        radius: m.
        n: Number of facets.
    """
    angles = np.linspace(0, 2 * np.pi, n, endpoint=False)
    rim = np.stack([np.cos(angles), np.sin(angles), np.zeros(n)], axis=1) * radius
    index = np.arange(n)
    faces = np.stack([np.full(n, n), index, (index + 1) % n], axis=1).astype(np.int32)
    return project_texture(np.concatenate([rim, np.zeros((1, 3))]), faces, None)


def ellipsoid(width: float, depth: float, height: float, segments: int = 20) -> Mesh:
    """Make an ellipsoid that stands on the x-y plane.

    Args:
        width: Along x, m.
        depth: Along y, m.
        height: Along z, m.
        segments: Number of facets around.
    """
    angles = np.linspace(-np.pi / 2, np.pi / 2, segments // 2 + 1)
    profile = np.stack([np.cos(angles), 1 + np.sin(angles)], axis=1) / 2 * height
    profile[[0, -1], 0] = 0
    return lathe(profile, segments).scale(width / height, depth / height)


def tube(path: ArrayLike, radius: float, n: int = 10) -> Mesh:
    """Make a round rod along a path.

    Args:
        path: [K,3] float, m; neighbours differ.
        radius: m.
        n: Facets around.
    """
    points = np.asarray(path, np.float64)
    ahead = np.gradient(points, axis=0)
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    side = cross(ahead[:1], np.eye(3)[[np.abs(ahead[0]).argmin()]])[0]
    angles = np.linspace(0, 2 * np.pi, n, endpoint=False)
    rings = []
    for point, direction in zip(points, ahead, strict=True):
        # Carried along without twist.
        side = side - direction * (side @ direction)
        side /= np.sqrt(side @ side)
        up = cross(direction[None], side[None])[0]
        rings.append(
            point + radius * (np.cos(angles)[:, None] * side + np.sin(angles)[:, None] * up)
        )
    count = len(points)
    vertices = np.concatenate([*rings, points[:1], points[-1:]])
    ring, index = np.arange(count - 1)[:, None] * n, np.arange(n)[None, :]
    following = (index + 1) % n
    quads = np.stack(
        [ring + index, ring + following, ring + n + following, ring + n + index], axis=2
    )
    first, last = np.full(n, count * n), np.full(n, count * n + 1)
    end = (count - 1) * n
    faces = np.concatenate(
        [
            split_quads(quads.reshape(-1, 4)),
            np.stack([first, following[0], index[0]], axis=1),
            np.stack([last, end + index[0], end + following[0]], axis=1),
        ]
    ).astype(np.int32)
    return project_texture(vertices, faces, int(np.ptp(points, axis=0).argmax()))


def sheet(front: ArrayLike, thickness: float, height: float) -> Mesh:
    """Make an upright sheet whose front follows a curve, such as a curtain.

    Args:
        front: [K,2] float, m: x and y, x rising.
        thickness: Towards +y, m.
        height: m.
    """
    line = np.asarray(front, np.float64)
    count = len(line)
    lengths = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    back = line + np.array([0.0, thickness])
    vertices = np.zeros((4, count, 3))
    for row, (curve, z) in enumerate([(line, 0), (line, height), (back, height), (back, 0)]):
        vertices[row, :, :2], vertices[row, :, 2] = curve, z
    index = np.arange(4 * count).reshape(4, count)
    quads = [
        np.stack([index[r, :-1], index[r, 1:], index[(r + 1) % 4, 1:], index[(r + 1) % 4, :-1]], 1)
        for r in range(4)
    ]
    ends = [[index[0, 0], index[1, 0], index[2, 0], index[3, 0]], index[::-1, -1].tolist()]
    faces = split_quads(np.concatenate([*quads, ends]))
    uvs = np.stack([np.tile(lengths, 4), (height - vertices[:, :, 2]).ravel()], axis=1)
    return Mesh(vertices.reshape(-1, 3), faces, uvs[faces])


def prism(outline: ArrayLike, depth: float) -> Mesh:
    """Extrude a convex outline in the x-z plane, counter-clockwise seen from the front.

    Args:
        outline: [K,2] float, m: x and z.
        depth: Along y, m; the prism lies half before and half behind the x-z plane.
    """
    points = np.asarray(outline, np.float64)
    count = len(points)
    vertices = np.zeros((2, count, 3))
    vertices[:, :, [0, 2]] = points
    vertices[0, :, 1], vertices[1, :, 1] = -depth / 2, depth / 2
    index = np.arange(count)
    following = (index + 1) % count
    fan = np.stack([np.zeros(count - 2, np.int64), index[1:-1], index[2:]], axis=1)
    sides = split_quads(np.stack([index, index + count, following + count, following], axis=1))
    faces = np.concatenate([fan, fan[:, ::-1] + count, sides]).astype(np.int32)
    return project_texture(vertices.reshape(-1, 3), faces, None)


def leaf(length: float, width: float, bend_rad: float, thickness: float = 0.002) -> Mesh:
    """Make a leaf that grows from the origin along +x and bends down.

    Args:
        length: m.
        width: m, at its widest.
        bend_rad: How much its tip points further down than its base.
        thickness: m, of its rib.
    """
    t = np.linspace(0, 1, 6)
    angle = -bend_rad * t
    step = np.diff(t, prepend=0) * length
    x, z = np.cumsum(step * np.cos(angle)), np.cumsum(step * np.sin(angle))
    half = width / 2 * np.sin(np.pi * np.clip(t, 0.02, 0.98) ** 0.8)
    half[-1] = 0.001
    spine = np.stack([x, np.zeros(6), z], axis=1)
    left, right = spine + half[:, None] * (0, 1, 0), spine - half[:, None] * (0, 1, 0)
    rib = np.array([0, 0, thickness])
    grid = np.stack([right, spine + rib, left, spine - rib], axis=1)
    ring = np.arange(5)[:, None] * 4
    index, following = np.arange(4)[None, :], (np.arange(4)[None, :] + 1) % 4
    quads = np.stack([ring + index, ring + 4 + index, ring + 4 + following, ring + following], 2)
    faces = np.concatenate(
        [split_quads(quads.reshape(-1, 4)), split_quads([[3, 0, 1, 2], [20, 23, 22, 21]])]
    ).astype(np.int32)
    uv = np.stack(np.broadcast_arrays(t[:, None] * length, [width, width / 2, 0, width / 2]), 2)
    return Mesh(grid.reshape(-1, 3), faces, uv.reshape(-1, 2)[faces])
