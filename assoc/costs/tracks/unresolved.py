"""Two tracks and a sensor that may not resolve them: how likely, what its plots then say, and what they say if not.

References
----------
W. Koch, G. van Keuk, Multiple hypothesis track maintenance with possibly unresolved measurements, IEEE Trans. Aerospace
and Electronic Systems 33, 1997.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from scipy.special import logsumexp, ndtr

from assoc._types import Array
from assoc.filters.base import Expected, Filter
from assoc.sensors import Sensor

# what nobody said is one of these numbers of the noise's deviations, for lengths and for angles; first: no limit
_STEPS = 2.0 ** np.arange(1.0, 4.5, 0.5)
GRID = np.concatenate([np.zeros((1, 2)), np.stack(np.meshgrid(_STEPS, _STEPS, indexing="ij"), axis=-1).reshape(-1, 2)])


@lru_cache(maxsize=64)
def resolutions(sensor: Sensor) -> Array:
    """What the resolution of a sensor may be, (G, d): what was said alone, or the grid."""
    if sensor.resolution is not None:
        return np.broadcast_to(sensor.resolution, (len(GRID), sensor.dim))
    lengths = np.array([name not in ("azimuth", "elevation") for name in sensor.components[: sensor.dim]])
    found = np.where(lengths, GRID[:, :1], GRID[:, 1:]) * np.sqrt(np.diagonal(sensor.covariance))
    # range rates: where they part targets, the plots will tell
    found[1:, [name == "range rate" for name in sensor.components[: sensor.dim]]] = np.inf
    return found


def unresolved_probability(difference: Array, covariance: Array, limits: Array) -> Array:
    """Probability that two targets differ by less than the resolution in all components, (N, G).

    `difference` (N, d) and `covariance` (N, d, d) are those of their expected measurements, `limits` (G, d). The sharp
    edge in place of Koch's and van Keuk's exp(-(d / r)^2 / 2) is what a resolution is said to be here.
    """
    spread = np.sqrt(np.maximum(np.diagonal(covariance, axis1=1, axis2=2), 1e-18))
    inside = np.ones((len(difference), len(limits)))
    for off, own, limit in zip(difference.T[..., None], spread.T[..., None], limits.T, strict=True):
        # a grid has few limits of each component
        edges, row = np.unique(limit, return_inverse=True)
        inside *= (ndtr((edges - off) / own) - ndtr((-edges - off) / own))[:, row]
    return np.clip(inside, 0.0, 1.0 - 1e-9)


def narrowed(difference: Array, covariance: Array, limits: Array, weights: Array) -> tuple[Array, Array]:
    """What is learnt of differences by their being below some `limits` (G, d) in each component, weighed (N, G).

    Components are taken one by one: a normal distribution is cut off at the limits, and mean and variance are kept, as
    by a measurement with the inverse variance p (N, d), the first result; the second is p times its innovation.
    """
    spread = np.sqrt(np.maximum(np.diagonal(covariance, axis1=1, axis2=2), 1e-18))
    low, high = (np.clip((side * limits - difference[:, None]) / spread[:, None], -1e6, 1e6) for side in (-1.0, 1.0))
    inside = np.maximum(ndtr(high) - ndtr(low), 1e-300)
    at_low, at_high = (np.exp(-0.5 * edge**2) / math.sqrt(2.0 * math.pi) for edge in (low, high))
    # of a standard normal variable between the two edges; far out in a tail at the nearer one
    mean = np.clip((at_low - at_high) / inside, low, high)
    square = np.maximum(1.0 + (low * at_low - high * at_high) / inside, mean**2)
    share = weights / np.maximum(weights.sum(axis=1, keepdims=True), 1e-300)
    mean, square = (np.einsum("ng,ngd->nd", share, moment) for moment in (mean, square))
    variance = np.clip(square - mean**2, 1e-6, 1.0) * spread**2
    precision = 1.0 / variance - 1.0 / spread**2
    return precision, mean * spread / variance


class Looks(NamedTuple):
    """What a sensor is expected to measure of N pairs."""

    first: Expected
    second: Expected
    difference: Array
    covariance: Array
    """Of the difference."""

    def of(self, rows: Array) -> Looks:
        """Select pairs."""
        first, second = (Expected(e.mean[rows], e.covariance[rows]) for e in (self.first, self.second))
        return Looks(first, second, self.difference[rows], self.covariance[rows])


def looks_of(filter: Filter[Any], sensor: Sensor, states: Any, first: Array, second: Array) -> Looks:
    """What a sensor is expected to measure of pairs in these rows (N,), (N,) of states."""
    every = filter.expected(states, sensor)
    a, b = (Expected(every.mean[rows], every.covariance[rows]) for rows in (first, second))
    return Looks(a, b, sensor.residual(a.mean, b.mean), a.covariance + b.covariance - 2.0 * sensor.covariance)


def nearest_plots(sensor: Sensor, plots: Array, looks: Looks) -> Array:
    """The plot (n, d) nearest to the midpoint of each pair, (N,)."""
    middle = looks.second.mean + 0.5 * looks.difference
    off = sensor.residual(plots[None], middle[:, None])
    return np.asarray(np.einsum("kni,ij,knj->kn", off, np.linalg.inv(sensor.covariance), off).argmin(axis=1))


def explained(sensor: Sensor, z: Array, clutter: Array, looks: Looks) -> tuple[Array, Array, Array]:
    """How each of N pairs of tracks, with false alarms, explains the plots z (n, d) of a sensor.

    `clutter` (n,) is the logarithm of the density of false alarms. Returns the logarithm of the plots' likelihood,
    relative to false alarms alone, if the pair is unresolved (N,), and if it is not (N,); and the plot (from 0) that is
    likeliest to be of both (N,), nothing where there are none.
    """
    P = sensor.detection_probability
    middle = looks.second.mean + 0.5 * looks.difference
    spread = spread_of(sensor.covariance, looks.covariance, looks.difference)
    at_middle = _density(sensor, z, middle, spread) - clutter
    nothing = np.full((len(middle), 1), -745.0)
    seen = math.log1p(-((1.0 - P) ** 2)) + logsumexp(np.hstack([at_middle, nothing]), axis=1)
    # each by a plot of its own or by none: no plot serves both
    odds = math.log(P) - math.log1p(-P)
    a, b = (
        np.exp(np.clip(_density(sensor, z, e.mean, e.covariance) - clutter + odds, -700.0, 300.0))
        for e in (looks.first, looks.second)
    )
    both = (1.0 + a.sum(axis=1)) * (1.0 + b.sum(axis=1)) - (a * b).sum(axis=1)
    two = 2.0 * math.log1p(-P) + np.log(np.maximum(both, 1.0))
    return np.logaddexp(2.0 * math.log1p(-P), seen), two, at_middle.argmax(axis=1) if len(z) else seen[:0]


def offers(sensor: Sensor, plot: Array, looks: Looks, precision: Array, pull: Array) -> Array:
    """The two plots that a plot (d,) of one pair, the only one of `looks`, is worth, one of each track, (2, d).

    They move both tracks as the joint update by a measurement of their midpoint, and of their difference, does;
    `precision` and `pull` (d,): see `narrowed`.
    """
    covariance, difference = looks.covariance[0], looks.difference[0]
    off = sensor.residual(plot, looks.second.mean[0] + 0.5 * difference)
    step = 0.5 * np.linalg.solve(spread_of(sensor.covariance, covariance, difference), off)
    closer = np.linalg.solve(np.eye(len(pull)) + precision[:, None] * covariance, pull)
    ways = zip((looks.first, looks.second), (step + closer, step - closer), strict=True)
    return np.stack([e.mean[0] + e.covariance[0] @ way for e, way in ways])


def spread_of(noise: Array, covariance: Array, difference: Array) -> Array:
    """Covariance of a plot of two around the midpoint of their predictions, (..., d, d).

    `covariance` (..., d, d) is that of the `difference` (..., d) of the two.
    """
    # echoes of random strength: the centre is anywhere between the two
    outer = difference[..., :, None] * difference[..., None, :]
    return np.asarray(noise + 0.25 * covariance + (outer + covariance) / 12.0)


def information(noise: Array, covariance: Array, difference: Array, precision: Array) -> Array:
    """Inverse covariance (d, d) by which a plot of both, and their closeness, correct one of two alike tracks.

    `covariance` is that of the expected measurement without noise, of each.
    """
    root, both = np.sqrt(precision), 2.0 * covariance
    apart = root[:, None] * np.linalg.solve(np.eye(len(root)) + root[:, None] * both * root, np.diag(root))
    return np.asarray(0.25 * np.linalg.inv(spread_of(noise, both, difference)) + apart)


def slopes(filter: Filter[Any], sensor: Sensor, mean: Array) -> Array:
    """Derivatives (d, n) of a sensor's measurement by a state with this mean (n,)."""
    axes = list(filter.motion.position)
    n = len(axes)
    moving = min(n, filter.motion.dim - n)
    place, velocity = np.zeros((1, 3)), np.zeros((1, 3))
    columns = [*axes, *(axis + n for axis in axes[:moving])]
    place[0, :n], velocity[0, :moving] = mean[axes], mean[columns[n:]]
    found, by = np.zeros((sensor.dim, len(mean))), sensor.jacobian(place, velocity)[0]
    found[:, axes] = by[:, :n]
    if by.shape[1] > 3:
        found[:, columns[n:]] = by[:, 3 : 3 + moving]
    return found


def _density(sensor: Sensor, z: Array, mean: Array, covariance: Array) -> Array:
    """Logarithm of normal densities (N,) at plots (n, d), (N, n)."""
    off = sensor.residual(z[None], mean[:, None])
    square = np.einsum("kni,kij,knj->kn", off, np.linalg.inv(covariance), off)
    return np.asarray(-0.5 * (square + np.linalg.slogdet(2.0 * math.pi * covariance)[1][:, None]))
