"""Properties of renderings of any scene."""

from typing import Any

import numpy as np
import oracle
import scenes
from comparison import assert_close_outside_band
from hypothesis import given
from hypothesis import strategies as st

import gslts
from gslts.rendering.rasterizer import Gradients


@st.composite
def views(draw: st.DrawFn) -> tuple[gslts.GaussianMap, gslts.Camera, gslts.RenderOptions]:
    """Draw a map in float64, a camera outside or inside of it, and options."""
    gaussians = scenes.random_map(
        draw(st.integers(0, 60)),
        seed=draw(st.integers(0, 10_000)),
        sh_degree=draw(st.integers(0, 3)),
        feature_dims=draw(st.sampled_from([0, 1, 4, 17])),
    )
    camera = scenes.orbit_camera(
        draw(st.integers(1, 80)),
        draw(st.integers(1, 60)),
        angle_rad=draw(st.floats(0, 6.3)),
        distance_m=draw(st.sampled_from([0.05, 0.5, 2.5, 30.0])),
        fov_rad=draw(st.floats(0.1, 2.5)),
    )
    options = gslts.RenderOptions(
        background=(draw(st.floats(0, 1)), 0.5, 0.25),
        sh_degree=draw(st.integers(0, 3)),
        antialias=draw(st.booleans()),
        surface_depth=draw(st.booleans()),
        alpha_min=draw(st.sampled_from([1 / 255, 1e-3, 0.1])),
        transmittance_min=draw(st.sampled_from([1e-4, 0.0, 0.05])),
    )
    return gaussians, camera, options


def with_threads(options: gslts.RenderOptions, threads: int) -> gslts.RenderOptions:
    return gslts.RenderOptions(
        background=options.background,
        sh_degree=options.sh_degree,
        antialias=options.antialias,
        surface_depth=options.surface_depth,
        alpha_min=options.alpha_min,
        transmittance_min=options.transmittance_min,
        threads=threads,
    )


def gradient_arrays(gradients: Gradients) -> dict[str, Any]:
    names = (
        "rows",
        "dL_dmeans",
        "dL_dquats",
        "dL_dlog_scales",
        "dL_dlogit_opacities",
        "dL_dsh",
        "dL_dfeatures",
        "abs_dL_dmeans2d",
        "max_weights",
        "pixel_counts",
    )
    return {name: getattr(gradients, name) for name in names}


@given(views())
def test_both_precisions_agree_with_the_oracle(view):
    gaussians, camera, options = view
    expected = oracle.render(gaussians, camera, options)
    for dtype in (np.float64, np.float32):
        images = gslts.render(gaussians.astype(dtype), camera, options)
        assert_close_outside_band(images, expected, dtype)


@given(views())
def test_images_and_gradients_are_finite_and_in_range(view):
    gaussians, camera, options = view
    for dtype in (np.float64, np.float32):
        rasterizer = gslts.Rasterizer(dtype)
        images = rasterizer.forward(gaussians.astype(dtype), camera, options)
        assert (images.alpha >= 0).all()
        assert (images.alpha <= 1 + 1e-6).all()  # A sum of weights, rounded.
        assert (images.rgb >= -1e-6).all()
        assert ((images.depth > options.near_m * 0.999) == (images.alpha > 0)).all()
        gradients = rasterizer.backward(**scenes.random_image_gradients(images), statistics=True)
        for name, array in gradient_arrays(gradients).items():
            assert np.isfinite(array).all(), name
        assert np.isfinite(gradients.dL_dtwist).all()


@given(views())
def test_thread_count_changes_no_bit(view):
    gaussians, camera, options = view
    for dtype in (np.float64, np.float32):
        results = set()
        for threads in (1, 2, 3, 7):
            rasterizer = gslts.Rasterizer(dtype)
            images = rasterizer.forward(
                gaussians.astype(dtype), camera, with_threads(options, threads)
            )
            gradients = rasterizer.backward(
                **scenes.random_image_gradients(images), statistics=True
            )
            arrays = [*gradient_arrays(gradients).values(), gradients.dL_dtwist]
            results.add((*scenes.image_bytes(images), *(array.tobytes() for array in arrays)))
        assert len(results) == 1


@given(views(), st.randoms(use_true_random=False))
def test_order_of_the_rows_changes_nothing(view, random):
    gaussians, camera, options = view
    order = np.array(random.sample(range(gaussians.size), gaussians.size), np.int64)
    # Of equal depths the order of the rows decides, by definition.
    z = (gaussians.means - camera.world_from_camera[:3, 3]) @ camera.world_from_camera[:3, 2]
    first = np.unique(z.astype(np.float32), return_index=True)[1]
    gaussians = gaussians.select(np.sort(first))
    order = order[order < gaussians.size]

    rasterizer = gslts.Rasterizer(np.float64)
    images = rasterizer.forward(gaussians, camera, options)
    weights = scenes.random_image_gradients(images)
    wanted = rasterizer.backward(**weights).dense(gaussians.size)
    permuted = rasterizer.forward(gaussians.select(order), camera, options)
    found = rasterizer.backward(**weights).dense(gaussians.size)
    assert scenes.image_bytes(permuted) == scenes.image_bytes(images)
    for name in ("dL_dmeans", "dL_dquats", "dL_dlog_scales", "dL_dlogit_opacities", "dL_dsh"):
        np.testing.assert_array_equal(getattr(found, name), getattr(wanted, name)[order])
    np.testing.assert_allclose(found.dL_dtwist, wanted.dL_dtwist, rtol=1e-7, atol=1e-9)


@given(views(), st.integers(0, 10_000), st.sampled_from([0.01, 0.5]))
def test_mask_crops_the_full_rendering(view, seed, share):
    gaussians, camera, options = view
    mask = np.random.default_rng(seed).random((camera.height, camera.width)) < share
    for dtype in (np.float64, np.float32):
        single = gaussians.astype(dtype)
        full = gslts.render(single, camera, options)
        masked = gslts.render(single, camera, options, mask=mask)
        for name in ("rgb", "depth", "alpha", "features"):
            wanted = getattr(full, name).copy()
            wanted[~mask] = 0
            np.testing.assert_array_equal(getattr(masked, name), wanted, err_msg=name)


@given(views())
def test_white_balls_on_white_are_invisible(view):
    gaussians, camera, options = view
    white = gslts.GaussianMap(
        means=gaussians.means,
        quats=gaussians.quats,
        log_scales=gaussians.log_scales,
        logit_opacities=gaussians.logit_opacities,
        sh=np.full((gaussians.size, 1, 3), 0.5 / oracle.C0),
    )
    options = gslts.RenderOptions(background=(1, 1, 1), alpha_min=options.alpha_min)
    np.testing.assert_allclose(gslts.render(white, camera, options).rgb, 1, atol=1e-12)
