"""Residuals of measurements of confirmed tracks, and whose variances they show.

A sensor's measurement is compared with the position that the other sensors of the scan give; so the target's motion
does not matter. Where there is no other, it is compared with the prediction of the filter's quietest model, by its
probability. Filters are cautious: they expect manoeuvres, and so predictions are better than they say; one factor of
all their variances is estimated with the noise. The variance of a residual is a sum of parts, each proportional to the
variance of one sensor's noise or of the prediction.

How hard targets manoeuvre is asked of the predictions of all models together, with more process noise and with less: a
measurement that fits none of them may be a false alarm or of another target, and is as likely by each: else a few wrong
associations would widen the gates, and bring more of them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from assoc._types import Array
from assoc.sensors import Sensor
from assoc.tracking.records.estimates import FACTORS
from assoc.tracking.records.prequential import gain_of_variances

# beside other sensors the prediction only fills the directions that they leave open
_BESIDE = 0.01
# squares beyond so many variances are taken for wrong associations
_MOST = 10.0


class Seen(NamedTuple):
    """Measurements of one sensor that belong to tracks."""

    track: Array
    """Rows, int (K,)."""
    measured: Array
    """(K, d)."""
    predicted: Array
    """Predicted positions at the measurements' times, (K, 3)."""
    nearest: Array
    """Squared distance of the nearest measurement of no track, in units of the prediction's variance, (K,); inf where
    the track is surely of one target."""


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
    velocities: Array
    """Of the tracks, (T, n)."""
    noises: Array
    """Of each model, covariance of the process noise since the last scan as declared, (M, n, n)."""


class Shown(NamedTuple):
    """What residuals show."""

    matrix: Array
    """Normal matrix of the factors of the noise's and, last, of predictions' variances, relative to those in use,
    (S + 1, S + 1)."""
    right: Array
    """Its right side, (S + 1,)."""
    noise: Array
    """Gain of the evidence for each estimated factor, (S,)."""
    manoeuvres: Array
    """Log likelihood with the process noise times each of `FACTORS` (of estimates), relative to declared, (G,)."""
    biases: tuple[Array, Array]
    """Normal equations of the biases (`assoc.tracking.records.biases`), (K, K) and (K,)."""


def shown_by(
    sensors: Sequence[Sensor],
    seen: Sequence[Seen],
    predicted: Predicted,
    noise: Array,
    estimates: Array,
    now: float = 1.0,
) -> Shown:
    """What residuals of measurements say.

    The sensors are as declared, with P_d and false alarms in use; `noise` (S,) are the factors of the noise's variances
    in use, `estimates` (S + 1,) the estimated ones and that of predictions, and `now` is that of the process noise.
    """
    T, _, n = predicted.offsets.shape
    S = len(sensors)
    sums = _Sums(np.append(noise, 1.0), estimates)
    prior = np.linalg.inv(predicted.covariance)
    parts = [sensor.position_part for sensor in sensors]
    whites = [np.linalg.inv(np.linalg.cholesky(part.covariance)) for part in parts]
    shift = np.zeros((T, 3))
    # linearised at the prediction, then at the position that all measurements give
    for last in (False, True):
        rows, information, vectors = [], np.zeros((S, T, n, n)), np.zeros((S, T, n))
        for s, (part, white, (track, z, position, _)) in enumerate(zip(parts, whites, seen, strict=True)):
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
    biases = _biases(whites, rows, noise, predicted.velocities, _BESIDE**2 * prior)
    weights = np.exp(fit - fit.max(axis=1, keepdims=True))
    weights /= weights.sum(axis=1, keepdims=True)
    size = np.einsum("tmii->m", predicted.covariances)
    quiet = int(np.argmin(size))
    for s, (track, H, y) in enumerate(rows):
        # heights are what a target's transponder says, to all radars the same: no noise of the sensor
        own = [k for k, name in enumerate(parts[s].components[: parts[s].dim]) if name != "height"]
        alone = count[track] == 1
        beside = np.flatnonzero(~alone)
        if len(beside):
            t, h = track[beside], H[beside]
            others = information[:, t].copy()
            others[s] = 0.0
            gain = h @ np.linalg.inv(_BESIDE * prior[t] + others.sum(axis=0))
            shares = np.zeros((*y[beside].shape, S + 1))
            for r in range(S):
                shares[..., r] = _diagonal(gain, others[r]) if r != s else noise[s]
            known = _diagonal(gain, _BESIDE**2 * prior[t])
            rest = y[beside] - _times(gain, vectors[:, t].sum(axis=0) - vectors[s, t])
            sums.add(shares[:, own], known[:, own], rest[:, own] ** 2, np.ones(len(t)))
        if alone.any():
            t, h = track[alone], H[alone]
            shares = np.zeros((*y[alone].shape, S + 1))
            shares[..., s] = noise[s]
            shares[..., S] = _diagonal(h, predicted.covariances[t, quiet])
            rest = y[alone] - _times(h, predicted.offsets[t, quiet])
            sums.add(shares[:, own], np.zeros_like(rest[:, own]), rest[:, own] ** 2, weights[t, quiet])
    manoeuvres = _manoeuvres(parts, seen, rows, predicted, np.maximum(noise, estimates[:-1]), now)
    return Shown(sums.matrix, sums.right, sums.gain, manoeuvres, biases)


def _biases(
    whites: Sequence[Array], rows: Sequence[tuple[Array, Array, Array]], noise: Array, velocities: Array, prior: Array
) -> tuple[Array, Array]:
    """See `Shown`: by tracks that several sensors measured, whose positions are eliminated."""
    T, n = velocities.shape
    sizes = [len(white) for white in whites]
    A, B, Y = (
        np.zeros((T, sum(sizes), n)),
        np.zeros((T, sum(sizes), sum(sizes) + len(sizes))),
        np.zeros((T, sum(sizes))),
    )
    seen, row, column = np.zeros(T, dtype=np.int64), 0, 0
    for white, d, factor, (track, H, y) in zip(whites, sizes, noise.tolist(), rows, strict=True):
        scale, at = factor**-0.5, slice(row, row + d)
        A[track, at], Y[track, at] = scale * H, scale * y
        B[track, at, column : column + d] = scale * white
        # stamped late: where the target was before
        B[track, at, column + d] = -scale * _times(H, velocities[track])
        seen[track] += 1
        row, column = row + d, column + d + 1
    gain = np.linalg.inv(A.swapaxes(1, 2) @ A + prior) @ A.swapaxes(1, 2)
    rest = Y - _times(A, _times(gain, Y))
    good = (seen > 1) & ((rest**2).sum(axis=1) < _MOST * sum(sizes))
    B, rest = B[good], rest[good]
    left = B - A[good] @ (gain[good] @ B)
    return np.einsum("tdi,tdj->ij", B, left), np.einsum("tdi,td->i", B, rest)


def _manoeuvres(
    parts: Sequence[Sensor],
    seen: Sequence[Seen],
    rows: Sequence[tuple[Array, Array, Array]],
    predicted: Predicted,
    noise: Array,
    now: float,
) -> Array:
    """See `Shown`; `rows` are tracks, Jacobians and measurements relative to the prediction, in units of noise."""
    gain, free = np.zeros(len(FACTORS)), np.ones(len(predicted.offsets), dtype=np.bool_)
    for part, own, (track, H, y), factor in zip(parts, seen, rows, noise.tolist(), strict=True):
        # one measurement of each track: several are not independent
        first = free[track]
        free[track] = False
        if first.any():
            # the density of false alarms, and of plots of other targets
            P, units, d = part.detection_probability, math.sqrt(np.linalg.det(part.covariance)), part.dim
            gate = np.linalg.det(_around(H, predicted.covariance[track]) + factor * np.eye(d))
            volume = (math.pi * own.nearest) ** (0.5 * d) / math.gamma(0.5 * d + 1.0) * np.sqrt(gate)
            other = (1.0 - P) / P * (part.false_alarm_rate / part.volume * units + 1.0 / volume)
            gain += _of_factors(predicted, track[first], H[first], y[first], factor, now, other[first])
    return gain


def _of_factors(
    predicted: Predicted, track: Array, H: Array, y: Array, noise: float, now: float, other: Array
) -> Array:
    """Log likelihoods of measurements by the process noise, see `Shown`; `other` are densities of other ones."""
    scale, d = scales(FACTORS[:, None], np.einsum("mii->m", predicted.noises)[None]), y.shape[1]
    change = scale - scales(np.array([[now]]), np.einsum("mii->m", predicted.noises)[None])
    spread = _around(H[:, None], predicted.covariances[track]) + noise * np.eye(d)
    more = _around(H[:, None], np.broadcast_to(predicted.noises, (len(track), *predicted.noises.shape)))
    total = spread[:, None] + change[..., None, None] * more[:, None]
    off = y[:, None] - (H[:, None] @ predicted.offsets[track][..., None])[..., 0]
    square = np.einsum("kmi,kgmij,kmj->kgm", off, np.linalg.inv(total), off)
    density = np.exp(-0.5 * square) / np.sqrt(np.linalg.det(2.0 * np.pi * total))
    fit = np.log((density * predicted.weights[track][:, None]).sum(axis=2) + other[:, None]).sum(axis=0)
    return np.asarray(fit - fit[FACTORS == 1.0])


def scales(factor: Array, sizes: Array) -> Array:
    """By what a factor multiplies the process noise of models of these sizes.

    More is that of the largest alone, less that of all others: who has flown quietly so far may turn at any time.
    """
    return np.where((factor > 1.0) == (sizes == sizes.max()), factor, 1.0)


def _times(matrices: Array, vectors: Array) -> Array:
    return np.asarray((matrices @ vectors[..., None])[..., 0])


def _diagonal(rows: Array, matrices: Array) -> Array:
    """Diagonals of A B A' for many A and B."""
    return np.asarray(np.einsum("kij,kjl,kil->ki", rows, matrices, rows))


def _around(rows: Array, matrices: Array) -> Array:
    """A B A' for many A and B."""
    return np.asarray(rows @ matrices @ np.swapaxes(rows, -1, -2))


class _Sums:
    """Sums over residuals, with the factors of variances in use and as estimated, (S + 1,) each."""

    def __init__(self, now: Array, estimates: Array) -> None:
        S = len(now)
        self.matrix, self.right, self.gain = np.zeros((S, S)), np.zeros(S), np.zeros(S - 1)
        self._now, self._estimates = now, estimates

    def add(self, parts: Array, known: Array, squares: Array, weights: Array) -> None:
        """Add squares (K, d), given the parts of their variances (K, d, S + 1), and parts that are known (K, d)."""
        variance = parts.sum(axis=-1) + known
        squares = np.minimum(squares, _MOST * variance)
        share = (parts / variance[..., None]).reshape(-1, parts.shape[-1])
        weighted = share * np.repeat(0.5 * weights, parts.shape[1])[:, None]
        self.matrix += weighted.T @ share
        self.right += weighted.T @ ((squares - known) / variance).ravel()
        wide = variance + parts[..., -1] * (self._estimates[-1] - 1.0)
        parts, now = parts[..., :-1], self._now[:-1]
        either = [wide[..., None] + parts * (factor / now - 1.0) for factor in (self._estimates[:-1], 1.0)]
        self.gain += np.einsum("k,kds->s", weights, gain_of_variances(squares[..., None], *either))
