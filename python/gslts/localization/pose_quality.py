"""How far a pose can be trusted: whether the picture fits the map there, and its covariance."""

from __future__ import annotations

import numpy as np

from gslts._core import reloc as _core
from gslts.types import Floats

LEAST_KNOWN = 0.4
"""Share of the pixels that may count that the map must fill."""
LEAST_ALIKE, LEAST_NEAR = 0.7, 0.7
"""Shares of pixels whose colours and depths must be about those of the map."""
LEAST_MEASURED = 0.05
"""Share of what the map fills below which depth tells nothing."""
TYPICAL_COST, LEAST_COST = 0.03, 0.01
"""Mean cost of a pixel at the true poses of maps of simulated homes: where more differs, a pose is
less certain by as much. And what is taken for it where nearly nothing differs."""
MOST_STD_M, MOST_STD_RAD = 0.05, np.deg2rad(2.5)
"""By which a place and a direction may be uncertain: more, and a blank wall would be a place."""
CORNERS = ((0.95, 10), (0.8, 20), (0.0, 30))
"""From so much of `trust_of` on, so many must support a pose nobody expected. Views of other homes
came to 0.6 with 20 corners, and walls of a texture that repeats to 0.68 with 21 and 0.91 with 18;
of right poses, none below 0.8 had fewer than 36."""
CORRELATED = 20.0
"""Neighbouring pixels err together: so many count as one."""
MAP_STDS = (0.0015, 0.0004)
"""How far a map itself is off, m and rad, in each direction: most of the error of a good pose."""


def trust_of(fit: _core.Fit, has_depth: bool) -> float:
    """0 to 1: how well a picture fits a map."""
    near = fit.near if has_depth and fit.measured >= LEAST_MEASURED else 1.0
    return float(min(1.0, fit.known / LEAST_KNOWN) * fit.alike * near)


def fault_of_fit(fit: _core.Fit, has_depth: bool) -> str | None:
    """Why a picture was not taken there; None if it may have been."""
    if fit.known < LEAST_KNOWN:
        return f"the map fills {100 * fit.known:.0f} % of the view"
    if fit.alike < LEAST_ALIKE:
        return f"colours agree in {100 * fit.alike:.0f} % of the view"
    if has_depth and fit.measured >= LEAST_MEASURED and fit.near < LEAST_NEAR:
        return f"depths agree in {100 * fit.near:.0f} % of the view: wrong place or intrinsics"
    return None


def fault_of_corners(inliers: int, fit: _core.Fit, has_depth: bool) -> str | None:
    """Why a pose that nobody expected is none; None if enough corners support it."""
    trust = trust_of(fit, has_depth)
    if inliers >= next(corners for least, corners in CORNERS if trust >= least):
        return None
    return f"only {inliers} corners support the best pose"


def fault_of_covariance(covariance: Floats) -> str | None:
    """Why a picture does not tell where it was taken; None if it does."""
    std_m, std_rad = stds_of(covariance)
    if std_m <= MOST_STD_M and std_rad <= MOST_STD_RAD:
        return None
    return (
        f"the view leaves open where it is: +- {std_m:.2f} m, +- {np.degrees(std_rad):.0f} degrees"
    )


def stds_of(covariance: Floats) -> tuple[float, float]:
    """How far a pose of that covariance [6,6] is off, of its place and its direction, m and rad."""
    variances = np.diag(covariance)
    return float(np.sqrt(variances[:3].sum())), float(np.sqrt(variances[3:].sum()))


def covariance_of(pose: _core.RefinedPose) -> Floats:
    """[6,6] of a twist (rho, phi), m and rad.

    The inverse of the curvature, as far as pixels err independently, and what the map is off;
    benchmarks/results/relocalization.md compares it with errors.
    """
    curvature = np.asarray(pose.curvature) + 1e-6 * np.eye(6)
    of_map = np.diag(np.repeat(np.square(MAP_STDS), 3))
    scale = max(pose.cost, LEAST_COST) / TYPICAL_COST
    return np.asarray(scale * (CORRELATED * np.linalg.inv(curvature) + of_map), np.float64)
