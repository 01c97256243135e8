"""Rigid motion of shifted objects: the Gaussians of a box move, those of the floor do not."""

from dataclasses import replace

import numpy as np
import pytest

from gslts.core.camera import at_pose, camera_from_fov, look_at
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import SH_C0, GaussianMap
from gslts.core.se3 import rotation
from gslts.rendering.losses import Exposure
from gslts.rendering.rasterizer import render
from gslts.types import Bools, Floats
from gslts.update.region import Region
from gslts.update.rigid_motion import move_gaussians, select_shifted
from gslts.update.views import View, render_view

SPACING_M, SIZE_M = 0.02, 0.3
MOTION = np.array(
    [
        [np.cos(0.05), -np.sin(0.05), 0, 0.05],
        [np.sin(0.05), np.cos(0.05), 0, 0.02],
        [0, 0, 1, 0],
        [0, 0, 0, 1],
    ]
)
EYES = [(1.2, 0.2, 0.9), (-0.3, 1.2, 0.8), (-1.1, -0.5, 1.0), (0.4, -1.2, 0.7)]


def sheet(corner: Floats, u: Floats, v: Floats, seed: int | None) -> dict[str, np.ndarray]:
    """Return flat Gaussians on a rectangle with squares of random colours, or of one colour."""
    steps = [np.arange(SPACING_M / 2, np.linalg.norm(side), SPACING_M) for side in (u, v)]
    a, b = (grid.ravel() for grid in np.meshgrid(*steps, indexing="ij"))
    axes = np.array([u / np.linalg.norm(u), v / np.linalg.norm(v)])
    normal = int(np.abs(np.cross(*axes)).argmax())
    scales = np.full((len(a), 3), 0.6 * SPACING_M)
    scales[:, normal] = 0.001
    colors = np.full((len(a), 3), 0.6)
    if seed is not None:
        squares = np.random.default_rng(seed).uniform(0.1, 0.9, (100, 100, 3))
        colors = squares[(a / 0.06).astype(int), (b / 0.06).astype(int)]
    means = corner + a[:, None] * axes[0] + b[:, None] * axes[1]
    return {"means": means, "log_scales": np.log(scales), "colors": colors}


def room(*, textured: bool = True) -> tuple[GaussianMap, Bools]:
    """Return a box on a floor, and which Gaussians are of the box."""
    x, y, z = np.eye(3)
    half = SIZE_M / 2
    low, high = np.array([-half, -half, 0]), np.array([half, half, SIZE_M])
    seeds = [1, 2, 3, 4, 5] if textured else [None] * 5
    faces = [
        sheet(low, SIZE_M * x, SIZE_M * z, seeds[0]),
        sheet(low, SIZE_M * y, SIZE_M * z, seeds[1]),
        sheet(high, -SIZE_M * x, -SIZE_M * z, seeds[2]),
        sheet(high, -SIZE_M * y, -SIZE_M * z, seeds[3]),
        sheet(high, -SIZE_M * x, -SIZE_M * y, seeds[4]),
    ]
    parts = [sheet(np.array([-1.5, -1.5, 0]), 3 * x, 3 * y, 0), *faces]
    means, scales, colors = (
        np.concatenate([part[name] for part in parts]) for name in ("means", "log_scales", "colors")
    )
    is_box = np.arange(len(means)) >= len(parts[0]["means"])
    return GaussianMap(
        means=means,
        quats=np.tile([1.0, 0, 0, 0], (len(means), 1)),
        log_scales=scales,
        logit_opacities=np.full(len(means), 4.0),
        sh=((colors - 0.5) / SH_C0)[:, None],
        features=is_box[:, None].astype(float),
    ).astype(np.float32), is_box


def views_of(before: GaussianMap, after: GaussianMap, threads: int = 1) -> list[View]:
    """Return views of a map after a change, rendered from the one before."""
    views = []
    for eye in EYES:
        camera = camera_from_fov(320, 240, 1.0, look_at(eye=eye, target=(0, 0, 0.1)))
        images = render(after, camera)
        frame = RgbdFrame(
            np.rint(255 * images.rgb.clip(0, 1)).astype(np.uint8), np.array(images.depth), camera
        )
        none = np.zeros(frame.depth.shape, np.bool_)
        view = View(frame, Exposure(), frame.depth, frame.rgb, none, none)
        views.append(render_view(view, before, threads))
    return views


def regions(motion: Floats = MOTION) -> list[Region]:
    """Return the regions of the box before and after a motion over the floor."""
    half = SIZE_M / 2
    before = Region("before", np.array([-half, -half, 0]), np.array([half, half, SIZE_M]))
    return [before, Region("after", before.low + motion[:3, 3], before.high + motion[:3, 3])]


@pytest.mark.parametrize("textured", [True, False])
def test_the_box_moves_and_the_floor_stays(textured: bool) -> None:
    before, is_box = room(textured=textured)
    views = views_of(before, move_gaussians(before, is_box, MOTION))
    shifted = select_shifted(before, views, regions(), MOTION)
    assert not shifted[~is_box].any()
    at_floor = before.means[:, 2] < 0.02  # The lowest row stands on the floor.
    assert shifted[is_box & ~at_floor].mean() > 0.97


def test_nothing_moves_if_nothing_was_shifted() -> None:
    before, _ = room()
    assert not select_shifted(before, views_of(before, before), regions(), MOTION).any()
    plain, _ = room(textured=False)
    assert not select_shifted(plain, views_of(plain, plain), regions(), MOTION).any()


def test_a_neighbour_in_the_box_stays() -> None:
    """A block stands beside the box, and the region reaches over it."""
    before, is_box = room()
    block = before.select(is_box)
    block = replace(block, means=block.means + np.float32([0.55, 0, 0]), ids=block.ids + 100_000)
    whole = GaussianMap(
        **{
            name: np.concatenate([getattr(before, name), getattr(block, name)])
            for name in ("means", "quats", "log_scales", "logit_opacities", "sh", "features", "ids")
        }
    )
    is_shifted = np.concatenate([is_box, np.zeros(block.size, np.bool_)])
    views = views_of(whole, move_gaussians(whole, is_shifted, MOTION))
    wide = [region.expand(0.3) for region in regions()]
    shifted = select_shifted(whole, views, wide, MOTION)
    assert shifted[is_shifted].mean() > 0.9
    assert shifted[before.size :].mean() < 0.03


def test_the_selection_is_the_same_for_any_number_of_threads() -> None:
    before, is_box = room(textured=False)
    after = move_gaussians(before, is_box, MOTION)
    first, *others = (
        select_shifted(before, views_of(before, after, threads), regions(), MOTION)
        for threads in (1, 1, 2, 3)
    )
    for other in others:
        np.testing.assert_array_equal(first, other)


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_a_moved_map_is_rendered_alike_by_a_moved_camera(degree: int) -> None:
    rng = np.random.default_rng(degree)
    before, _ = room()
    sh = rng.normal(0, 0.2, (before.size, (degree + 1) ** 2, 3))
    quats = rng.normal(size=(before.size, 4))
    origin = np.array([3.0, -2.0, 1.0])
    before = replace(
        before.astype(np.float64), sh=sh, quats=quats, origin=origin, means=before.means - origin
    )
    motion = MOTION.copy()
    motion[:3, :3] = rotation(np.array([0.3, -0.5, 0.9]))
    after = move_gaussians(before, np.ones(before.size, np.bool_), motion)
    camera = camera_from_fov(160, 120, 1.0, look_at(eye=EYES[0], target=(0, 0, 0.1)))
    moved = at_pose(camera, motion @ camera.world_from_camera)
    # Weak Gaussians are skipped below a limit, on which rounding decides.
    np.testing.assert_allclose(render(after, moved).rgb, render(before, camera).rgb, atol=2e-3)


def test_moved_gaussians_keep_ids_and_features() -> None:
    before, is_box = room()
    after = move_gaussians(before, is_box, MOTION)
    for name in ("ids", "features", "log_scales", "logit_opacities", "sh"):
        np.testing.assert_array_equal(getattr(after, name), getattr(before, name))
    for name in ("means", "quats"):
        np.testing.assert_array_equal(getattr(after, name)[~is_box], getattr(before, name)[~is_box])
    assert after.means.dtype == np.float32
