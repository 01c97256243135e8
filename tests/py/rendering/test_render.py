"""Images compared with the NumPy oracle and with hand-computed values."""

import threading

import numpy as np
import oracle
import pytest
import scenes
from comparison import assert_close_outside_band

import gslts

CASES = {
    "plain": ({}, {}, {}),
    "sh 3": ({"sh_degree": 3}, {}, {}),
    "sh capped": ({"sh_degree": 3}, {}, {"sh_degree": 1}),
    "colours below 0": ({"sh_degree": 1}, {}, {"clamp_colors": False}),
    "features": ({"feature_dims": 5}, {}, {}),
    "many features": ({"feature_dims": 37}, {}, {}),
    "antialias": ({}, {}, {"antialias": True}),
    "depth of centres": ({}, {}, {"surface_depth": False}),
    "background": ({}, {}, {"background": (0.2, 0.5, 0.9)}),
    "no blur": ({}, {}, {"eps2d_px2": 0.0}),
    "thresholds": ({}, {}, {"alpha_min": 0.05, "transmittance_min": 0.1}),
    "no thresholds": ({}, {}, {"alpha_min": 1e-30, "transmittance_min": 0.0}),
    "near plane": ({}, {"distance_m": 0.3}, {"near_m": 0.2}),
    "near in sigmas": ({}, {"distance_m": 0.3}, {"near_sigmas": 9.0}),
    "through the camera": ({}, {"distance_m": 0.1}, {"near_sigmas": 0.0}),
    "inside": ({"sh_degree": 2}, {"distance_m": 0.1, "fov_rad": 1.5}, {}),
    "many tiles": ({}, {"width": 171, "height": 129}, {}),
    "one pixel": ({}, {"width": 1, "height": 1}, {}),
    "far origin": ({"sh_degree": 1, "origin": (1e6, -2e6, 500)}, {"target": (1e6, -2e6, 500)}, {}),
}


@pytest.mark.parametrize(("map_", "camera", "options"), CASES.values(), ids=CASES)
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_images_are_those_of_the_oracle(map_, camera, options, dtype):
    gaussians = scenes.random_map(150, seed=1, **map_)
    view, how = scenes.orbit_camera(**camera), gslts.RenderOptions(**options)
    expected = oracle.render(gaussians, view, how)
    images = gslts.render(gaussians.astype(dtype), view, how)
    assert images.rgb.dtype == images.depth.dtype == images.alpha.dtype == dtype
    assert_close_outside_band(images, expected, dtype)


def test_many_gaussians_are_those_of_the_oracle():
    gaussians, camera = scenes.random_map(9000, seed=3, feature_dims=2), scenes.orbit_camera()
    assert_close_outside_band(
        gslts.render(gaussians, camera), oracle.render(gaussians, camera), np.float64
    )


def test_thread_count_changes_no_bit_of_a_large_scene():
    gaussians = scenes.random_map(9000, sh_degree=1, dtype=np.float32)
    camera = scenes.orbit_camera(300, 200)
    results = set()
    for threads in (1, 2, 3, 7):
        rasterizer = gslts.Rasterizer(np.float32)
        images = rasterizer.forward(gaussians, camera, gslts.RenderOptions(threads=threads))
        gradients = rasterizer.backward(**scenes.random_image_gradients(images))
        arrays = (gradients.dL_dmeans, gradients.dL_dsh, gradients.dL_dtwist)
        results.add((*scenes.image_bytes(images), *(array.tobytes() for array in arrays)))
    assert len(results) == 1


def test_principal_point_and_focal_lengths_may_be_anything():
    pose = scenes.orbit_camera().world_from_camera
    camera = gslts.Camera(
        fx=90, fy=40, cx=-5.3, cy=60.2, width=61, height=47, world_from_camera=pose
    )
    gaussians = scenes.random_map(150, seed=2)
    assert_close_outside_band(
        gslts.render(gaussians, camera), oracle.render(gaussians, camera), np.float64
    )


def test_centre_of_a_pixel_is_at_half():
    # A small opaque ball on the axis of a camera whose principal point is the centre of (2, 1).
    pose = gslts.look_at((-2, 0, 0), (0, 0, 0))
    camera = gslts.Camera(fx=50, fy=50, cx=2.5, cy=1.5, width=6, height=4, world_from_camera=pose)
    ball = scenes.single_gaussian(log_scales=np.full((1, 3), np.log(0.01)))
    images = gslts.render(ball, camera)
    assert np.unravel_index(images.alpha.argmax(), images.alpha.shape) == (1, 2)
    assert images.alpha[1, 2] == pytest.approx(0.5, abs=1e-12)
    assert images.depth[1, 2] == pytest.approx(2, abs=1e-12)
    np.testing.assert_allclose(images.rgb[1, 2], 0.25, atol=1e-12)
    np.testing.assert_allclose(images.alpha[1, 1], images.alpha[1, 3], rtol=1e-9)
    np.testing.assert_allclose(images.alpha[0, 2], images.alpha[2, 2], rtol=1e-9)


@pytest.mark.parametrize("x", [-1.0, -3.0])
def test_gaussian_behind_the_camera_is_not_seen(x):
    pose = gslts.look_at((0, 0, 0), (1, 0, 0))
    ball = scenes.single_gaussian(means=[[x, 0, 0]], log_scales=np.zeros((1, 3)))
    assert not gslts.render(ball, gslts.camera_from_fov(20, 20, 1.0, pose)).alpha.any()


def test_near_plane_follows_the_options():
    camera = gslts.camera_from_fov(9, 9, 1.0, gslts.look_at((-0.5, 0, 0), (0, 0, 0)))
    ball = scenes.single_gaussian()
    assert gslts.render(ball, camera, gslts.RenderOptions(near_m=0.49)).alpha.any()
    assert not gslts.render(ball, camera, gslts.RenderOptions(near_m=0.5)).alpha.any()


def test_nearer_gaussian_hides_the_farther_one():
    both = scenes.single_gaussian(
        means=[[1.0, 0, 0], [0.0, 0, 0]],
        quats=[[1.0, 0, 0, 0]] * 2,
        log_scales=np.full((2, 3), np.log(0.3)),
        logit_opacities=[20.0, 20.0],
        sh=np.array([[[1.0, -1, -1]], [[-1.0, 1, -1]]]) / (2 * oracle.C0),
    )
    camera = gslts.camera_from_fov(3, 3, 0.02, gslts.look_at((-3, 0, 0), (0, 0, 0)))
    options = gslts.RenderOptions(transmittance_min=0)
    red, green, blue = gslts.render(both, camera, options).rgb[1, 1]
    assert green == pytest.approx(0.99, abs=1e-3)  # Alpha is capped at 0.99.
    assert red == pytest.approx(0.01 * 0.99, abs=1e-3)
    assert blue == 0


def test_zero_quaternion_means_no_rotation():
    scales = np.log([[0.3, 0.1, 0.02]])
    camera = scenes.orbit_camera()
    upright = gslts.render(scenes.single_gaussian(log_scales=scales), camera)
    zero = gslts.render(scenes.single_gaussian(log_scales=scales, quats=np.zeros((1, 4))), camera)
    np.testing.assert_array_equal(zero.rgb, upright.rgb)


def test_mask_of_nothing_gives_zeros():
    options = gslts.RenderOptions(background=(1, 1, 1))
    images = gslts.render(
        scenes.random_map(50), scenes.orbit_camera(20, 10), options, mask=np.zeros((10, 20), bool)
    )
    assert not images.rgb.any()
    assert not images.alpha.any()


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_mask_holds_without_a_minimum_of_transmittance(dtype):
    size = 200
    gaussians = scenes.single_gaussian(
        dtype,
        means=np.c_[np.zeros((size, 2)), np.linspace(1, 2, size)],
        quats=[[1.0, 0, 0, 0]] * size,
        log_scales=np.full((size, 3), -1.0),
        logit_opacities=np.full(size, 10.0),
        sh=np.ones((size, 1, 3)),
    )
    camera = gslts.camera_from_fov(4, 4, 0.2, np.eye(4))
    mask = np.zeros((4, 4), bool)
    mask[0, 0] = True
    options = gslts.RenderOptions(transmittance_min=0, near_sigmas=0)
    images = gslts.render(gaussians, camera, options, mask=mask)
    assert images.alpha[0, 0] > 0.99
    for image in (images.rgb, images.depth, images.alpha):
        assert not image[~mask].any()


def test_mask_need_not_be_contiguous():
    mask = (np.arange(53)[:, None] + np.arange(38)) % 3 == 0
    gaussians, camera = scenes.random_map(50), scenes.orbit_camera(53, 38)
    masked = gslts.render(gaussians, camera, mask=mask.T)
    full = gslts.render(gaussians, camera)
    np.testing.assert_array_equal(masked.rgb, np.where(mask.T[..., None], full.rgb, 0))


def test_rasterizer_keeps_no_state_between_views():
    rasterizer = gslts.Rasterizer(np.float64)
    views = [
        (scenes.random_map(300, sh_degree=2), scenes.orbit_camera(150, 90)),
        (scenes.random_map(0, feature_dims=3), scenes.orbit_camera(7, 5)),
        (scenes.random_map(20, seed=3, feature_dims=2), scenes.orbit_camera(33, 65)),
    ]
    for gaussians, camera in views * 2:
        reused = rasterizer.forward(gaussians, camera)
        fresh = gslts.Rasterizer(np.float64).forward(gaussians, camera)
        assert scenes.image_bytes(reused) == scenes.image_bytes(fresh)


def test_images_outlive_the_rasterizer():
    rasterizer = gslts.Rasterizer(np.float64)
    gaussians, camera = scenes.random_map(100), scenes.orbit_camera()
    images = rasterizer.forward(gaussians, camera)
    expected = images.rgb.copy()
    rasterizer.forward(scenes.random_map(100, seed=5), camera)
    del rasterizer
    np.testing.assert_array_equal(images.rgb, expected)


def test_threads_of_the_caller_render_at_the_same_time():
    gaussians = scenes.random_map(500, dtype=np.float32)
    cameras = [scenes.orbit_camera(angle_rad=angle) for angle in range(6)]
    expected = [scenes.image_bytes(gslts.render(gaussians, camera)) for camera in cameras]
    found: dict[int, tuple[bytes, ...]] = {}

    def work(index: int) -> None:
        for _ in range(5):
            found[index] = scenes.image_bytes(gslts.render(gaussians, cameras[index]))

    threads = [threading.Thread(target=work, args=(index,)) for index in range(len(cameras))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [found[index] for index in range(len(cameras))] == expected
