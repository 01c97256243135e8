"""Back-projection of features compared with the dense matrix of blend weights."""

import numpy as np
import pytest
import scenes

import gslts


def weight_matrix(gaussian_map: gslts.GaussianMap, camera: gslts.Camera) -> np.ndarray:
    """Return [H*W,N]: the rendering when Gaussian i has the i-th unit vector as its feature."""
    arrays = ("means", "quats", "log_scales", "logit_opacities", "sh", "origin")
    unit = gslts.GaussianMap(
        **{name: getattr(gaussian_map, name) for name in arrays},
        features=np.eye(gaussian_map.size, dtype=gaussian_map.dtype),
    )
    return gslts.render(unit, camera).features.reshape(-1, gaussian_map.size)


def test_views_together_solve_for_the_features() -> None:
    """Feature images of several views give back the features by a dense least-squares solve."""
    gaussian_map = scenes.random_map(12, feature_dims=3, dtype=np.float64)
    rasterizer = gslts.Rasterizer(np.float64)
    sums, weights = np.zeros((12, 3)), np.zeros(12)
    gram, dense = np.zeros((12, 12)), np.zeros((12, 3))
    for angle_rad in (0.0, 1.0, 2.0, 4.0):
        camera = scenes.orbit_camera(angle_rad=angle_rad)
        features = rasterizer.forward(gaussian_map, camera).features
        lifted = rasterizer.lift(features)
        sums[lifted.rows] += lifted.weighted_features
        weights[lifted.rows] += lifted.weights
        matrix = weight_matrix(gaussian_map, camera)
        gram += matrix.T @ matrix
        dense += matrix.T @ features.reshape(-1, 3)
        np.testing.assert_allclose(
            lifted.weights, matrix.sum(axis=0)[lifted.rows], rtol=1e-10, atol=1e-12
        )
    np.testing.assert_allclose(sums, dense, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(np.linalg.solve(gram, sums), gaussian_map.features, atol=1e-6)
    # Without a solve, the quotient is the mean of what was seen where the Gaussian is.
    assert np.all(weights > 0)
    means = sums / weights[:, None]
    assert np.all(means >= gaussian_map.features.min(axis=0) - 1e-9)
    assert np.all(means <= gaussian_map.features.max(axis=0) + 1e-9)


def test_a_constant_image_lifts_to_the_constant() -> None:
    gaussian_map = scenes.random_map(200, dtype=np.float32)
    camera = scenes.orbit_camera()
    rasterizer = gslts.Rasterizer()
    mask = np.zeros((camera.height, camera.width), bool)
    mask[5:30, 10:40] = True
    images = rasterizer.forward(gaussian_map, camera, mask=mask)
    features = np.full((camera.height, camera.width, 40), np.nan, np.float32)
    features[mask] = np.arange(40)
    lifted = rasterizer.lift(features)
    np.testing.assert_allclose(lifted.weights.sum(), images.alpha.sum(), rtol=1e-5)
    seen = lifted.weights > 0
    assert seen.sum() > 50
    np.testing.assert_allclose(
        lifted.weighted_features[seen] / lifted.weights[seen, None],
        np.broadcast_to(np.arange(40), (seen.sum(), 40)),
        rtol=1e-5,
    )


def test_errors_name_the_argument() -> None:
    rasterizer = gslts.Rasterizer(np.float32)
    features = np.zeros((38, 53, 2), np.float32)
    with pytest.raises(RuntimeError, match=r"Rasterizer\.lift: there was no forward"):
        rasterizer.lift(features)
    rasterizer.forward(scenes.random_map(3, dtype=np.float32), scenes.orbit_camera())
    with pytest.raises(ValueError, match=r"features: expected .*\(38, 53, \*\), got float64"):
        rasterizer.lift(features.astype(np.float64))
    with pytest.raises(ValueError, match="dims must be at least 1, got 0"):
        rasterizer.lift(features[:, :, :0])
    features[3, 4, 1] = np.inf
    with pytest.raises(ValueError, match=r"features\[3,4,1\] is inf"):
        rasterizer.lift(features)
