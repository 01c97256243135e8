"""Quality of a localized pose: agreement of image and map, number of inliers, and covariance.

All thresholds were calibrated on development homes (seeds 0 to 3 and 20, see `constants`): a run on
these homes measures the calibration, not the rate of false poses in new homes. Measure that on the
validation or test homes (seeds from 5,000 or 10,000 on), on which no threshold was set.
"""

from __future__ import annotations

import numpy as np

from gslts._core import reloc as _core
from gslts.localization.constants import (
    CORRELATED_REFINEMENT_PIXELS,
    MAP_STDS,
    MAX_STD_M,
    MAX_STD_RAD,
    MIN_COLOR_AGREEMENT,
    MIN_COST,
    MIN_DEPTH_AGREEMENT,
    MIN_INLIERS,
    MIN_KNOWN_SHARE,
    MIN_MEASURED_SHARE,
    TYPICAL_COST,
)
from gslts.types import Floats


def fit_score(fit: _core.Fit, has_depth: bool) -> float:
    """Return how well an image agrees with the map at a pose, 0 to 1; a score, no probability.

    Args:
        fit: Agreement of colours and depths after the refinement.
        has_depth: True if depth was measured.
    """
    near = fit.near if has_depth and fit.measured >= MIN_MEASURED_SHARE else 1.0
    return float(min(1.0, fit.known / MIN_KNOWN_SHARE) * fit.alike * near)


def agreement_fault(fit: _core.Fit, has_depth: bool) -> str | None:
    """Check the agreement of image and map at a pose.

    Args:
        fit: Agreement of colours and depths after the refinement.
        has_depth: True if depth was measured.

    Returns:
        The reason to reject the pose; None to accept it.
    """
    if fit.known < MIN_KNOWN_SHARE:
        return f"the map covers {100 * fit.known:.0f} % of the view"
    if fit.alike < MIN_COLOR_AGREEMENT:
        return f"colours agree in {100 * fit.alike:.0f} % of the view"
    if has_depth and fit.measured >= MIN_MEASURED_SHARE and fit.near < MIN_DEPTH_AGREEMENT:
        return f"depths agree in {100 * fit.near:.0f} % of the view: wrong pose or intrinsics"
    return None


def inlier_fault(inliers: int, fit: _core.Fit, has_depth: bool) -> str | None:
    """Check the number of keypoints that support a pose found without a prior.

    Args:
        inliers: Number of keypoints that support the pose.
        fit: Agreement of colours and depths after the refinement.
        has_depth: True if depth was measured.

    Returns:
        The reason to reject the pose; None to accept it.
    """
    score = fit_score(fit, has_depth)
    if inliers >= next(count for min_score, count in MIN_INLIERS if score >= min_score):
        return None
    return f"only {inliers} keypoints support the best pose"


def covariance_fault(covariance: Floats) -> str | None:
    """Check the covariance of a pose.

    Args:
        covariance: [6,6] of a twist (rho, phi), m and rad.

    Returns:
        The reason to reject the pose; None to accept it.
    """
    std_m, std_rad = pose_stds(covariance)
    if std_m <= MAX_STD_M and std_rad <= MAX_STD_RAD:
        return None
    return (
        f"the view does not determine the pose: +- {std_m:.2f} m, "
        f"+- {np.degrees(std_rad):.0f} degrees"
    )


def pose_stds(covariance: Floats) -> tuple[float, float]:
    """Return the standard deviations of position and rotation, m and rad.

    Args:
        covariance: [6,6] of a twist (rho, phi), m and rad.
    """
    variances = np.diag(covariance)
    return float(np.sqrt(variances[:3].sum())), float(np.sqrt(variances[3:].sum()))


def pose_covariance(pose: _core.RefinedPose) -> Floats:
    """Estimate the covariance of a refined pose.

    The inverse of the curvature of the cost, corrected for correlated pixels, plus the error of the
    map, both scaled by the cost; benchmarks/results/relocalization.md compares it with true errors.

    Args:
        pose: Result of the refinement.

    Returns:
        [6,6] of a twist (rho, phi) of world_from_camera @ exp(rho, phi), m and rad.
    """
    curvature = np.asarray(pose.curvature) + 1e-6 * np.eye(6)
    of_map = np.diag(np.repeat(np.square(MAP_STDS), 3))
    scale = max(pose.cost, MIN_COST) / TYPICAL_COST
    covariance = CORRELATED_REFINEMENT_PIXELS * np.linalg.inv(curvature) + of_map
    symmetric: Floats = scale * (covariance + covariance.T) / 2
    return symmetric
