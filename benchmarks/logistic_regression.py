"""Fit of a logistic regression, for the weights in cpp/detect/constants.hpp."""

from __future__ import annotations

import numpy as np

from gslts.types import Floats

ROUNDS = 50
"""Number of Newton iterations."""


def fit(
    features: Floats,
    answers: Floats,
    sample_weights: Floats,
    ridge: float,
    prior: Floats | None = None,
) -> Floats:
    """Return the weights and, last, the offset [F+1] that explain the answers (Newton's method).

    Args:
        features: [N,F].
        answers: [N] 0 or 1.
        sample_weights: [N] weights of the answers.
        ridge: Weight of the squared differences of weights and prior, of features with unit
            variance.
        prior: [F+1] weights and, last, the offset, near which the result stays; None means 0.
    """
    mean, spread = features.mean(axis=0), features.std(axis=0) + 1e-9
    rows = np.column_stack([(features - mean) / spread, np.ones(len(features))])
    ridges = np.append(np.full(features.shape[1], ridge), 0)
    center = np.zeros(rows.shape[1])
    if prior is not None:
        center = np.append(prior[:-1] * spread, prior[-1] + prior[:-1] @ mean)
    weights = center.copy()
    for _ in range(ROUNDS):
        given = logistic(rows @ weights)
        gradient = rows.T @ (sample_weights * (given - answers))
        curvature = sample_weights * given * (1 - given)
        hessian = (rows * curvature[:, None]).T @ rows + np.diag(ridges + 1e-9)
        weights -= np.linalg.solve(hessian, gradient + ridges * (weights - center))
    plain = weights[:-1] / spread
    return np.append(plain, weights[-1] - plain @ mean)


def logistic(odds: Floats) -> Floats:
    """Return the probabilities of log odds.

    Args:
        odds: Log odds, of any shape.
    """
    return 1 / (1 + np.exp(-odds))
