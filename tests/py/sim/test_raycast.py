"""Tests of the ray caster against analytic planes, boxes, light and textures."""

from dataclasses import replace

import numpy as np
import pytest
import shading_oracle
import sim_scenes

import gslts
from gslts._core import sim as core_sim
from gslts_sim import make_home
from gslts_sim.home import Home
from gslts_sim.ray_scene import RayScene
from gslts_sim.raycast import RayCaster
from gslts_sim.texture_atlas import linear_from_srgb, srgb_from_linear

EYE, TARGET = np.array([0.4, 0.5, 1.6]), np.array([3.0, 2.2, 0.7])


def tilted_camera(width: int = 80, height: int = 60) -> gslts.Camera:
    return gslts.camera_from_fov(width, height, 1.2, gslts.look_at(EYE, TARGET))


def unproject(camera: gslts.Camera, depth: np.ndarray) -> np.ndarray:
    """Return the points [H,W,3] in the world, by the conventions in the README."""
    rows, columns = np.indices(depth.shape) + 0.5
    x = (columns - camera.cx) / camera.fx * depth
    y = (rows - camera.cy) / camera.fy * depth
    pose = camera.world_from_camera
    return np.stack([x, y, depth], axis=-1) @ pose[:3, :3].T + pose[:3, 3]


def slab_depth(camera: gslts.Camera, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return the depths [H,W] at which rays enter and leave a box; enter > leave for a miss."""
    directions = unproject(camera, np.ones((camera.height, camera.width))) - EYE
    with np.errstate(divide="ignore"):
        a, b = (low - EYE) / directions, (high - EYE) / directions
    return np.minimum(a, b).max(axis=-1), np.maximum(a, b).min(axis=-1)


def test_depth_and_instances_are_those_of_the_boxes() -> None:
    camera = tilted_camera()
    view = RayCaster(sim_scenes.simple_home()).render(camera)
    _, wall = slab_depth(camera, np.zeros(3), np.array([5, 4, 2.6]))
    enter, leave = slab_depth(camera, np.array([2.0, 1.5, 0]), np.array([3.2, 2.3, 0.75]))
    on_block = enter < leave
    clear = np.abs(enter - leave) > 0.02  # A ray along an edge may hit or miss.
    expected = np.where(on_block, enter, wall)
    np.testing.assert_allclose(view.depth[clear], expected[clear], rtol=1e-4)
    np.testing.assert_array_equal(view.instances[clear], on_block[clear].astype(int))
    assert 200 < on_block.sum() < 2400
    assert view.depth.dtype == np.float32
    assert view.instances.dtype == np.int32


def test_points_of_one_view_are_seen_in_another() -> None:
    """Unprojected depth agrees with depth and projection of a second camera."""
    caster = RayCaster(sim_scenes.simple_home())
    first = tilted_camera(160, 120)
    second = gslts.camera_from_fov(160, 120, 1.3, gslts.look_at((0.7, 0.4, 1.5), TARGET))
    points = unproject(first, caster.render(first).depth.astype(np.float64))
    camera_from_world = np.linalg.inv(second.world_from_camera)
    x, y, z = np.moveaxis(points @ camera_from_world[:3, :3].T + camera_from_world[:3, 3], -1, 0)
    column = np.floor(second.fx * x / z + second.cx).astype(int)
    row = np.floor(second.fy * y / z + second.cy).astype(int)
    inside = (z > 0) & (column >= 0) & (column < 160) & (row >= 0) & (row < 120)
    depth = caster.render(second).depth
    agree = np.abs(depth[row[inside], column[inside]] - z[inside]) < 0.03 * z[inside]
    assert inside.mean() > 0.6
    assert agree.mean() > 0.97


def test_nothing_is_hit_outside() -> None:
    away = gslts.camera_from_fov(20, 10, 1.0, gslts.look_at((9, 9, 1), (20, 20, 1)))
    view = RayCaster(sim_scenes.simple_home()).render(away)
    assert not view.depth.any()
    assert not view.radiance.any()
    assert (view.instances == -1).all()


def test_ambient_light_shows_the_texture_as_it_is() -> None:
    """In ambient light of 1 the radiance is the texture's linear colour with any filter."""
    rng = np.random.default_rng(0)
    texture = rng.integers(0, 256, (32, 64, 3), dtype=np.uint8)
    home = sim_scenes.simple_home(lights=False, wall=texture)
    # 0.2 mm of wall a pixel, and 16 mm a texel: no smaller level is needed.
    pose = gslts.look_at((2.5, 2.0, 1.2), (2.5, 0.0, 1.2))
    camera = gslts.Camera(
        fx=10_000, fy=10_000, cx=40, cy=30, width=80, height=60, world_from_camera=pose
    )
    radiance = RayCaster(home).render(camera).radiance
    points = unproject(camera, np.full((60, 80), 2.0))
    # The wall y = 0: u runs along z and v along x.
    u, v = points[..., 2] * 64 - 0.5, points[..., 0] * 32 - 0.5
    column, row = np.floor(u).astype(int), np.floor(v).astype(int)
    right, down = (u - column)[..., None], (v - row)[..., None]
    linear = linear_from_srgb(texture / 255)

    def texel(r: np.ndarray, c: np.ndarray) -> np.ndarray:
        return linear[r % 32, c % 64]

    above = (1 - right) * texel(row, column) + right * texel(row, column + 1)
    below = (1 - right) * texel(row + 1, column) + right * texel(row + 1, column + 1)
    np.testing.assert_allclose(radiance, (1 - down) * above + down * below, atol=2e-3)


def test_far_textures_are_averaged_and_not_picked() -> None:
    """A distant fine checkerboard has the mean of its light."""
    checkers = np.indices((64, 64)).sum(axis=0) % 2
    texture = np.repeat(np.where(checkers, 255, 0)[..., None], 3, axis=2).astype(np.uint8)
    home = sim_scenes.simple_home(lights=False, wall=texture)
    pose = gslts.look_at((2.5, 3.9, 1.2), (2.5, 0.0, 1.2))
    camera = gslts.Camera(fx=30, fy=30, cx=16, cy=12, width=32, height=24, world_from_camera=pose)
    view = RayCaster(home).render(camera)
    on_wall = (view.instances == 0) & (view.cosines > 0.8)
    np.testing.assert_allclose(view.radiance[on_wall], 0.5, atol=0.02)


def test_light_on_the_floor_is_that_of_the_form_factor() -> None:
    """Radiance x area x cosine^2 / (pi distance^2), for a light that is small or far."""
    home = sim_scenes.simple_home()
    caster = RayCaster(home)
    down = np.diag([1.0, -1.0, -1.0, 1.0])
    down[:3, 3] = (0.6, 0.6, 1.0)
    camera = gslts.Camera(fx=60, fy=60, cx=8, cy=6, width=16, height=12, world_from_camera=down)
    radiance = caster.render(camera).radiance[6, 8, 0]
    towards = np.array([2.5, 2.0, 2.59]) - (0.6, 0.6, 0.0)
    distance = np.linalg.norm(towards)
    cosine = towards[2] / distance
    expected = 20 * 0.36 * cosine**2 / (np.pi * distance**2) + 0.3
    assert radiance == pytest.approx(
        float(linear_from_srgb(np.float64(200 / 255))) * expected, rel=0.02
    )


def test_objects_block_light() -> None:
    home = sim_scenes.simple_home()
    under = sim_scenes.box_object("Lid|1", (2.0, 1.5, 2.3), (3.0, 2.5, 2.35), sim_scenes.plain(90))
    pose = np.diag([1.0, -1.0, -1.0, 1.0])
    pose[:3, 3] = (2.6, 1.9, 1.5)
    camera = gslts.Camera(fx=60, fy=60, cx=8, cy=6, width=16, height=12, world_from_camera=pose)
    lit = RayCaster(home).render(camera).radiance
    shaded = RayCaster(home.with_object(under)).render(camera).radiance
    ambient = 0.3 * float(linear_from_srgb(np.float64(128 / 255)))
    assert lit.min() > 2 * ambient
    np.testing.assert_allclose(shaded, ambient, rtol=1e-5)


def test_srgb_there_and_back() -> None:
    values = np.linspace(0, 1, 1000)
    np.testing.assert_allclose(srgb_from_linear(linear_from_srgb(values)), values, atol=1e-6)
    assert float(linear_from_srgb(np.float64(0.5))) == pytest.approx(0.21404, abs=1e-5)


def test_surfaces_glow_while_a_light_of_their_object_is_on() -> None:
    home = sim_scenes.simple_home()
    block = home["Block|1"]
    glowing = replace(block, surfaces=(replace(block.surfaces[0], emission=2.0),))
    home = home.with_object(glowing)
    camera = tilted_camera()
    off = RayCaster(home).render(camera)
    on = RayCaster(home, (replace(home.lights[0], owner="Block|1"),)).render(camera)
    on_block = off.instances == 1
    grey = linear_from_srgb(np.array(128 / 255))
    np.testing.assert_allclose((on.radiance - off.radiance)[on_block], 2 * grey, rtol=1e-4)
    np.testing.assert_array_equal(on.radiance[~on_block], off.radiance[~on_block])


def tiled_home(*, lights: bool = True) -> Home:
    """Return a furnished home with a lamp, a glowing block, and tiles of all mip levels."""
    tiles = np.random.default_rng(1).integers(0, 256, (48, 80, 3), dtype=np.uint8)
    home = replace(sim_scenes.furnished_home(lamp="Mug|1"))
    walls = sim_scenes.simple_home(wall=tiles).objects[0]
    block = sim_scenes.box_object("Block|7", (2.0, 1.0, 0.0), (2.6, 1.4, 0.5), tiles)
    glowing = replace(block, surfaces=(replace(block.surfaces[0], emission=2.0),))
    home = replace(home, objects=(walls, *home.objects[1:], glowing))
    return home if lights else replace(home, lights=())


@pytest.mark.parametrize("size", [(1, 1), (2, 3), (97, 61)])
@pytest.mark.parametrize("lights", [True, False])
def test_shading_is_that_of_numpy_bit_for_bit(size: tuple[int, int], lights: bool) -> None:
    home = tiled_home(lights=lights)
    shining = home.all_lights if lights else ()
    camera = tilted_camera(*size)
    views = [RayCaster(home, shining, threads).render(camera) for threads in (1, 2, 3)]
    expected = shading_oracle.radiance_of(RayCaster(home, shining), camera)
    for view in views:
        np.testing.assert_array_equal(view.radiance, expected)
    assert expected.max() > 0


def test_shading_sees_the_edge_of_the_world() -> None:
    """Some rays of a camera outside miss."""
    caster = RayCaster(tiled_home())
    camera = gslts.camera_from_fov(50, 40, 1.5, gslts.look_at((8, 2, 1.5), (2.5, 2.5, 1)))
    view = caster.render(camera)
    assert 0 < (view.instances >= 0).mean() < 1
    np.testing.assert_array_equal(view.radiance, shading_oracle.radiance_of(caster, camera))


def test_bad_hits_are_named() -> None:
    caster = RayCaster(sim_scenes.simple_home())
    rays, none = np.zeros((1, 2, 6), np.float32), np.zeros((0, 4, 3))

    def shade(depth: np.ndarray, triangle: int) -> core_sim.Shading:
        triangles, weights = np.full((1, 2), triangle, np.uint32), np.zeros((1, 2, 2), np.float32)
        return core_sim.Shading(
            caster._surfaces, rays, depth, triangles, weights, pixel_rad=0.1, lights=none, threads=1
        )

    with pytest.raises(ValueError, match="there is no triangle 4000000000"):
        shade(np.ones((1, 2), np.float32), 4_000_000_000)
    missed = shade(np.full((1, 2), np.inf, np.float32), 4_000_000_000)
    assert not missed.radiance(np.zeros(0, bool), np.ones(3)).any()
    with pytest.raises(ValueError, match=r"depth: expected .* \(1, 2\), got float32 \(2, 1\)"):
        shade(np.ones((2, 1), np.float32), 0)


def test_visible_triangles_are_those_that_embree_hits() -> None:
    """But for rays along edges, and surfaces that coincide."""
    scene = RayScene(make_home("living_room", 0))
    depths, instances = [], []
    for eye in ((0.3, 0.3, 1.5), (2.5, 2.0, 0.4), (3.0, 0.5, 2.3)):
        camera = gslts.camera_from_fov(160, 120, 1.2, gslts.look_at(eye, (2.0, 2.5, 0.8)))
        rays = core_sim.pixel_rays(camera, threads=1)
        pair = scene.cast(rays), scene.cast_pixels(camera, rays)
        depths.append([hits.distances for hits in pair])
        instances.append([scene.owners[hits.triangles] for hits in pair])
    expected, found = np.moveaxis(depths, 1, 0)
    assert np.isclose(found, expected, rtol=1e-5).mean() > 0.9999
    expected, found = np.moveaxis(instances, 1, 0)
    assert (found == expected).mean() > 0.9999
    assert len(np.unique(found)) > 20


def test_visible_triangles_need_three_corners() -> None:
    with pytest.raises(ValueError, match=r"corners: expected .*, got float32 \(5, 2, 3\)"):
        core_sim.visible_triangles(tilted_camera(), np.zeros((5, 2, 3), np.float32), threads=1)


def test_hits_lie_where_rays_meet_the_planes_of_their_triangles() -> None:
    """Compare with the solution of three equations in double precision."""
    rng = np.random.default_rng(0)
    corners = rng.uniform(-1, 1, (50, 3, 3)).astype(np.float32)
    hit = rng.integers(0, 50, 400).astype(np.uint32)
    weights = rng.dirichlet((1, 1, 1), 400)
    points = np.einsum("nk,nkd->nd", weights, corners[hit].astype(np.float64))
    origins = rng.uniform(-3, 3, (400, 3)).astype(np.float32)
    rays = np.concatenate([origins, (points - origins) / rng.uniform(0.5, 2, (400, 1))], axis=1)
    rays = rays.astype(np.float32)
    hit[::10] = 0xFFFFFFFF
    distances, found = core_sim.intersect_triangles(rays, hit, corners, threads=1)
    missed = hit == 0xFFFFFFFF
    assert np.isinf(distances[missed]).all()
    assert (found[missed] == 0).all()
    for k in np.flatnonzero(~missed):
        first, second, third = corners[hit[k]].astype(np.float64)
        ray = rays[k].astype(np.float64)
        matrix = np.column_stack([second - first, third - first, -ray[3:]])
        if np.linalg.cond(matrix) < 1e3:
            expected = np.linalg.solve(matrix, ray[:3] - first)
            np.testing.assert_allclose([*found[k], distances[k]], expected, rtol=2e-5, atol=2e-5)
    again = core_sim.intersect_triangles(rays, hit, corners, threads=2)
    np.testing.assert_array_equal(distances, again[0])
    np.testing.assert_array_equal(found, again[1])


def test_a_ray_in_the_plane_of_a_triangle_misses_it() -> None:
    corners = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]]], np.float32)
    rays = np.array([[-1, 0.25, 0, 1, 0, 0]], np.float32)
    distances, weights = core_sim.intersect_triangles(
        rays, np.zeros(1, np.uint32), corners, threads=1
    )
    assert np.isinf(distances).all()
    assert (weights == 0).all()


def test_hits_of_missing_triangles_are_errors() -> None:
    rays, corners = np.zeros((1, 6), np.float32), np.zeros((2, 3, 3), np.float32)
    with pytest.raises(ValueError, match="hit: there are 2 triangles, got 2"):
        core_sim.intersect_triangles(rays, np.array([2], np.uint32), corners, threads=1)
