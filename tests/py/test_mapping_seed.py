"""First Gaussians from depth, and the correction of poses."""

import numpy as np
import pytest
import sim_scenes

import gslts
from gslts.bench.rooms import make_room
from gslts.mapping.pose import align, moved, twist_between
from gslts.mapping.seed import LEAST_HITS, seed_from_depth, surface_points
from gslts.sim.controller import Controller

VOXEL_M = 0.05


@pytest.fixture(scope="module")
def frames() -> list:
    robot = Controller(sim_scenes.simple_home(), width=160, height=120)
    frames = []
    for x, y in ((1.0, 1.0), (1.25, 1.0), (1.0, 1.25)):
        robot.act("Teleport", position={"x": x, "y": y}, rotation=30.0, horizon=20.0)
        frames.append(robot.observe())
    return frames


def distance_to_surfaces(points: np.ndarray) -> np.ndarray:
    """Of points to the nearest wall of the room or side of the block."""
    room = np.stack([points, np.array([5, 4, 2.6]) - points]).min(axis=0).min(axis=1)
    low, high = np.array([2.0, 1.5, 0]), np.array([3.2, 2.3, 0.75])
    outside = np.maximum(np.maximum(low - points, points - high), 0)
    inside = np.minimum(points - low, high - points).min(axis=1)
    block = np.where(inside > 0, inside, np.linalg.norm(outside, axis=1))
    return np.minimum(np.abs(room), block)


def test_points_lie_on_surfaces_and_normals_look_at_the_camera(frames: list) -> None:
    points, normals, colors = surface_points(frames[0])
    assert distance_to_surfaces(points).max() < 1e-3
    eye = frames[0].camera.world_from_camera[:3, 3]
    assert (((eye - points) * normals).sum(axis=1) > 0).all()
    axes = np.abs(normals).max(axis=1)  # All surfaces are along the axes.
    assert np.quantile(axes, 0.1) > 0.999
    assert ((colors >= 0) & (colors <= 1)).all()


def test_seeds_are_flat_on_the_surfaces_and_as_dense_as_voxels(frames: list) -> None:
    seeds = seed_from_depth(frames, VOXEL_M, sh_degree=1)
    points = seeds.means.astype(np.float64)
    assert np.quantile(distance_to_surfaces(points), 0.95) < 2e-3
    cells = {tuple(cell) for cell in np.floor(points / VOXEL_M).astype(int)}
    assert len(cells) > 0.97 * seeds.size
    assert seeds.sh.shape == (seeds.size, 4, 3)
    w, x, y, z = seeds.quats.T
    thin = np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], axis=1)
    assert np.quantile(np.abs(thin).max(axis=1), 0.1) > 0.99, "the short axis is the normal"
    assert (seeds.log_scales[:, 2] < seeds.log_scales[:, 0]).all()


def test_seeds_look_like_what_was_seen(frames: list) -> None:
    seeds = seed_from_depth(frames, 0.08)
    images = gslts.render(seeds, frames[0].camera)
    seen = images.alpha > 0.7
    assert seen.mean() > 0.7
    assert np.median(np.abs(images.depth - frames[0].depth)[seen]) < 0.04
    rgb = frames[0].rgb / 255
    assert np.median(np.abs(images.rgb - rgb)[seen]) < 0.05


def test_what_one_frame_saw_is_no_seed(frames: list) -> None:
    assert LEAST_HITS == 2
    with pytest.raises(ValueError, match="no surface was measured by two frames"):
        seed_from_depth(frames[:1], VOXEL_M)
    turned = Controller(sim_scenes.simple_home(), width=160, height=120)
    turned.act("Teleport", position={"x": 1.0, "y": 1.0}, rotation=210.0, horizon=20.0)
    with pytest.raises(ValueError, match="no surface was measured by two frames"):
        seed_from_depth([frames[0], turned.observe()], VOXEL_M)


@pytest.mark.parametrize("axis", range(6))
def test_poses_return_from_a_wrong_start(axis: int) -> None:
    """By 1 cm or half a degree, along and about each axis."""
    room = make_room("S")
    truth = room.camera
    photo = gslts.render(room.gaussian_map, truth)
    twist = np.zeros(6)
    twist[axis] = 0.01 if axis < 3 else np.deg2rad(0.5)
    camera = moved(truth, twist)
    np.testing.assert_allclose(twist_between(truth, camera), twist, atol=1e-6)
    for _ in range(8):
        images = gslts.render(room.gaussian_map, camera)
        equations = align(camera, images.rgb, images.depth, photo.rgb, photo.depth)
        step = np.linalg.solve(equations.hessian, equations.right)
        camera = moved(camera, step)
    off = twist_between(camera, truth)
    assert np.linalg.norm(off[:3]) < 0.0005
    assert np.linalg.norm(off[3:]) < np.deg2rad(0.02)
