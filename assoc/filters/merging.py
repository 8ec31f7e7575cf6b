"""Several states of one target merged into one, with the same mean and covariance."""

from __future__ import annotations

from typing import Any

import numpy as np

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
    # sorted by target, for sums over stretches
    order = np.argsort(target, kind="stable")
    states, target, weights = states[order], target[order], weights[order]
    begin = np.searchsorted(target, np.arange(count))
    if isinstance(states, Gaussian):
        return gaussian(*_matched(states.mean, states.covariance, target, weights, begin))
    modes = states.weights.shape[1]
    each = weights[:, None] * states.weights
    total = _sums(each, begin)
    # models of weight zero are merged as well
    share = np.where(total[target] > 0.0, each / np.maximum(total[target], 1e-300), weights[:, None])
    parts = [_matched(states.means[:, j], states.covariances[:, j], target, share[:, j], begin) for j in range(modes)]
    means, covariances = (np.stack(part, axis=1) for part in zip(*parts, strict=True))
    return Mixture(means, covariances, total / total.sum(axis=1, keepdims=True))


def _matched(mean: Array, covariance: Array, target: Array, weights: Array, begin: Array) -> tuple[Array, Array]:
    whole = _sums(weights[:, None] * mean, begin)
    away = mean - whole[target]
    spread = covariance + away[:, :, None] * away[:, None, :]
    return whole, _sums(weights[:, None, None] * spread, begin)


def _sums(values: Array, begin: Array) -> Array:
    """Sums of the stretches that begin there."""
    return np.asarray(np.add.reduceat(values, begin, axis=0)) if len(begin) else values[:0]
