"""A corner of three planes with spots, looked at exactly: where a spot is, SIFT finds a feature."""

import analytic_room
import numpy as np

from gslts.core.camera import Camera, look_at
from gslts.core.frame import RgbdFrame


def spots(count: int = 400) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Centres [N,3] on the planes, m, radii [N] and colours [N,3], all different."""
    rng = np.random.default_rng(1)
    centres = rng.uniform(0, 3, (count, 3))
    plane = np.arange(count) % 3
    centres[plane == 0, 2] = 0
    centres[plane == 1, 0] = 3
    centres[plane == 2, 1] = 3
    return centres, rng.uniform(0.03, 0.07, count), rng.choice([-1, 1], (count, 3)) * 0.3


SPOTS = spots()


def camera_at(place: tuple, roll_rad: float = 0.0, width: int = 240) -> Camera:
    """Looks into the corner, with a principal point that is in the middle of nothing."""
    pose = look_at(np.array(place, float), np.array([2.6, 2.6, 0.6]))
    turn = np.eye(4)
    turn[:2, :2] = [[np.cos(roll_rad), -np.sin(roll_rad)], [np.sin(roll_rad), np.cos(roll_rad)]]
    return Camera(
        fx=0.9 * width,
        fy=0.92 * width,
        cx=0.52 * width,
        cy=0.36 * width,
        width=width,
        height=3 * width // 4,
        world_from_camera=pose @ turn,
    )


def cameras(count: int = 8) -> list[Camera]:
    """Side by side, each rolled differently."""
    return [
        camera_at((0.2 + 0.12 * k, 1.0 - 0.1 * k, 1.2 + 0.1 * (k % 3)), 0.8 * k)
        for k in range(count)
    ]


def frame(camera: Camera, mask: np.ndarray | None = None) -> RgbdFrame:
    """Its image, without depth."""
    depth = analytic_room.observe(camera)[1]
    rows, columns = np.indices(depth.shape) + 0.5
    x, y = (columns - camera.cx) / camera.fx, (rows - camera.cy) / camera.fy
    pose = camera.world_from_camera
    in_camera = np.stack([x, y, np.ones_like(x)], axis=-1) * depth[..., None]
    points = in_camera @ pose[:3, :3].T + pose[:3, 3]
    rgb = np.full((*depth.shape, 3), 0.5)
    for centre, radius, color in zip(*SPOTS, strict=True):
        squares = ((points - centre) ** 2).sum(axis=-1)
        near = squares < (4 * radius) ** 2
        rgb[near] += np.exp(squares[near] / (-2 * radius**2))[:, None] * color
    pixels = (255 * rgb.clip(0, 1)).round().astype(np.uint8)
    return RgbdFrame(pixels, np.zeros(depth.shape, np.float32), camera, mask=mask)


def from_planes(points: np.ndarray) -> np.ndarray:
    """[P] m, of points to the nearest plane."""
    return np.abs(points @ analytic_room.NORMALS.T - analytic_room.OFFSETS).min(axis=1)


def from_spots(points: np.ndarray) -> np.ndarray:
    """[P] m, of points to the nearest spot."""
    return np.linalg.norm(points[:, None] - SPOTS[0], axis=2).min(axis=1)
