"""Moment matching of pairs of Gaussians, and the change of the images that it makes."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from gslts.types import Floats, Ints

MIN_OPACITY, MAX_OPACITY = 1e-6, 0.99
"""Range of merged opacities; beyond it, a Gaussian has no gradient left."""
COVERAGE_CONTRAST = 0.5
"""Assumed difference (of 1) between colours of a Gaussian and of its surroundings: cost of a change
of coverage."""
THICKNESS_CONTRAST = 0.05
"""Difference of colours (of 1) that costs as much as a surface that becomes as thick as wide."""


@dataclass(frozen=True, eq=False)
class Splats:
    """N Gaussians with activated parameters, for merging.

    Attributes:
        means: [N,3], m.
        covars: [N,3,3], m2.
        normals: [N,3] unit axes of the least variance.
        thickness2: [N] that variance, m2.
        opacities: [N].
        weights: [N] sums of blending weights, such as in pixels.
        densities: [N] weights per covered m2.
        colors: [N,C] SH coefficients in units of colours from 0 to 1.
        features: [N,D].
    """

    means: Floats
    covars: Floats
    normals: Floats
    thickness2: Floats
    opacities: Floats
    weights: Floats
    densities: Floats
    colors: Floats
    features: Floats

    @classmethod
    def of(
        cls,
        means: Floats,
        covars: Floats,
        opacities: Floats,
        weights: Floats | None,
        colors: Floats,
        features: Floats,
    ) -> Splats:
        """Derive the other attributes.

        Args:
            means: [N,3], m.
            covars: [N,3,3], m2.
            opacities: [N].
            weights: [N]; None means the area that each covers, m2.
            colors: [N,C].
            features: [N,D].
        """
        variances, axes = np.linalg.eigh(covars)
        covered = opacities * 2 * np.pi * np.sqrt(np.maximum(variances[:, 1] * variances[:, 2], 0))
        weights = covered if weights is None else weights
        return cls(
            means=means,
            covars=covars,
            normals=np.ascontiguousarray(axes[:, :, 0]),
            thickness2=variances[:, 0],
            opacities=opacities,
            weights=weights,
            densities=weights / np.maximum(covered, 1e-30),
            colors=colors,
            features=features,
        )

    def take(self, rows: Ints) -> Splats:
        """Return some rows.

        Args:
            rows: [M].
        """
        return Splats(**{f.name: getattr(self, f.name)[rows] for f in fields(self)})

    def put(self, rows: Ints, others: Splats) -> None:
        """Overwrite rows.

        Args:
            rows: [M].
            others: [M] new values.
        """
        for f in fields(self):
            getattr(self, f.name)[rows] = getattr(others, f.name)


@dataclass(frozen=True, eq=False)
class Mixture:
    """Merged Gaussians of P pairs.

    Attributes:
        shares: [P] weight of the first in the sum of both.
        means: [P,3] m.
        covars: [P,3,3] m2, widened where opacity alone cannot cover the same area.
        opacities: [P].
        costs: [P] squared difference of colours, in the unit of the weights.
    """

    shares: Floats
    means: Floats
    covars: Floats
    opacities: Floats
    costs: Floats


def mixture(a: Splats, b: Splats) -> Mixture:
    """Merge pairs of Gaussians, and compute the cost as seen along their normals.

    The product of area and opacity is kept, but overlapping Gaussians become no more opaque than
    both together were.

    Args:
        a: P Gaussians.
        b: Their P partners.

    Source: moments and opacity as in Kerbl et al. 2024 (hierarchical 3DGS), sec. 4.1; the cost is
    the integral squared error of Williams and Maybeck 2003, of colours and of coverage.
    """
    weights = a.weights + b.weights
    of_a = np.where(weights > 0, a.weights / np.where(weights > 0, weights, 1), 0.5)
    of_b = 1 - of_a
    step = b.means - a.means
    normals = _mean_normals(a.normals, b.normals, of_a)
    plane = _planes(normals)
    in_a, in_b = (plane @ s.covars @ plane.transpose(0, 2, 1) for s in (a, b))
    offset = np.einsum("pij,pj->pi", plane, step)
    in_both = _mixture_covars(of_a, in_a, in_b, offset)
    area_a, area_b, area = (2 * np.pi * np.sqrt(_det(c)) for c in (in_a, in_b, in_both))
    # A Gaussian with a lower weight per area is partly hidden and covers less.
    densest = np.maximum(np.maximum(a.densities, b.densities), 1e-30)
    alpha_a = a.opacities * a.densities / densest
    alpha_b = b.opacities * b.densities / densest
    covered = alpha_a * area_a + alpha_b * area_b
    most = np.minimum(MAX_OPACITY, 1 - (1 - alpha_a) * (1 - alpha_b))
    spread = np.maximum(area / np.maximum(area_a, area_b), 1)
    wider = np.clip(covered / np.maximum(most * area, 1e-30), 1, spread)
    in_both, area = wider[:, None, None] * in_both, wider * area
    opacities = np.clip(covered / area, MIN_OPACITY, np.maximum(most, MIN_OPACITY))

    ab = _overlap(in_a, in_b, offset)
    # Colours relative to their mean, the colour of the merged Gaussian.
    difference = ((a.colors - b.colors) ** 2).sum(axis=1)
    c_a, c_b = alpha_a * of_b, alpha_b * of_a
    of_color = difference * (c_a**2 * area_a / 2 + c_b**2 * area_b / 2 - 2 * c_a * c_b * ab)
    a_both = _overlap(in_a, in_both, of_b[:, None] * offset)
    b_both = _overlap(in_b, in_both, of_a[:, None] * offset)
    of_coverage = (
        (alpha_a**2 * area_a + alpha_b**2 * area_b + opacities**2 * area) / 2
        + 2 * alpha_a * alpha_b * ab
        - 2 * opacities * (alpha_a * a_both + alpha_b * b_both)
    )
    high_a, high_b = (np.einsum("pi,pij,pj->p", normals, s.covars, normals) for s in (a, b))
    excess2 = of_a * (high_a - a.thickness2) + of_b * (high_b - b.thickness2)
    excess2 += of_a * of_b * np.einsum("pi,pi->p", normals, step) ** 2
    of_thickness = 2 * np.pi * opacities * np.maximum(excess2, 0)
    return Mixture(
        shares=of_a,
        means=a.means + of_b[:, None] * step,
        covars=wider[:, None, None] * _mixture_covars(of_a, a.covars, b.covars, step),
        opacities=opacities,
        costs=densest
        * (
            np.maximum(of_color, 0)
            + COVERAGE_CONTRAST**2 * np.maximum(of_coverage, 0)
            + THICKNESS_CONTRAST**2 * of_thickness
        ),
    )


def _mixture_covars(of_a: Floats, a: Floats, b: Floats, step: Floats) -> Floats:
    """Return covariances [P,D,D] of two Gaussians whose means differ by a step [P,D]."""
    of_a, of_b = of_a[:, None, None], 1 - of_a[:, None, None]
    return np.asarray(of_a * a + of_b * b + of_a * of_b * (step[:, :, None] * step[:, None, :]))


def _overlap(a: Floats, b: Floats, offset: Floats) -> Floats:
    """Return integrals [P] of the product of two Gaussians of height 1 in a plane, m2."""
    total = a + b
    det = _det(total)
    x, y = offset.T
    square = total[:, 1, 1] * x * x - 2 * total[:, 0, 1] * x * y + total[:, 0, 0] * y * y
    result: Floats = 2 * np.pi * np.sqrt(_det(a) * _det(b) / det) * np.exp(-0.5 * square / det)
    return result


def _mean_normals(a: Floats, b: Floats, of_a: Floats) -> Floats:
    """Return unit axes [P,3] between two axes [P,3], which have no sign."""
    same = np.where(np.einsum("pi,pi->p", a, b) < 0, -1.0, 1.0)
    mean = of_a[:, None] * a + ((1 - of_a) * same)[:, None] * b
    unit: Floats = mean / np.linalg.norm(mean, axis=1, keepdims=True)
    return unit


def _planes(normals: Floats) -> Floats:
    """Return two axes [P,2,3] across each unit normal (Duff et al. 2017)."""
    x, y, z = normals.T
    sign = np.where(z < 0, -1.0, 1.0)
    a = -1 / (sign + z)
    b = x * y * a
    first = np.column_stack([1 + sign * x * x * a, sign * b, -sign * x])
    second = np.column_stack([b, sign + y * y * a, -y])
    return np.stack([first, second], axis=1)


def _det(covars: Floats) -> Floats:
    """Return determinants [P] of [P,2,2], kept above 0 against rounding."""
    det = covars[:, 0, 0] * covars[:, 1, 1] - covars[:, 0, 1] * covars[:, 1, 0]
    return np.asarray(np.maximum(det, 1e-30))
