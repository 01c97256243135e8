"""Wrong input is rejected with the name of the argument, and none of it crashes."""

import threading
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import scenes

import gslts
from gslts._core.fusion import SurfaceVoxels

FLOAT_ARRAYS = ("means", "quats", "log_scales", "logit_opacities", "sh", "features")


def arrays_of(gaussians: gslts.GaussianMap) -> dict[str, Any]:
    names = (*FLOAT_ARRAYS, "ids", "origin")
    return {name: getattr(gaussians, name).copy() for name in names}


def small_arrays() -> dict[str, Any]:
    return arrays_of(scenes.random_map(4, sh_degree=1, feature_dims=2))


@pytest.mark.parametrize("name", [*FLOAT_ARRAYS, "ids", "origin"])
def test_wrong_shape_is_named(name):
    arrays = small_arrays()
    for wrong in (arrays[name][:-1], arrays[name][None], arrays[name].ravel()[0:1].reshape(())):
        if name == "means" and wrong.shape == (3, 3):
            continue  # Then the other arrays are the wrong ones.
        with pytest.raises(ValueError, match=rf"^{name}: expected .*got"):
            gslts.GaussianMap(**(arrays | {name: wrong}))


@pytest.mark.parametrize("name", [*FLOAT_ARRAYS, "ids", "origin"])
@pytest.mark.parametrize("dtype", [np.float16, np.float32, np.int64, np.complex128, object, ">f8"])
def test_wrong_dtype_is_named(name, dtype):
    arrays = small_arrays()
    arrays[name] = arrays[name].astype(dtype)
    if name == "means" and dtype is np.float32:
        name = "quats"  # The means set the dtype of the map.
    with pytest.raises(ValueError, match=rf"^{name}: expected .*got"):
        gslts.GaussianMap(**arrays)


@pytest.mark.parametrize("name", FLOAT_ARRAYS)
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_number_that_is_not_finite_is_named_with_its_index(name, value):
    arrays = small_arrays()
    arrays[name][2:] = value
    with pytest.raises(ValueError, match=rf"{name}\[2"):
        gslts.GaussianMap(**arrays)


def test_origin_that_is_not_finite_is_named():
    with pytest.raises(ValueError, match="origin"):
        gslts.GaussianMap(**(small_arrays() | {"origin": np.array([0, np.nan, 0])}))


def test_what_is_no_array_is_named():
    with pytest.raises(TypeError, match="quats: expected a numpy array, got list"):
        gslts.GaussianMap(**(small_arrays() | {"quats": [[1, 0, 0, 0]]}))


def test_number_of_sh_bases_is_checked():
    with pytest.raises(ValueError, match="sh_bases"):
        gslts.GaussianMap(**(small_arrays() | {"sh": np.zeros((4, 5, 3))}))


@pytest.mark.parametrize("name", FLOAT_ARRAYS)
def test_array_spoilt_after_construction_is_found_by_the_rendering(name):
    arrays = small_arrays()
    gaussians = gslts.GaussianMap(**arrays)
    arrays[name][1] = np.nan
    with pytest.raises(ValueError, match=rf"{name}\[1"):
        gslts.render(gaussians, scenes.orbit_camera())


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("background", (0, np.nan, 0)),
        ("near_m", 0.0),
        ("near_m", np.nan),
        ("sh_degree", -1),
        ("sh_degree", 4),
        ("eps2d_px2", -0.1),
        ("alpha_min", 0.0),
        ("alpha_min", 0.99),
        ("transmittance_min", -0.1),
        ("transmittance_min", 1.0),
        ("threads", -1),
    ],
)
def test_option_out_of_range_is_named(name, value):
    options = gslts.RenderOptions(**{name: value})
    with pytest.raises(ValueError, match=name):
        gslts.render(scenes.random_map(3), scenes.orbit_camera(), options)


def test_unknown_option_is_rejected():
    with pytest.raises(TypeError):
        gslts.RenderOptions(near=0.1)  # type: ignore[call-arg]


@pytest.mark.parametrize(
    "mask", [np.ones((38, 52), bool), np.ones((53, 38), bool), np.ones((38, 53), np.uint8)]
)
def test_wrong_mask_is_named(mask):
    with pytest.raises(ValueError, match=r"mask: expected .*got"):
        gslts.render(scenes.random_map(3), scenes.orbit_camera(53, 38), mask=mask)


@pytest.mark.parametrize("dtype", [np.float16, np.int32, "complex128"])
def test_rasterizer_of_another_dtype_is_rejected(dtype):
    with pytest.raises(ValueError, match="dtype"):
        gslts.Rasterizer(dtype)


def test_map_of_another_dtype_is_rejected():
    with pytest.raises(ValueError, match="gaussian_map is float64"):
        gslts.Rasterizer(np.float32).forward(scenes.random_map(3), scenes.orbit_camera())


def test_backward_needs_a_forward():
    with pytest.raises(RuntimeError, match="forward"):
        gslts.Rasterizer().backward()


def test_backward_after_a_failed_forward_is_rejected():
    rasterizer = gslts.Rasterizer(np.float64)
    gaussians = scenes.random_map(3)
    rasterizer.forward(gaussians, scenes.orbit_camera())
    with pytest.raises(ValueError, match="near_m"):
        rasterizer.forward(gaussians, scenes.orbit_camera(), gslts.RenderOptions(near_m=-1))
    with pytest.raises(RuntimeError, match="forward"):
        rasterizer.backward()


@pytest.mark.parametrize("name", ["dL_drgb", "dL_ddepth", "dL_dalpha", "dL_dfeatures"])
def test_wrong_image_gradient_is_named(name):
    rasterizer = gslts.Rasterizer(np.float64)
    images = rasterizer.forward(scenes.random_map(9, feature_dims=2), scenes.orbit_camera())
    good = scenes.random_image_gradients(images)[name]
    for wrong in (good[:-1], good[None], good.astype(np.float32)):
        with pytest.raises(ValueError, match=rf"{name}: expected .*got"):
            rasterizer.backward(**{name: wrong})
    for value in (np.nan, np.inf, -np.inf):
        bad = good.copy()
        bad[19, 26] = value  # The image centre: something is blended there.
        with pytest.raises(ValueError, match=rf"{name}\[19,26"):
            rasterizer.backward(**{name: bad})
    rasterizer.backward(**{name: good})


def test_empty_map_renders_the_background():
    options = gslts.RenderOptions(background=(0.1, 0.2, 0.3))
    rasterizer = gslts.Rasterizer(np.float64)
    gaussians = scenes.random_map(0, sh_degree=2, feature_dims=3)
    images = rasterizer.forward(gaussians, scenes.orbit_camera(5, 4), options)
    np.testing.assert_array_equal(images.rgb, np.full((4, 5, 3), (0.1, 0.2, 0.3)))
    assert not images.depth.any()
    assert not images.alpha.any()
    assert images.features.shape == (4, 5, 3)
    gradients = rasterizer.backward(**scenes.random_image_gradients(images), statistics=True)
    assert gradients.rows.shape == (0,)
    assert gradients.dL_dsh.shape == (0, 9, 3)
    assert not gradients.dL_dtwist.any()
    assert gradients.dense(0).dL_dmeans.shape == (0, 3)


def test_gradients_do_not_fit_a_smaller_map():
    rasterizer = gslts.Rasterizer(np.float64)
    images = rasterizer.forward(scenes.random_map(20), scenes.orbit_camera())
    gradients = rasterizer.backward(**scenes.random_image_gradients(images))
    with pytest.raises(ValueError, match="rows must ascend and stay below 10, got"):
        gradients.dense(10)


def error_of_two_threads(call: Callable[[], object]) -> str:
    """Call from two threads until one of the calls is rejected; return its error."""
    errors: list[str] = []

    def call_until_rejected() -> None:
        for _ in range(2000):
            if errors:
                return
            try:
                call()
            except RuntimeError as error:
                errors.append(str(error))

    threads = [threading.Thread(target=call_until_rejected) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return errors[0] if errors else "no error"


def test_rasterizer_turns_away_a_second_thread():
    rasterizer = gslts.Rasterizer()
    gaussians = scenes.random_map(2000, dtype=np.float32)
    camera = scenes.orbit_camera(400, 300)
    error = error_of_two_threads(lambda: rasterizer.forward(gaussians, camera))
    assert error == "Rasterizer: in use by another thread; each thread needs its own"


def test_optimizer_turns_away_a_second_thread():
    gaussians, camera = scenes.random_map(5000, dtype=np.float32), scenes.orbit_camera()
    rasterizer, adam = gslts.Rasterizer(), gslts.Adam(gaussians)
    images = rasterizer.forward(gaussians, camera)
    gradients = rasterizer.backward(dL_drgb=np.ones_like(images.rgb)).dense(gaussians.size)

    def step():
        adam.step(gradients, gslts.AdamRates(means=1e-3), threads=1)
        _ = adam.state
        adam.edit(gaussians, np.arange(gaussians.size))

    error = error_of_two_threads(step)
    assert error == "Adam: in use by another thread; each thread needs its own"
    assert (adam.state.steps == adam.state.steps[0]).all()


def test_voxels_turn_away_a_second_thread():
    camera = scenes.orbit_camera(400, 300)
    depth, rgb = np.ones((300, 400), np.float32), np.zeros((300, 400, 3), np.uint8)
    voxels = SurfaceVoxels(0.01, 1)
    error = error_of_two_threads(lambda: voxels.add(depth, rgb, camera, None))
    assert error == "SurfaceVoxels: in use by another thread; each thread needs its own"
    _, sums, hits = voxels.voxels()
    assert hits.max() * 398 * 298 == sums[:, 0].sum()
