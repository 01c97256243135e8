"""Gradients compared with finite differences in float64, and with each other."""

from typing import Any

import numpy as np
import oracle
import pytest
import scenes

import gslts
from gslts.rendering.rasterizer import Images

PARAMETERS = ("means", "quats", "log_scales", "logit_opacities", "sh", "features")

# Without thresholds the images are smooth, but for the clamps of alpha and colour.
SMOOTH = {"alpha_min": 1e-30, "transmittance_min": 0.0}


def loss_of(images: Images, weights: dict[str, Any]) -> float:
    """Return the scalar whose gradient with respect to the images is `weights`."""
    return sum(
        float(np.sum(getattr(images, name.removeprefix("dL_d")) * weight))
        for name, weight in weights.items()
    )


def replaced(gaussians: gslts.GaussianMap, **changes: Any) -> gslts.GaussianMap:
    arrays = {name: getattr(gaussians, name) for name in (*PARAMETERS, "ids", "origin")}
    return gslts.GaussianMap(**(arrays | changes))


def assert_gradients_are_finite_differences(
    gaussians: gslts.GaussianMap,
    camera: gslts.Camera,
    options: gslts.RenderOptions,
    mask: Any = None,
    step: float = 1e-6,
) -> None:
    """Along 4 random directions for each parameter array, and along the 6 of the pose."""
    rasterizer = gslts.Rasterizer(np.float64)
    images = rasterizer.forward(gaussians, camera, options, mask=mask)
    weights = scenes.random_image_gradients(images)
    gradients = rasterizer.backward(**weights).dense(gaussians.size)
    rng = np.random.default_rng(0)

    def slope(plus: Any, minus: Any) -> float:
        losses = [
            loss_of(gslts.render(*view, options, mask=mask), weights) for view in (plus, minus)
        ]
        return (losses[0] - losses[1]) / (2 * step)

    for name in PARAMETERS:
        values, gradient = getattr(gaussians, name), getattr(gradients, f"dL_d{name}")
        assert gradient.shape == values.shape
        for _ in range(4):
            direction = rng.normal(size=values.shape)
            found = float(np.sum(gradient * direction))
            wanted = slope(
                (replaced(gaussians, **{name: values + step * direction}), camera),
                (replaced(gaussians, **{name: values - step * direction}), camera),
            )
            scale = np.linalg.norm(gradient * direction)
            np.testing.assert_allclose(
                found, wanted, rtol=1e-5, atol=1e-6 * scale + 1e-7, err_msg=name
            )
    for axis in range(6):
        twist = np.zeros(6)
        twist[axis] = step
        wanted = slope(
            (gaussians, moved(camera, twist)),
            (gaussians, moved(camera, -twist)),
        )
        scale = np.linalg.norm(gradients.dL_dtwist)
        np.testing.assert_allclose(
            gradients.dL_dtwist[axis], wanted, rtol=1e-5, atol=1e-6 * scale, err_msg=f"xi[{axis}]"
        )


def moved(camera: gslts.Camera, twist: Any) -> gslts.Camera:
    """Camera at world_from_camera @ exp(xi), xi = (rho, phi), for a small xi along one axis."""
    (x, y, z), angle = twist[3:], np.linalg.norm(twist[3:])
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    exponential = np.eye(4)
    if angle > 0:
        exponential[:3, :3] += (
            np.sin(angle) / angle * cross + (1 - np.cos(angle)) / angle**2 * cross @ cross
        )
    exponential[:3, 3] = twist[:3]
    return gslts.Camera(
        fx=camera.fx,
        fy=camera.fy,
        cx=camera.cx,
        cy=camera.cy,
        width=camera.width,
        height=camera.height,
        world_from_camera=camera.world_from_camera @ exponential,
    )


@pytest.mark.parametrize("sh_degree", [0, 1, 2, 3])
@pytest.mark.parametrize("antialias", [False, True])
def test_gradients_are_finite_differences(sh_degree, antialias):
    gaussians = scenes.random_map(40, seed=1, sh_degree=sh_degree, feature_dims=3)
    # Alphas below the clamp at 0.99, at which the images have a kink.
    gaussians = replaced(gaussians, logit_opacities=np.minimum(gaussians.logit_opacities, 4))
    options = gslts.RenderOptions(antialias=antialias, background=(0.3, 0.6, 0.1), **SMOOTH)
    assert_gradients_are_finite_differences(gaussians, scenes.orbit_camera(23, 18), options)


def test_gradients_where_the_jacobian_is_clamped():
    # Large Gaussians whose centres lie far outside a narrow image.
    gaussians = scenes.random_map(40, seed=2, feature_dims=1)
    gaussians = replaced(
        gaussians,
        log_scales=gaussians.log_scales + 1.5,
        logit_opacities=np.minimum(gaussians.logit_opacities, 0),
    )
    camera = scenes.orbit_camera(23, 18, fov_rad=0.15)
    offsets = gaussians.means - camera.world_from_camera[:3, 3]
    x, _, z = (offsets @ camera.world_from_camera[:3, :3]).T
    assert (abs(x / z) > 1.3 * np.tan(0.15 / 2)).sum() > 10
    options = gslts.RenderOptions(**SMOOTH)
    assert_gradients_are_finite_differences(gaussians, camera, options)


def test_gradients_with_default_thresholds():
    gaussians = scenes.random_map(60, seed=3, sh_degree=1, feature_dims=2)
    camera = scenes.orbit_camera()
    clear = oracle.render(gaussians, camera).margin > 1e-3  # Nothing flips here.
    assert clear.mean() > 0.5
    assert_gradients_are_finite_differences(
        gaussians, camera, gslts.RenderOptions(), mask=clear, step=1e-7
    )


def test_map_far_from_the_worlds_origin_has_the_same_gradients():
    origin = (1e6, -2e6, 500.0)
    gradients = []
    for place in ((0.0, 0.0, 0.0), origin):
        gaussians = scenes.random_map(60, sh_degree=2, origin=place)
        rasterizer = gslts.Rasterizer(np.float64)
        images = rasterizer.forward(gaussians, scenes.orbit_camera(target=place))
        gradients.append(rasterizer.backward(**scenes.random_image_gradients(images)))
    near, far = gradients
    np.testing.assert_array_equal(near.rows, far.rows)
    for name in ("dL_dmeans", "dL_dsh", "dL_dtwist"):
        wanted = getattr(near, name)
        error = np.linalg.norm(getattr(far, name) - wanted) / np.linalg.norm(wanted)
        assert error < 1e-6, name


def test_clamped_alpha_has_no_slope_but_its_colour_does():
    ball = scenes.single_gaussian(logit_opacities=[30.0], log_scales=np.full((1, 3), 5.0))
    camera = gslts.camera_from_fov(8, 8, 0.2, gslts.look_at((-40, 0, 0), (0, 0, 0)))
    rasterizer = gslts.Rasterizer(np.float64)
    images = rasterizer.forward(ball, camera, gslts.RenderOptions(near_sigmas=0))
    np.testing.assert_array_equal(images.alpha, 0.99)
    gradients = rasterizer.backward(
        dL_drgb=np.ones_like(images.rgb), dL_dalpha=np.ones_like(images.alpha)
    )
    for name in ("dL_dmeans", "dL_dquats", "dL_dlog_scales", "dL_dlogit_opacities"):
        assert not getattr(gradients, name).any(), name
    np.testing.assert_allclose(gradients.dL_dsh, 64 * 0.99 * oracle.C0)


def test_black_colour_has_no_slope():
    ball = scenes.single_gaussian(sh=[[[-5.0, 0, 5.0]]])
    rasterizer = gslts.Rasterizer(np.float64)
    images = rasterizer.forward(ball, scenes.orbit_camera())
    gradients = rasterizer.backward(dL_drgb=np.ones_like(images.rgb))
    assert gradients.dL_dsh[0, 0, 0] == 0
    assert gradients.dL_dsh[0, 0, 1] > 0


@pytest.mark.parametrize("only", ["dL_drgb", "dL_ddepth", "dL_dalpha", "dL_dfeatures"])
def test_gradients_add_up_over_the_images(only):
    gaussians, camera = scenes.random_map(60, feature_dims=3), scenes.orbit_camera()
    rasterizer = gslts.Rasterizer(np.float64)
    images = rasterizer.forward(gaussians, camera)
    weights = scenes.random_image_gradients(images)
    alone = rasterizer.backward(**{only: weights[only]})
    rest = rasterizer.backward(**{name: w for name, w in weights.items() if name != only})
    total = rasterizer.backward(**weights)
    for name in ("dL_dmeans", "dL_dquats", "dL_dlog_scales", "dL_dsh", "dL_dfeatures", "dL_dtwist"):
        np.testing.assert_allclose(
            getattr(alone, name) + getattr(rest, name), getattr(total, name), rtol=1e-7, atol=1e-9
        )


def test_no_image_gradient_gives_zeros():
    rasterizer = gslts.Rasterizer(np.float64)
    rasterizer.forward(scenes.random_map(20, feature_dims=2), scenes.orbit_camera())
    gradients = rasterizer.backward()
    assert len(gradients.rows) > 0
    assert gradients.max_weights is None
    for name in PARAMETERS:
        assert not getattr(gradients, f"dL_d{name}").any()


def test_pixels_outside_the_mask_take_no_part():
    gaussians, camera = scenes.random_map(80, feature_dims=2), scenes.orbit_camera()
    rng = np.random.default_rng(0)
    mask = rng.random((camera.height, camera.width)) < 0.3
    rasterizer = gslts.Rasterizer(np.float64)
    weights = scenes.random_image_gradients(rasterizer.forward(gaussians, camera))
    zeroed = {
        name: np.where(mask if weight.ndim == 2 else mask[..., None], weight, 0)
        for name, weight in weights.items()
    }
    wanted = rasterizer.backward(**zeroed).dense(80)
    rasterizer.forward(gaussians, camera, mask=mask)
    found = rasterizer.backward(**weights).dense(80)
    for name in PARAMETERS:
        np.testing.assert_allclose(
            getattr(found, f"dL_d{name}"), getattr(wanted, f"dL_d{name}"), rtol=1e-9, atol=1e-9
        )
    np.testing.assert_allclose(found.dL_dtwist, wanted.dL_dtwist, rtol=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_float32_follows_float64(seed):
    gaussians = scenes.random_map(200, seed=seed, sh_degree=3, feature_dims=4)
    camera = scenes.orbit_camera(91, 67)
    clear = oracle.render(gaussians, camera).margin > 2e-3
    gradients = []
    for dtype in (np.float64, np.float32):
        rasterizer = gslts.Rasterizer(dtype)
        images = rasterizer.forward(gaussians.astype(dtype), camera, mask=clear)
        gradients.append(rasterizer.backward(**scenes.random_image_gradients(images)).dense(200))
    for name in (*(f"dL_d{name}" for name in PARAMETERS), "dL_dtwist"):
        wanted, found = (getattr(g, name).astype(np.float64) for g in gradients)
        error = np.linalg.norm(found - wanted) / np.linalg.norm(wanted)
        assert error < 1e-3, name


def test_rows_are_those_of_the_map_when_others_are_culled():
    gaussians = scenes.random_map(60)
    camera = scenes.orbit_camera()
    behind = np.zeros(60, bool)
    behind[[0, 1, 7, 30, 59]] = True
    means = np.where(behind[:, None], 10 * camera.world_from_camera[:3, 3], gaussians.means)
    rasterizer = gslts.Rasterizer(np.float64)
    images = rasterizer.forward(replaced(gaussians, means=means), camera)
    weights = scenes.random_image_gradients(images)
    found = rasterizer.backward(**weights)
    assert (np.diff(found.rows.astype(int)) > 0).all()
    assert not np.isin(found.rows, np.flatnonzero(behind)).any()
    rasterizer.forward(gaussians.select(~behind), camera)
    wanted = rasterizer.backward(**weights).dense(55)
    np.testing.assert_array_equal(found.dense(60).dL_dmeans[~behind], wanted.dL_dmeans)
    assert not found.dense(60).dL_dmeans[behind].any()


def test_backward_can_be_repeated():
    rasterizer = gslts.Rasterizer(np.float32)
    images = rasterizer.forward(scenes.random_map(90, dtype=np.float32), scenes.orbit_camera())
    weights = scenes.random_image_gradients(images)
    first, second = (rasterizer.backward(**weights, statistics=True) for _ in range(2))
    assert first.dL_dmeans.tobytes() == second.dL_dmeans.tobytes()
    assert first.pixel_counts is not None
    np.testing.assert_array_equal(first.pixel_counts, second.pixel_counts)


def test_statistics_are_those_of_the_oracle():
    gaussians, camera = scenes.random_map(120, seed=4), scenes.orbit_camera()
    expected = oracle.render(gaussians, camera)
    assert expected.margin.min() > 1e-9
    rasterizer = gslts.Rasterizer(np.float64)
    images = rasterizer.forward(gaussians, camera)
    gradients = rasterizer.backward(dL_drgb=np.ones_like(images.rgb), statistics=True).dense(120)
    np.testing.assert_array_equal(gradients.pixel_counts, expected.pixel_counts)
    np.testing.assert_allclose(gradients.max_weights, expected.max_weights, rtol=1e-9)


def test_absolute_gradient_of_a_single_gaussian():
    # alpha = o exp(-d^2 / (2 s^2)) has the slope alpha d / s^2 in the projected mean.
    ball = scenes.single_gaussian()
    camera = gslts.camera_from_fov(40, 30, 0.6, gslts.look_at((-2, 0, 0), (0, 0, 0)))
    rasterizer = gslts.Rasterizer(np.float64)
    images = rasterizer.forward(ball, camera)
    gradients = rasterizer.backward(dL_dalpha=np.ones_like(images.alpha), statistics=True)
    variance_px2 = (camera.fx * 0.1 / 2) ** 2 + 0.3
    dx = np.arange(40) + 0.5 - 20
    dy = np.arange(30) + 0.5 - 15
    alpha = images.alpha
    wanted = [
        np.sum(alpha * abs(dx[None, :])) / variance_px2,
        np.sum(alpha * abs(dy[:, None])) / variance_px2,
    ]
    np.testing.assert_allclose(gradients.abs_dL_dmeans2d, [wanted], rtol=1e-9)
