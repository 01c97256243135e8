"""A furnished room made of Gaussians: the ground truth of the examples."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import gslts
from gslts.core.gaussian_map import SH_C0

Array = NDArray[np.float64]

SIZE_M = np.array([4.4, 3.6, 2.4])


@dataclass(frozen=True)
class Surface:
    """Points on a surface, metres, world frame."""

    points: Array  # [N,3]
    normals: Array  # [N,3]
    albedo: Array  # [N,3] RGB
    spacing_m: float


@dataclass(frozen=True)
class Box:
    """An upright box between two corners, metres."""

    low: tuple[float, float, float]
    high: tuple[float, float, float]
    colour: tuple[float, float, float]


@dataclass(frozen=True)
class Ball:
    """A ball, metres."""

    centre: tuple[float, float, float]
    radius_m: float
    colour: tuple[float, float, float]


WOOD, CREAM = (0.50, 0.30, 0.16), (0.93, 0.90, 0.82)
BOXES = (
    Box((1.55, 1.30, 0.66), (2.85, 2.25, 0.72), WOOD),  # Table top.
    *(Box((x, y, 0), (x + 0.08, y + 0.08, 0.66), WOOD) for x in (1.60, 2.72) for y in (1.35, 2.12)),
    Box((1.72, 1.45, 0.72), (2.02, 1.75, 1.02), (0.16, 0.42, 0.75)),  # Blue cube.
    Box((2.10, 1.95, 0.72), (2.50, 2.10, 0.95), (0.85, 0.62, 0.12)),  # Yellow book.
    Box((0.05, 2.90, 0), (1.20, 3.55, 0.45), (0.62, 0.16, 0.20)),  # Red sofa: seat
    Box((0.05, 3.35, 0.45), (1.20, 3.55, 0.90), (0.62, 0.16, 0.20)),  # and back.
    Box((3.75, 0.10, 0), (4.30, 1.10, 1.60), (0.24, 0.45, 0.36)),  # Green cupboard.
)
BALLS = (
    Ball((2.42, 1.58, 0.91), 0.19, (0.88, 0.28, 0.12)),
    Ball((1.00, 1.05, 0.28), 0.28, (0.92, 0.90, 0.86)),
    Ball((3.25, 2.75, 0.35), 0.35, (0.45, 0.22, 0.58)),
)


def build_room(spacing_m: float = 0.033) -> gslts.GaussianMap:
    """The room in float32: a flat Gaussian every few centimetres of every surface."""
    surfaces = [*shell(spacing_m * 1.1)]
    surfaces += [face for box in BOXES for face in box_faces(box, spacing_m * 0.8)]
    surfaces += [ball_surface(ball, spacing_m * 0.7) for ball in BALLS]
    points = np.concatenate([surface.points for surface in surfaces])
    normals = np.concatenate([surface.normals for surface in surfaces])
    albedo = np.concatenate([surface.albedo for surface in surfaces])
    spacing = np.repeat([s.spacing_m for s in surfaces], [len(s.points) for s in surfaces])
    colours = np.clip(albedo * light_at(points, normals)[:, None], 0, 1)
    scales = spacing[:, None] * np.array([0.65, 0.65, 0.1])
    return gslts.GaussianMap(
        means=points.astype(np.float32),
        quats=rotations_from_z(normals).astype(np.float32),
        log_scales=np.log(scales).astype(np.float32),
        logit_opacities=np.full(len(points), 4, np.float32),
        sh=((colours - 0.5) / SH_C0)[:, None].astype(np.float32),
    )


def shell(spacing_m: float) -> list[Surface]:
    """Floor, ceiling and walls with their patterns."""
    width, length, height = SIZE_M
    ex, ey, ez = np.eye(3)
    floor = rectangle(np.zeros(3), width * ex, length * ey, ez, spacing_m)
    tile = np.floor(floor.points[:, :2] / 0.4).sum(axis=1) % 2 == 0
    floor = repaint(floor, np.where(tile[:, None], (0.80, 0.74, 0.62), (0.34, 0.38, 0.44)))
    ceiling = rectangle(height * ez, width * ex, length * ey, -ez, 2 * spacing_m)
    south = rectangle(np.zeros(3), width * ex, height * ez, ey, spacing_m)
    stripes = np.floor(south.points[:, 0] / 0.22) % 2 == 0
    south = repaint(south, np.where(stripes[:, None], (0.72, 0.80, 0.84), (0.60, 0.70, 0.77)))
    north = rectangle(length * ey, width * ex, height * ez, -ey, spacing_m)
    west = rectangle(np.zeros(3), length * ey, height * ez, ex, spacing_m)
    east = rectangle(width * ex, length * ey, height * ez, -ex, spacing_m)
    return [
        floor,
        repaint(ceiling, np.full(ceiling.points.shape, 0.9)),
        south,
        repaint(north, with_painting(north, north.points[:, 0] - 2.3)),
        repaint(west, with_painting(west, west.points[:, 1] - 1.6)),
        east,
    ]


def with_painting(wall: Surface, across: Array) -> Array:
    """Return the colours of a wall with a framed painting of coloured rings at eye height."""
    up = wall.points[:, 2] - 1.5
    radius = np.hypot(across / 0.75, (up + 0.12) / 0.45)
    rings = 0.5 + 0.5 * np.cos(np.outer(9 * radius, np.ones(3)) + np.array([0.0, 0.9, 2.2]))
    image = 0.15 + 0.8 * rings * np.array([1.0, 0.75, 0.6])
    frame = (abs(across) < 0.70) & (abs(up) < 0.50)
    inside = (abs(across) < 0.62) & (abs(up) < 0.42)
    painted = np.where(frame[:, None], (0.16, 0.11, 0.08), wall.albedo)
    return np.where(inside[:, None], image, painted)


def rectangle(corner: Array, u: Array, v: Array, normal: Array, spacing_m: float) -> Surface:
    """Points on the rectangle of edges u and v at `corner`."""
    counts = [max(2, round(np.linalg.norm(edge) / spacing_m)) for edge in (u, v)]
    a, b = np.meshgrid(*[(np.arange(n) + 0.5) / n for n in counts])
    points = corner + a.reshape(-1, 1) * u + b.reshape(-1, 1) * v
    albedo = np.broadcast_to(CREAM, points.shape)
    return Surface(points, np.broadcast_to(normal, points.shape), albedo, spacing_m)


def repaint(surface: Surface, albedo: Array) -> Surface:
    return Surface(surface.points, surface.normals, albedo, surface.spacing_m)


def box_faces(box: Box, spacing_m: float) -> list[Surface]:
    low, high = np.array(box.low), np.array(box.high)
    faces = []
    for axis in range(3):
        u, v = (np.eye(3)[k] * (high - low)[k] for k in range(3) if k != axis)
        for corner, sign in ((low, -1), (high - (u + v), 1)):
            face = rectangle(corner, u, v, sign * np.eye(3)[axis], spacing_m)
            faces.append(repaint(face, np.broadcast_to(box.colour, face.points.shape)))
    return faces


def ball_surface(ball: Ball, spacing_m: float) -> Surface:
    """Points along a spiral from pole to pole, evenly spread."""
    count = round(4 * np.pi * ball.radius_m**2 / spacing_m**2)
    z = 1 - (2 * np.arange(count) + 1) / count
    angle = np.pi * (1 + np.sqrt(5)) * np.arange(count)
    ring = np.sqrt(1 - z * z)
    normals = np.stack([ring * np.cos(angle), ring * np.sin(angle), z], axis=1)
    points = np.array(ball.centre) + ball.radius_m * normals
    return Surface(points, normals, np.broadcast_to(ball.colour, points.shape), spacing_m)


def light_at(points: Array, normals: Array, samples: int = 12) -> Array:
    """Return [N] brightness: daylight from all sides and a square lamp with soft shadows."""
    rng = np.random.default_rng(0)
    lamp = np.array([2.0, 1.6, SIZE_M[2] - 0.05])
    total = np.zeros(len(points))
    for _ in range(samples):
        offset = lamp + np.append(rng.uniform(-0.35, 0.35, 2), 0) - points
        distance = np.linalg.norm(offset, axis=1)
        cosine = np.maximum(0, np.sum(offset * normals, axis=1) / distance)
        total += cosine / (0.6 + distance**2) * ~in_shadow(points + 0.004 * normals, offset)
    return 0.50 + 0.10 * normals[:, 2] + 2.5 * total / samples


def in_shadow(points: Array, offset: Array) -> NDArray[np.bool_]:
    """Return [N], true if furniture is between the points and points + offset."""
    hit = np.zeros(len(points), bool)
    for box in BOXES:
        with np.errstate(divide="ignore"):
            first = (np.array(box.low) - points) / offset
            second = (np.array(box.high) - points) / offset
        enter = np.minimum(first, second).max(axis=1)
        leave = np.maximum(first, second).min(axis=1)
        hit |= (leave > np.maximum(enter, 0)) & (enter < 1)
    for ball in BALLS:
        to_centre = np.array(ball.centre) - points
        along = np.sum(to_centre * offset, axis=1) / np.sum(offset * offset, axis=1)
        nearest = to_centre - np.clip(along, 0, 1)[:, None] * offset
        hit |= np.linalg.norm(nearest, axis=1) < ball.radius_m
    return hit


def rotations_from_z(normals: Array) -> Array:
    """[N,4] wxyz rotations that turn z to the normals."""
    x, y, z = normals.T
    quats = np.stack([1 + z, -y, x, np.zeros_like(z)], axis=1)
    quats[z < -1 + 1e-9] = (0, 1, 0, 0)
    return quats / np.linalg.norm(quats, axis=1, keepdims=True)


def cameras(count: int, *, width: int, height: int, phase: float = 0) -> list[gslts.Camera]:
    """Make cameras on a loop near the walls that look at the furniture in the middle."""
    views = []
    for i in range(count):
        angle = 2 * np.pi * (i + phase) / count
        eye = SIZE_M / 2 + (1.75 * np.cos(angle), 1.4 * np.sin(angle), 0.35 + 0.2 * (-1) ** i)
        target = (2.2 - 0.3 * np.cos(angle), 1.8 - 0.3 * np.sin(angle), 0.75)
        views.append(gslts.camera_from_fov(width, height, 1.25, gslts.look_at(eye, target)))
    return views
