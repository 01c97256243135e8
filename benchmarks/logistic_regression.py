"""Fit of a logistic regression, for the weights in cpp/detect/constants.hpp."""

from __future__ import annotations

import numpy as np

from gslts.types import Floats

ROUNDS = 50
"""Number of Newton iterations."""


def fit(features: Floats, answers: Floats, sample_weights: Floats, ridge: float) -> Floats:
    """Return the weights and, last, the offset [F+1] that explain the answers (Newton's method).

    Args:
        features: [N,F].
        answers: [N] 0 or 1.
        sample_weights: [N] weights of the answers.
        ridge: Weight of the squared weights of features with unit variance.
    """
    mean, spread = features.mean(axis=0), features.std(axis=0) + 1e-9
    rows = np.column_stack([(features - mean) / spread, np.ones(len(features))])
    ridges = np.append(np.full(features.shape[1], ridge), 0)
    weights = np.zeros(rows.shape[1])
    for _ in range(ROUNDS):
        given = logistic(rows @ weights)
        gradient = rows.T @ (sample_weights * (given - answers))
        curvature = sample_weights * given * (1 - given)
        hessian = (rows * curvature[:, None]).T @ rows + np.diag(ridges + 1e-9)
        weights -= np.linalg.solve(hessian, gradient + ridges * weights)
    plain = weights[:-1] / spread
    return np.append(plain, weights[-1] - plain @ mean)


def logistic(odds: Floats) -> Floats:
    """Return the probabilities of log odds.

    Args:
        odds: Log odds, of any shape.
    """
    return 1 / (1 + np.exp(-odds))
