"""Shading of simulated frames in numpy: a readable, slow oracle."""

import numpy as np

from gslts.core.camera import Camera
from gslts_sim.home import AreaLight
from gslts_sim.raycast import RayCaster
from gslts_sim.texture_atlas import LINEAR_OF_BYTE, texture_atlas


def radiance_of(caster: RayCaster, camera: Camera) -> np.ndarray:
    """Return [H,W,3] float32, linear RGB; 0 where nothing is hit."""
    columns = (np.arange(camera.width) + 0.5 - camera.cx) / camera.fx
    rows = (np.arange(camera.height) + 0.5 - camera.cy) / camera.fy
    right, down, ahead = camera.world_from_camera[:3, :3].T
    directions = right * columns[:, None] + down * rows[:, None, None] + ahead
    directions = directions.astype(np.float32)
    eye = np.broadcast_to(camera.world_from_camera[:3, 3].astype(np.float32), directions.shape)
    hits = caster._scene.cast(np.concatenate([eye, directions], axis=-1))
    hit = np.isfinite(hits.distances)
    depth = np.where(hit, hits.distances, np.float32(0))
    triangles = np.where(hit, hits.triangles, 0)
    normals = caster._scene.normals[triangles]
    cosines = _dot(normals, directions) / np.sqrt(_dot(directions, directions))
    normals = normals * -np.sign(cosines)[..., None]
    pixel_m = depth * np.float32(1 / camera.fx) / np.maximum(np.abs(cosines), np.float32(0.1))
    albedo = _sampled(caster, triangles, hits.weights, pixel_m)
    points = eye + directions * depth[..., None]
    direct = np.zeros_like(points)
    for light in caster.lights:
        direct += _from_light(caster, light, points, normals)[..., None] * _single(light.radiance)
    for axis in (1, 0):
        direct = _average(direct, normals, depth, axis)
    objects = [obj for obj in caster.home.objects for _ in obj.surfaces]
    surfaces = [surface for obj in caster.home.objects for surface in obj.surfaces]
    shining = {light.owner for light in caster.lights}
    glow = [
        surface.emission if obj.id in shining else 0
        for obj, surface in zip(objects, surfaces, strict=True)
    ]
    emission = np.repeat(_single(glow), [len(surface.faces) for surface in surfaces])
    light = direct + _single(caster.home.ambient) + emission[triangles][..., None]
    return albedo * light * hit[..., None]


def _single(values: object) -> np.ndarray:
    return np.asarray(values, np.float32)


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]


def _from_light(
    caster: RayCaster, light: AreaLight, points: np.ndarray, normals: np.ndarray
) -> np.ndarray:
    """Return the light [H,W] for a radiance of 1, from one of 4 x 4 points per pixel."""
    cross = np.cross(light.edge_u, light.edge_v)
    area = np.linalg.norm(cross)
    row, column = np.indices(points.shape[:2]) % 4
    i, j = np.array([0, 2, 3, 1])[row], np.array([0, 2, 3, 1])[column]
    u, v = _single((i + 0.5) / 4)[..., None], _single(((i + j) % 4 + 0.5) / 4)[..., None]
    start = points + np.float32(1e-3) * normals
    target = _single(light.center) + (u - 0.5) * _single(light.edge_u)
    directions = target + (v - 0.5) * _single(light.edge_v) - start
    here, there = _dot(directions, normals), -_dot(directions, _single(cross / area))
    factor = np.maximum(here, 0) * np.maximum(there, 0) * np.float32(area / np.pi)
    factor /= np.maximum(_dot(directions, directions) ** 2, np.float32(1e-6))
    return factor * ~caster._scene.blocked(np.concatenate([start, directions], axis=-1), 0.98)


def _average(values: np.ndarray, normals: np.ndarray, depth: np.ndarray, axis: int) -> np.ndarray:
    """Return means over -2 to 1 pixels along an axis, within one surface."""
    values, normals, depth = (np.moveaxis(a, axis, 0) for a in (values, normals, depth))
    total, weight, size = values.copy(), np.ones(depth.shape, np.float32), len(depth)
    for shift in (-2, -1, 1):
        if abs(shift) >= size:
            continue
        here = slice(max(0, -shift), min(size, size - shift))
        there = slice(max(0, shift), min(size, size + shift))
        step = np.abs(depth[here] - depth[there])
        same = step < np.float32(0.02 * abs(shift)) * depth[here]
        same &= _dot(normals[here], normals[there]) > np.float32(0.9)
        total[here] += values[there] * same[..., None]
        weight[here] += same
    return np.moveaxis(total / weight[..., None], 0, axis)


def _sampled(
    caster: RayCaster, triangles: np.ndarray, weights: np.ndarray, pixel_m: np.ndarray
) -> np.ndarray:
    """Return linear colours [H,W,3], interpolated between texels and between levels."""
    atlas = texture_atlas([s for obj in caster.home.objects for s in obj.surfaces])
    a, b, c = np.moveaxis(atlas["uvs"][triangles], -2, 0)
    uv = a + weights[..., :1] * (b - a) + weights[..., 1:] * (c - a)
    texels = np.maximum(pixel_m * atlas["texels_per_m"][triangles], np.float32(1e-6))
    last = atlas["level_count"][triangles] - 1
    level = np.clip(np.log2(texels.astype(np.float64)).astype(np.float32), 0, _single(last))
    lower = level.astype(np.int32)
    first = atlas["first_level"][triangles]
    near = _bilinear(atlas, first + lower, uv)
    far = _bilinear(atlas, first + np.minimum(lower + 1, last), uv)
    return near + (level - lower.astype(np.float32))[..., None] * (far - near)


def _bilinear(atlas: dict[str, np.ndarray], level: np.ndarray, uv: np.ndarray) -> np.ndarray:
    sizes = atlas["level_sizes"]
    starts = np.concatenate([[0], np.cumsum(sizes.astype(np.int64).prod(axis=1))])[level]
    size = sizes[level][..., ::-1]  # Width and height.
    at = uv * _single(size) - np.float32(0.5)
    corner = np.floor(at)
    right, down = np.moveaxis(at - corner, -1, 0)[..., None]
    corner = corner.astype(np.int64)

    def color(columns: int, rows: int) -> np.ndarray:
        column, row = np.moveaxis((corner + np.array([columns, rows])) % size, -1, 0)
        texels = atlas["texels"][starts + row * size[..., 0] + column]
        return LINEAR_OF_BYTE[texels[..., None] >> np.array([0, 8, 16], np.uint32) & 255]

    above = color(0, 0) + right * (color(1, 0) - color(0, 0))
    below = color(0, 1) + right * (color(1, 1) - color(0, 1))
    return above + down * (below - above)
