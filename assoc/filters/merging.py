"""Several states of one target merged into one, with the same mean and covariance."""

from __future__ import annotations

from typing import Any

import numpy as np

from assoc._system.compiled import njit
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.filters.imm import Mixture
from assoc.filters.state import Gaussian, gaussian


def merged(states: Any, target: Array, weights: Array, count: int) -> Any:
    """Match the moments of weighted mixtures: K Gaussians or Mixtures become one for each of B targets.

    Mixtures of models stay such: each model is merged by itself. Every target has at least one state; `target` (K,) is
    that of each, from 0, and the weights (K,) of one target sum to 1. States of another kind are refused.

    Y. Bar-Shalom, X. R. Li, T. Kirubarajan, Estimation with Applications to Tracking and Navigation, 1.4.16.
    """
    if not isinstance(states, (Gaussian, Mixture)):
        raise InvalidInputError(
            f"filter: states of the kind {type(states).__name__} cannot be merged; use a Kalman filter, extended or "
            "unscented, or interacting multiple models"
        )
    if isinstance(states, Gaussian):
        means, covariances = _matched(states.mean[:, None], states.covariance[:, None], weights[:, None], target, count)
        return gaussian(means[:, 0], covariances[:, 0])
    each = weights[:, None] * states.weights
    total = np.stack([np.bincount(target, column, count) for column in each.T], axis=1)
    # models of weight zero are merged as well
    share = np.where(total[target] > 0.0, each / np.maximum(total[target], 1e-300), weights[:, None])
    means, covariances = _matched(states.means, states.covariances, share, target, count)
    return Mixture(means, covariances, total / total.sum(axis=1, keepdims=True))


@njit
def _matched(means: Array, covariances: Array, shares: Array, target: Array, count: int) -> tuple[Array, Array]:
    """Means (B, m, n) and covariances (B, m, n, n) of states (K, m, ...) with these shares (K, m) of their targets."""
    K, m, n = means.shape
    whole, spread = np.zeros((count, m, n)), np.zeros((count, m, n, n))
    for k in range(K):
        for j in range(m):
            for a in range(n):
                whole[target[k], j, a] += shares[k, j] * means[k, j, a]
    away = np.empty(n)
    for k in range(K):
        b = target[k]
        for j in range(m):
            share = shares[k, j]
            for a in range(n):
                away[a] = means[k, j, a] - whole[b, j, a]
            for a in range(n):
                for e in range(n):
                    spread[b, j, a, e] += share * (covariances[k, j, a, e] + away[a] * away[e])
    return whole, spread
