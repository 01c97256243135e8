"""Blocks of Gaussians against the rasterizer, and what a page is sent."""

from dataclasses import replace

import numpy as np
import pytest
import scenes
from scipy.spatial.transform import Rotation
from store_maps import edited, random_map

from gslts.core.camera import Camera, look_at
from gslts.core.gaussian_map import GaussianMap
from gslts.rendering.rasterizer import render
from gslts.viewer.blocks import MAX_BLOCKS, UNIT_M, block_edge_m, make_blocks
from gslts.viewer.splats import Splats


class Scene:
    """Stands for the scene of a page: remembers what it was sent."""

    def __init__(self) -> None:
        self.sent: dict[str, tuple[np.ndarray, ...]] = {}
        self.gaussians = 0

    def add_gaussian_splats(
        self, name: str, *arrays: np.ndarray, scale: float, visible: bool
    ) -> "Handle":
        assert scale == UNIT_M
        assert visible
        handle = Handle(self, name)
        handle.set_gaussians(*arrays)
        return handle


class Handle:
    def __init__(self, scene: Scene, name: str) -> None:
        self.scene, self.name = scene, name

    def set_gaussians(self, *arrays: np.ndarray) -> None:
        self.scene.sent[self.name] = arrays
        self.scene.gaussians += len(arrays[0])

    def remove(self) -> None:
        del self.scene.sent[self.name]


def test_blocks_hold_all_gaussians() -> None:
    gaussian_map = random_map(200)
    blocks = list(make_blocks(gaussian_map, 0.5).values())
    assert len(blocks) > 10
    centers = np.concatenate([block.centers for block in blocks]) * UNIT_M
    order, of_map = np.lexsort(centers.T), np.lexsort(gaussian_map.means.T)
    np.testing.assert_allclose(centers[order], gaussian_map.means[of_map], rtol=1e-6)
    turns = Rotation.from_quat(gaussian_map.quats[of_map], scalar_first=True).as_matrix()
    axes = turns * np.exp(gaussian_map.log_scales[of_map])[:, None]
    covariances = np.concatenate([block.covariances for block in blocks])[order] * UNIT_M**2
    np.testing.assert_allclose(covariances, axes @ axes.transpose(0, 2, 1), rtol=1e-3, atol=1e-4)
    opacities = np.concatenate([block.opacities for block in blocks])[order, 0]
    logits = gaussian_map.logit_opacities[of_map]
    np.testing.assert_allclose(opacities, 1 / (1 + np.exp(-logits)), rtol=1e-5)


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_colours_are_those_of_the_rasterizer(degree: int) -> None:
    some = scenes.random_map(1, sh_degree=degree, dtype=np.float32, origin=(10.0, 0.0, 0.0))
    ball = replace(
        some,
        log_scales=np.full((1, 3), -1, np.float32),
        logit_opacities=np.full(1, 20, np.float32),
    )
    center = ball.means[0] + ball.origin
    for eye in np.random.default_rng(0).normal(0, 3, (5, 3)) + ball.origin:
        camera = Camera(
            fx=500,
            fy=500,
            cx=0.5,
            cy=0.5,
            width=1,
            height=1,
            world_from_camera=look_at(eye, center),
        )
        images = render(ball, camera)
        expected = (images.rgb[0, 0] / images.alpha[0, 0]).clip(0, 1)
        (block,) = make_blocks(ball, 100.0).values()
        shown = block.colors(eye - ball.origin)[0] / 255
        np.testing.assert_allclose(shown, expected, atol=0.003)


def test_number_of_blocks_is_bounded() -> None:
    wide = random_map(5_000)
    wide = replace(wide, means=wide.means * np.float32(30))
    assert len(make_blocks(wide, block_edge_m(wide))) <= MAX_BLOCKS
    empty = wide.select(np.zeros(0, np.intp))
    assert make_blocks(empty, block_edge_m(empty)) == {}


def show(splats: Splats, gaussian_map: GaussianMap, eye: np.ndarray) -> None:
    blocks = make_blocks(gaussian_map, 0.5)
    splats.send(splats.changes(blocks, eye))
    splats.remove_others(blocks)


def test_only_what_differs_is_sent() -> None:
    first, eye = random_map(2_000), np.zeros(3)
    scene, fresh = Scene(), Scene()
    splats = Splats(scene)
    show(splats, first, eye)
    assert scene.gaussians == first.size
    show(splats, first, eye)
    assert scene.gaussians == first.size
    corner = first.select(np.flatnonzero((first.means > -1).any(axis=1)))
    assert 0 < corner.size < first.size
    show(splats, corner, eye)
    assert scene.gaussians - first.size < 0.2 * first.size
    other = edited(corner, 1, 2_000)
    show(splats, other, eye)
    show(Splats(fresh), other, eye)
    assert scene.sent.keys() == fresh.sent.keys()
    for name, arrays in fresh.sent.items():
        for own, expected in zip(scene.sent[name], arrays, strict=True):
            np.testing.assert_array_equal(own, expected)


def test_colours_follow_the_viewer() -> None:
    scene = Scene()
    splats, gaussian_map = Splats(scene), random_map(300)
    show(splats, gaussian_map, np.array([0.0, 0.0, 9.0]))
    before = scene.gaussians
    show(splats, gaussian_map, np.array([0.0, 0.0, 9.01]))
    assert scene.gaussians == before
    show(splats, gaussian_map, np.array([9.0, 0.0, 0.0]))
    assert scene.gaussians > before
