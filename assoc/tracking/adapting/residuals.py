"""Residuals of measurements of confirmed tracks, and whose variances they show.

A sensor's measurement is compared with the position that the other sensors of the scan give; so the target's motion
does not matter. Where there is no other, it is compared with the prediction of the filter's quietest model, by its
probability. The variance of a residual is a sum of parts, each proportional to the variance of one sensor's noise or
of the process noise of the model that manoeuvres.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from assoc._types import Array
from assoc.sensors import Sensor

# beside other sensors the prediction only fills the directions that they leave open
_BESIDE = 0.01
# squares beyond so many variances are taken for wrong associations; manoeuvres may be much harder than expected
_MOST, _HARDEST = 10.0, 50.0


class Seen(NamedTuple):
    """Measurements of one sensor that belong to tracks."""

    track: Array
    """Rows, int (K,)."""
    measured: Array
    """(K, d)."""
    predicted: Array
    """Predicted positions at the measurements' times, (K, 3)."""


class Predicted(NamedTuple):
    """Positions of T tracks as predicted by M models, n axes."""

    covariance: Array
    """Of all models together, (T, n, n)."""
    offsets: Array
    """Each model's mean less that of all, (T, M, n)."""
    covariances: Array
    """(T, M, n, n)."""
    weights: Array
    """Probabilities of the models, (T, M)."""


def variances(
    sensors: Sequence[Sensor], seen: Sequence[Seen], predicted: Predicted, noise: Array
) -> tuple[Array, Array]:
    """Normal matrix and right side of the factors of variances, (S + 1, S + 1) and (S + 1,), relative to those in use.

    The sensors are as declared; `noise` (S,) are the factors of the noise's variances in use.
    """
    T, _, n = predicted.offsets.shape
    S = len(sensors)
    matrix, right = np.zeros((S + 1, S + 1)), np.zeros(S + 1)
    prior = np.linalg.inv(predicted.covariance)
    parts = [sensor.position_part for sensor in sensors]
    whites = [np.linalg.inv(np.linalg.cholesky(part.covariance)) for part in parts]
    shift = np.zeros((T, 3))
    # linearised at the prediction, then at the position that all measurements give
    for last in (False, True):
        rows, information, vectors = [], np.zeros((S, T, n, n)), np.zeros((S, T, n))
        for s, (part, white, (track, z, position)) in enumerate(zip(parts, whites, seen, strict=True)):
            position = position + shift[track]
            H = white @ part.jacobian(position)[:, :, :n]
            # relative to the prediction
            y = part.residual(np.ascontiguousarray(z[:, : part.dim]), part.measure(position)) @ white.T
            y = y + _times(H, shift[track][:, :n])
            information[s, track] = H.transpose(0, 2, 1) @ H / noise[s]
            vectors[s, track] = _times(H.transpose(0, 2, 1), y) / noise[s]
            rows.append((track, H, y))
        if not last:
            shift[:, :n] = _times(np.linalg.inv(prior + information.sum(axis=0)), vectors.sum(axis=0))
    count = np.bincount(np.concatenate([track for track, _, _ in rows]), minlength=T)
    # how likely each model is by all measurements: of positions that these give, with little weight of the prediction
    spread = np.linalg.inv(information.sum(axis=0) + _BESIDE**2 * prior)
    found = _times(spread, vectors.sum(axis=0))
    total = spread[:, None] + predicted.covariances
    off = found[:, None] - predicted.offsets
    factor = np.linalg.inv(np.linalg.cholesky(total))
    white_off = _times(factor, off)
    fit = np.log(predicted.weights + 1e-300) - 0.5 * (white_off**2).sum(axis=2)
    fit += np.log(np.einsum("tmii->tmi", factor)).sum(axis=2)
    weights = np.exp(fit - fit.max(axis=1, keepdims=True))
    weights /= weights.sum(axis=1, keepdims=True)
    size = np.einsum("tmii->m", predicted.covariances)
    quiet, m = int(np.argmin(size)), int(np.argmax(size))
    for s, (track, H, y) in enumerate(rows):
        alone = count[track] == 1
        beside = np.flatnonzero(~alone)
        if len(beside):
            t, h = track[beside], H[beside]
            others = information[:, t].copy()
            others[s] = 0.0
            gain = h @ np.linalg.inv(_BESIDE * prior[t] + others.sum(axis=0))
            shares = np.zeros((*y[beside].shape, S + 1))
            for r in range(S):
                shares[..., r] = _diagonal(gain, others[r])
            shares[..., s] = noise[s]
            known = _diagonal(gain, _BESIDE**2 * prior[t])
            rest = y[beside] - _times(gain, vectors[:, t].sum(axis=0) - vectors[s, t])
            _add(matrix, right, shares, known, rest**2, np.ones(len(t)), _MOST)
        if alone.any():
            t, h = track[alone], H[alone]
            shares = np.zeros((*y[alone].shape, S + 1))
            shares[..., s] = noise[s]
            rest = y[alone] - _times(h, predicted.offsets[t, quiet])
            known = _diagonal(h, predicted.covariances[t, quiet])
            _add(matrix, right, shares, known, rest**2, weights[t, quiet], _MOST)
    shares = np.zeros((T, n, S + 1))
    shares[..., S] = _diagonal(factor[:, m], predicted.covariances[:, m])
    _add(matrix, right, shares, 1.0 - shares[..., S], white_off[:, m] ** 2, weights[:, m], _HARDEST)
    return matrix, right


def _times(matrices: Array, vectors: Array) -> Array:
    return np.asarray((matrices @ vectors[..., None])[..., 0])


def _diagonal(rows: Array, matrices: Array) -> Array:
    """Diagonals of A B A' for many A and B."""
    return np.asarray(np.einsum("kij,kjl,kil->ki", rows, matrices, rows))


def _add(matrix: Array, right: Array, parts: Array, known: Array, squares: Array, weights: Array, most: float) -> None:
    """Add squares (K, d), given the parts of their variances (K, d, S + 1), and parts that are known (K, d)."""
    variance = parts.sum(axis=-1) + known
    share = (parts / variance[..., None]).reshape(-1, parts.shape[-1])
    weighted = share * np.repeat(0.5 * weights, parts.shape[1])[:, None]
    matrix += weighted.T @ share
    right += weighted.T @ (np.minimum(squares / variance, most) - known / variance).ravel()
