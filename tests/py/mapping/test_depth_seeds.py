"""Seeds from depth and in holes, and the alignment of poses with them."""

from dataclasses import replace

import numpy as np
import pytest
import sim_scenes
import surface_oracle

import gslts
from gslts._core.fusion import SurfaceVoxels
from gslts.core.camera import at_pose
from gslts.core.frame import RgbdFrame
from gslts.core.se3 import se3_retract, twist_of
from gslts.localization.alignment import align
from gslts.mapping.seeding.depth_seeds import MIN_HITS, flat_gaussians, seed_from_depth
from gslts.mapping.seeding.hole_seeds import fill_zeros, seed_holes
from gslts_bench.synthetic_rooms import make_room
from gslts_sim.controller import Controller

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
    """Return distances of points from the nearest wall of the room or side of the block."""
    room = np.stack([points, np.array([5, 4, 2.6]) - points]).min(axis=0).min(axis=1)
    low, high = np.array([2.0, 1.5, 0]), np.array([3.2, 2.3, 0.75])
    outside = np.maximum(np.maximum(low - points, points - high), 0)
    inside = np.minimum(points - low, high - points).min(axis=1)
    block = np.where(inside > 0, inside, np.linalg.norm(outside, axis=1))
    return np.minimum(np.abs(room), block)


def fused(frames: list, voxel_m: float, step: int = 2) -> tuple[np.ndarray, ...]:
    surfaces = SurfaceVoxels(voxel_m, step)
    for frame in frames:
        surfaces.add(frame.depth, frame.rgb, frame.camera, frame.mask)
    return surfaces.voxels()


def test_points_lie_on_surfaces_and_normals_face_the_camera(frames: list) -> None:
    _, sums, _ = fused(frames[:1], 0.013)  # Mostly one point each.
    assert np.quantile(sums[:, 0], 0.9) <= 2
    points, normals, colors = (sums[:, k : k + 3] / sums[:, :1] for k in (1, 4, 7))
    assert np.quantile(distance_to_surfaces(points), 0.99) < 1e-3
    eye = frames[0].camera.world_from_camera[:3, 3]
    assert (((eye - points) * normals).sum(axis=1) > 0).all()
    axes = np.abs(normals).max(axis=1)  # All surfaces are along the axes.
    assert np.quantile(axes, 0.1) > 0.999
    assert ((colors >= 0) & (colors <= 1)).all()
    assert np.median(np.sqrt(sums[:, 10] / sums[:, 0])) < 0.5, "the room is plain"


@pytest.mark.parametrize("step", [1, 2, 3])
def test_voxels_are_those_of_numpy(frames: list, step: int) -> None:
    """Noisy depth with holes, random colours and a mask."""
    generator = np.random.default_rng(5)
    noisy = []
    for frame in frames:
        depth = frame.depth * generator.normal(1, 0.004, frame.depth.shape).astype(np.float32)
        depth[generator.random(depth.shape) < 0.03] = np.nan
        depth[generator.random(depth.shape) < 0.03] = 0
        rgb = generator.integers(0, 256, frame.rgb.shape).astype(np.uint8)
        mask = generator.random(depth.shape) > 0.02
        noisy.append(RgbdFrame(rgb, depth, frame.camera, mask=mask))
    edge_m = 0.0731
    expected = surface_oracle.fused(noisy, edge_m, step)
    assert len(expected) > 300
    keys, sums, hits = fused(noisy, edge_m, step)
    assert (np.diff(keys) > 0).all()
    cells = np.floor(sums[:, 1:4] / sums[:, :1] / edge_m).astype(int).tolist()
    assert {tuple(cell) for cell in cells} == set(expected)
    assert len(cells) == len(expected)
    np.testing.assert_allclose(sums, [expected[tuple(cell)][0] for cell in cells], atol=1e-9)
    np.testing.assert_array_equal(hits, [expected[tuple(cell)][1] for cell in cells])
    assert hits.max() == 3


def test_seeds_are_those_of_voxels_seen_twice(frames: list) -> None:
    edge_m = 0.0731
    expected = surface_oracle.fused(frames, edge_m, 2).values()
    sums = np.array([sums for sums, hits in expected if hits >= MIN_HITS])
    spacing_m = np.full(len(sums), edge_m)
    means = sums / sums[:, :1]
    flats = flat_gaussians(means[:, 1:4], means[:, 4:7], means[:, 7:10], spacing_m, 0.8, 0)
    seeds = seed_from_depth(frames, edge_m)
    assert seeds.size == len(sums)
    orders = [np.lexsort(np.floor(each.means / edge_m).T) for each in (seeds, flats)]
    for name in ("means", "quats", "log_scales", "logit_opacities", "sh"):
        actual, other = (
            getattr(each, name)[o] for each, o in zip((seeds, flats), orders, strict=True)
        )
        np.testing.assert_allclose(actual, other, atol=1e-5, err_msg=name)


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


def test_seeds_render_like_the_frames(frames: list) -> None:
    seeds = seed_from_depth(frames, 0.08)
    images = gslts.render(seeds, frames[0].camera)
    seen = images.alpha > 0.7
    assert seen.mean() > 0.7
    assert np.median(np.abs(images.depth - frames[0].depth)[seen]) < 0.04
    rgb = frames[0].rgb / 255
    assert np.median(np.abs(images.rgb - rgb)[seen]) < 0.05


def test_points_of_a_single_frame_are_not_seeded(frames: list) -> None:
    assert MIN_HITS == 2
    with pytest.raises(ValueError, match="no surface was measured by 2 frames"):
        seed_from_depth(frames[:1], VOXEL_M)
    turned = Controller(sim_scenes.simple_home(), width=160, height=120)
    turned.act("Teleport", position={"x": 1.0, "y": 1.0}, rotation=210.0, horizon=20.0)
    with pytest.raises(ValueError, match="no surface was measured by 2 frames"):
        seed_from_depth([frames[0], turned.observe()], VOXEL_M)


def test_plain_surfaces_take_few_seeds(frames: list) -> None:
    fine = seed_from_depth(frames, VOXEL_M)
    few = seed_from_depth(frames, VOXEL_M, contrast=0.5)
    assert few.size < 0.3 * fine.size
    widths_m = np.exp(few.log_scales[:, 0])
    assert widths_m.max() > 6 * widths_m.min()
    points = few.means.astype(np.float64)
    assert np.quantile(distance_to_surfaces(points), 0.9) < 3e-3
    covered = [gslts.render(seeds, frames[0].camera).alpha > 0.5 for seeds in (fine, few)]
    assert covered[1].mean() > covered[0].mean() - 0.03


def test_colours_keep_surfaces_fine(frames: list) -> None:
    checks = np.indices((120, 160)).sum(axis=0) // 4 % 2 * 200
    rgb = np.repeat(checks[..., None], 3, axis=2).astype(np.uint8)
    checked = [RgbdFrame(rgb, frame.depth, frame.camera) for frame in frames]
    fine = seed_from_depth(checked, VOXEL_M)
    assert seed_from_depth(checked, VOXEL_M, contrast=0.5).size > 0.9 * fine.size


@pytest.mark.parametrize("max_gaussians", [1500, 100])
def test_the_maximum_number_of_seeds_is_kept(frames: list, max_gaussians: int) -> None:
    assert seed_from_depth(frames, VOXEL_M).size > max_gaussians
    seeds = seed_from_depth(frames, VOXEL_M, max_gaussians=max_gaussians)
    assert 0.5 * max_gaussians < seeds.size <= max_gaussians


def test_pixels_outside_the_mask_give_no_points(frames: list) -> None:
    mask = np.zeros((120, 160), bool)
    mask[:, :80] = True
    frame = frames[0]
    masked = RgbdFrame(frame.rgb, frame.depth, frame.camera, mask=mask)
    counts = [fused([frame], VOXEL_M)[1][:, 0].sum() for frame in (masked, frame)]
    assert 0 < counts[0] < 0.6 * counts[1]


def test_arrays_of_any_memory_order_are_accepted(frames: list) -> None:
    turned = [
        RgbdFrame(
            np.asfortranarray(frame.rgb),
            np.asfortranarray(frame.depth),
            frame.camera,
            mask=np.asfortranarray(np.ones(frame.depth.shape, bool)),
        )
        for frame in frames
    ]
    seeds, other = (seed_from_depth(of, VOXEL_M) for of in (frames, turned))
    np.testing.assert_array_equal(seeds.means, other.means)


def test_bad_arrays_and_voxels_are_rejected(frames: list) -> None:
    with pytest.raises(ValueError, match="edge_m must be positive and finite, got 0"):
        seed_from_depth(frames, 0.0)
    with pytest.raises(ValueError, match="a point is too far from the first camera"):
        seed_from_depth(frames, 1e-7)
    surfaces, frame = SurfaceVoxels(VOXEL_M, 2), frames[0]
    with pytest.raises(ValueError, match=r"depth: expected .* float32 .*\(120, 160\), got float64"):
        surfaces.add(frame.depth.astype(np.float64), frame.rgb, frame.camera, None)
    with pytest.raises(ValueError, match=r"rgb: expected .*\(120, 160, 3\), got .*\(120, 160\)"):
        surfaces.add(frame.depth, frame.rgb[..., 0].copy(), frame.camera, None)
    with pytest.raises(ValueError, match=r"mask: expected .*bool .*, got uint8"):
        surfaces.add(frame.depth, frame.rgb, frame.camera, np.ones((120, 160), np.uint8))
    infinite = np.full_like(frame.depth, np.inf)
    with pytest.raises(ValueError, match="finite and not negative, or NaN, got inf in row 0"):
        surfaces.add(infinite, frame.rgb, frame.camera, None)
    assert len(surfaces.voxels()[0]) == 0


def test_holes_are_filled_at_the_depth_around_them(frames: list) -> None:
    frame = frames[0]
    seeds = seed_from_depth(frames, VOXEL_M)
    columns, rows, z = project(frame.camera, seeds.means.astype(np.float64))
    hole = (np.abs(columns - 80) < 20) & (np.abs(rows - 100) < 15) & (z > 0)  # In the floor.
    torn = seeds.select(~hole)
    images = gslts.render(torn, frame.camera)
    measured = np.zeros_like(frame.depth)
    new = seed_holes(frame.camera, images, frame.rgb / 255, measured, None, 0)
    assert new is not None
    columns, rows, z = project(frame.camera, new.means.astype(np.float64))
    inside = (np.abs(columns - 80) < 16) & (np.abs(rows - 100) < 11)
    assert inside.sum() > 20
    at = frame.depth[rows[inside].astype(int), columns[inside].astype(int)]
    assert np.median(np.abs(z[inside] - at) / at) < 0.08
    mask = np.ones_like(frame.depth, np.bool_)
    mask[80:, 50:110] = False
    masked = seed_holes(frame.camera, images, frame.rgb / 255, measured, mask, 0)
    assert masked is not None
    columns, rows, z = project(frame.camera, masked.means.astype(np.float64))
    assert not ((np.abs(columns - 80) < 28) & (rows > 82)).any()
    assert masked.size > 0.5 * new.size, "holes elsewhere are filled"
    whole = gslts.render(seeds, frame.camera)
    closed = replace(whole, alpha=np.maximum(whole.alpha, 0.4))
    assert seed_holes(frame.camera, closed, frame.rgb / 255, frame.depth, None, 0) is None


def test_zeros_are_filled_from_all_sides() -> None:
    known = np.zeros((33, 47))
    known[:, 0], known[:, -1] = 1.0, 3.0
    filled = fill_zeros(known)
    assert filled.min() == 1.0
    assert filled.max() == 3.0
    assert filled[:, 3].max() < 1.5 < 2.5 < filled[:, -4].min()
    np.testing.assert_array_equal(fill_zeros(np.full((5, 7), 2.0)), 2.0)


def project(camera: gslts.Camera, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    pose = np.linalg.inv(camera.world_from_camera)
    x, y, z = (points @ pose[:3, :3].T + pose[:3, 3]).T
    return camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy, z


def motion(start: gslts.Camera, end: gslts.Camera) -> np.ndarray:
    return np.linalg.inv(start.world_from_camera) @ end.world_from_camera


@pytest.mark.parametrize("axis", range(6))
def test_poses_converge_from_a_wrong_start(axis: int) -> None:
    """Off by 1 cm or half a degree, along and about each axis."""
    room = make_room("S")
    truth = room.camera
    photo = gslts.render(room.gaussian_map, truth)
    twist = np.zeros(6)
    twist[axis] = 0.01 if axis < 3 else np.deg2rad(0.5)
    camera = at_pose(truth, se3_retract(truth.world_from_camera, twist))
    np.testing.assert_allclose(twist_of(motion(truth, camera)), twist, atol=1e-6)
    for _ in range(8):
        images = gslts.render(room.gaussian_map, camera)
        alignment = align(camera, images.rgb, images.depth, photo.rgb, photo.depth)
        both = alignment.color + alignment.depth
        step = np.linalg.solve(both.hessian[:6, :6], both.right[:6])
        camera = at_pose(camera, se3_retract(camera.world_from_camera, step))
    off = twist_of(motion(camera, truth))
    assert np.linalg.norm(off[:3]) < 0.0005
    assert np.linalg.norm(off[3:]) < np.deg2rad(0.02)
