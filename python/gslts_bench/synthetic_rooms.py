"""Synthetic rooms S, M and L of the benchmarks, the same on every machine.

A room of 6 x 5 x 3 m. 70 % of the Gaussians lie on walls, floor and ceiling, 30 % on 15 boxes and
ellipsoids inside, spread by area, with 3 mm of noise along the normal. Each is a disc: lognormal
scales (sigma 0.3) around (2.5, 2.5, 0.5) cm x sqrt(100k / N), thin axis along the normal, turned at
random in its plane. Opacity is sigmoid(N(2, 1.5)), colour is smooth over position, the rows are in
random order. The camera stands at (1.0, 0.9, 1.5) and looks at (6, 5, 1.2) with a horizontal field
of view of 90 degrees.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gslts.core.camera import Camera, camera_from_fov, look_at
from gslts.core.gaussian_map import SH_C0, GaussianMap
from gslts.types import Floats

SEED = 0
"""Seed of all randomness; another one would change all results."""
ROOM_M = np.array([6.0, 5.0, 3.0])
"""Size of the room."""
ROOM_SHARE = 0.7
"""Share of the Gaussians on walls, floor and ceiling; the others are on objects."""
OBJECTS = 15
"""Number of objects."""
NORMAL_NOISE_M = 0.003
"""Standard deviation of the noise along the normal."""
EYE, TARGET = np.array([1.0, 0.9, 1.5]), np.array([6.0, 5.0, 1.2])
"""Position of the camera and the point that it looks at, m."""
HORIZONTAL_FOV_RAD = np.pi / 2
"""Horizontal field of view of the camera."""

NEAR_PLANE_M = 0.2
"""Near plane with which the rooms are rendered."""

OBJECT_HALF_SIZE_M = (0.15, 0.5)
"""Range of half sizes, chosen for the counts in benchmarks/workload_counts.py."""
OBJECT_CLEARANCE_M = 1.5
"""Minimum distance of an object's centre from the camera, chosen for the same counts."""


@dataclass(frozen=True)
class Size:
    """Number of Gaussians and image size in pixels."""

    gaussians: int
    width: int
    height: int


SIZES = {
    "S": Size(50_000, 300, 300),
    "M": Size(200_000, 640, 480),
    "L": Size(1_000_000, 1000, 1000),
}
"""Sizes of the rooms by name."""


@dataclass(frozen=True)
class Room:
    """A map with SH degree 3 and a camera in it; the first base alone is SH degree 0."""

    gaussian_map: GaussianMap
    camera: Camera


def sample_box(
    rng: np.random.Generator, n: int, center: Floats, half: Floats
) -> tuple[Floats, Floats]:
    """Sample points on the faces of a box, by area.

    Args:
        rng: Source of all randomness.
        n: Number of points.
        center: (3,) centre, m.
        half: (3,) half sizes, m.

    Returns:
        Points [n,3], m, and outward normals [n,3].
    """
    face_areas = np.array([half[1] * half[2], half[0] * half[2], half[0] * half[1]])
    axis = rng.choice(3, n, p=face_areas / face_areas.sum())
    sign = rng.choice([-1.0, 1.0], n)
    points = rng.uniform(-1, 1, (n, 3))
    points[np.arange(n), axis] = sign
    normals = np.zeros((n, 3))
    normals[np.arange(n), axis] = sign
    return center + points * half, normals


def sample_ellipsoid(
    rng: np.random.Generator, n: int, center: Floats, half: Floats
) -> tuple[Floats, Floats]:
    """Sample points on an ellipsoid, uniform in direction; see `sample_box`.

    Args:
        rng: Source of all randomness.
        n: Number of points.
        center: (3,) centre, m.
        half: (3,) half sizes, m.
    """
    directions = rng.normal(size=(n, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    normals = directions / half
    return center + directions * half, normals / np.linalg.norm(normals, axis=1, keepdims=True)


def place_objects(rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Draw centres and half sizes [OBJECTS,3] of boxes inside the room, m.

    Args:
        rng: Source of all randomness.
    """
    halves = rng.uniform(*OBJECT_HALF_SIZE_M, (OBJECTS, 3))
    centers = np.empty((OBJECTS, 3))
    for i, half in enumerate(halves):
        centers[i] = EYE
        while np.linalg.norm(centers[i] - EYE) < OBJECT_CLEARANCE_M:
            centers[i] = rng.uniform(half, ROOM_M - half)
    return centers, halves


def sample_surfaces(rng: np.random.Generator, n: int) -> tuple[Floats, Floats]:
    """Sample points [n,3], m, and normals [n,3] of the whole scene, the room first.

    Args:
        rng: Source of all randomness.
        n: Number of points.
    """
    centers, halves = place_objects(rng)
    on_room = round(ROOM_SHARE * n)
    parts = [sample_box(rng, on_room, ROOM_M / 2, ROOM_M / 2)]
    areas = (halves * np.roll(halves, 1, axis=1)).sum(axis=1)
    ends = np.round(np.cumsum(areas) / areas.sum() * (n - on_room)).astype(int)
    counts = np.diff(ends, prepend=0)
    for i, (count, center, half) in enumerate(zip(counts, centers, halves, strict=True)):
        sample = sample_box if i % 2 == 0 else sample_ellipsoid
        parts.append(sample(rng, count, center, half))
    points = np.concatenate([points for points, _ in parts])
    normals = np.concatenate([normals for _, normals in parts])
    return points + rng.normal(0, NORMAL_NOISE_M, (n, 1)) * normals, normals


def disc_quats(rng: np.random.Generator, normals: Floats) -> Floats:
    """Draw rotations [N,4] wxyz that take z to normals [N,3], after a random turn about z.

    Args:
        rng: Source of all randomness.
        normals: Unit normals [N,3].
    """
    nx, ny, nz = normals.T
    align = np.stack([1 + nz, -ny, nx, np.zeros_like(nz)], axis=1)
    align[nz < -1 + 1e-9] = (0, 1, 0, 0)
    align /= np.linalg.norm(align, axis=1, keepdims=True)
    half_turn = rng.uniform(0, np.pi, len(normals))
    c, s = np.cos(half_turn), np.sin(half_turn)
    w, x, y, z = align.T
    return np.stack([w * c - z * s, x * c + y * s, y * c - x * s, z * c + w * s], axis=1)


def make_room(name: str) -> Room:
    """Make room S, M or L with SH degree 3.

    Args:
        name: A name in `SIZES`.

    Returns:
        Map and camera.

    Raises:
        ValueError: The room does not exist.
    """
    if name not in SIZES:
        raise ValueError(f"make_room: name must be one of {', '.join(SIZES)}, got {name!r}")
    size = SIZES[name]
    n = size.gaussians
    rng = np.random.default_rng(SEED)
    means, normals = sample_surfaces(rng, n)
    scales = np.array([0.025, 0.025, 0.005]) * np.sqrt(100_000 / n)
    phases = rng.uniform(0, 2 * np.pi, 3)
    colors = 0.5 + 0.4 * np.sin(2 * means + np.roll(means, 1, axis=1) + phases)
    sh = rng.normal(0, 0.05, (n, 16, 3))
    sh[:, 0] = (colors - 0.5) / SH_C0
    quats = disc_quats(rng, normals)
    log_scales = np.log(scales) + rng.normal(0, 0.3, (n, 3))
    logit_opacities = rng.normal(2, 1.5, n)
    order = rng.permutation(n)
    gaussian_map = GaussianMap(
        means=means[order].astype(np.float32),
        quats=quats[order].astype(np.float32),
        log_scales=log_scales[order].astype(np.float32),
        logit_opacities=logit_opacities[order].astype(np.float32),
        sh=sh[order].astype(np.float32),
    )
    camera = camera_from_fov(size.width, size.height, HORIZONTAL_FOV_RAD, look_at(EYE, TARGET))
    return Room(gaussian_map, camera)
