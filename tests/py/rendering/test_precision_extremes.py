"""Extreme values of a map give finite images and gradients."""

import numpy as np
import pytest
import scenes

import gslts

EXTREMES = {
    "far": {"means": 1e6},
    "at the end of float32": {"means": 3e38},
    "point": {"log_scales": -60.0},
    "zero scale": {"log_scales": -3e38},
    "huge scale": {"log_scales": 20.0},
    "infinite scale": {"log_scales": 3e38},
    "transparent": {"logit_opacities": -3e38},
    "opaque": {"logit_opacities": 3e38},
    "tiny quaternion": {"quats": 1e-20},
    "huge quaternion": {"quats": 1e30},
    "bright": {"sh": 1e20},
    "strong features": {"features": 1e20},
}


@pytest.mark.parametrize("changes", EXTREMES.values(), ids=EXTREMES)
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_one_extreme_row_spoils_nothing(changes, dtype):
    usual = scenes.random_map(30, feature_dims=2, dtype=dtype)
    names = ("means", "quats", "log_scales", "logit_opacities", "sh", "features")
    arrays = {name: getattr(usual, name).copy() for name in names}
    for name, value in changes.items():
        arrays[name][13] = value
    rasterizer = gslts.Rasterizer(dtype)
    images = rasterizer.forward(gslts.GaussianMap(**arrays), scenes.orbit_camera())
    for name in ("rgb", "depth", "alpha", "features"):
        assert np.isfinite(getattr(images, name)).all(), name
    assert images.alpha.min() >= 0
    assert images.alpha.max() <= 1
    gradients = rasterizer.backward(**scenes.random_image_gradients(images), statistics=True)
    for name in names:
        assert np.isfinite(getattr(gradients, f"dL_d{name}")).all(), name
    assert np.isfinite(gradients.dL_dtwist).all()


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_needle_keeps_its_energy_at_every_angle(dtype):
    # 1 m long, 0.1 mm thin: the determinant of its covariance loses all digits if formed naively.
    needle = scenes.single_gaussian(
        dtype, log_scales=np.log([[1.0, 1e-4, 1e-4]]), logit_opacities=[20.0]
    )
    sums = []
    for angle_rad in np.linspace(0, np.pi, 13):
        pose = gslts.look_at((0, 0, 5), (0, 0, 0), (np.cos(angle_rad), np.sin(angle_rad), 0))
        camera = gslts.camera_from_fov(128, 128, 1.5, pose)
        sums.append(float(gslts.render(needle, camera).alpha.sum()))
    assert max(sums) / min(sums) < 1.1


def test_map_far_from_the_worlds_origin_is_rendered_alike_in_float32():
    origin = (1e6, -2e6, 500.0)
    near = gslts.render(scenes.random_map(100, dtype=np.float32), scenes.orbit_camera())
    far = gslts.render(
        scenes.random_map(100, dtype=np.float32, origin=origin), scenes.orbit_camera(target=origin)
    )
    assert np.mean(abs(near.rgb - far.rgb)) < 1e-5
