"""Comparison of Gaussians by their covariances: quaternions of one shape may differ."""

import numpy as np
from numpy.typing import NDArray

import gslts
from gslts.core.se3 import rotation_of_quat
from gslts.io.activation import opacities_of


def covariances(gaussian_map: gslts.GaussianMap) -> NDArray[np.float64]:
    """Return [N,3,3] in the axes of the map, m^2."""
    axes = np.array([rotation_of_quat(quat) for quat in gaussian_map.quats.astype(np.float64)])
    axes = axes.reshape(-1, 3, 3) * np.exp(gaussian_map.log_scales.astype(np.float64))[:, None]
    return axes @ axes.transpose(0, 2, 1)


def assert_same_gaussians(
    actual: gslts.GaussianMap,
    expected: gslts.GaussianMap,
    mean_m: float,
    covariance: float,
    sh: float,
    color: float,
    opacity: float,
) -> None:
    """Compare centres, covariances relative to the largest entry, coefficients and opacities."""
    assert (actual.size, actual.sh_degree) == (expected.size, expected.sh_degree)
    centers = [gaussians.means + gaussians.origin for gaussians in (actual, expected)]
    assert np.abs(centers[0] - centers[1]).max(initial=0) <= mean_m
    sizes = np.abs(covariances(expected)).max(axis=(1, 2), initial=0)
    errors = np.abs(covariances(actual) - covariances(expected)).max(axis=(1, 2), initial=0)
    assert (errors <= covariance * sizes).all(), (errors / sizes).max()
    assert np.abs(actual.sh[:, 0] - expected.sh[:, 0]).max(initial=0) <= color
    assert np.abs(actual.sh[:, 1:] - expected.sh[:, 1:]).max(initial=0) <= sh
    difference = opacities_of(actual.logit_opacities) - opacities_of(expected.logit_opacities)
    assert np.abs(difference).max(initial=0) <= opacity
