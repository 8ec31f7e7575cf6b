"""Two tracks and a sensor that may not resolve them: how likely, what its plots then say, and what they say if not.

References
----------
W. Koch, G. van Keuk, Multiple hypothesis track maintenance with possibly unresolved measurements, IEEE Trans. Aerospace
and Electronic Systems 33, 1997.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.special import logsumexp, ndtr

from assoc._types import Array
from assoc.filters.base import Expected, Filter, predict_each
from assoc.sensors import Sensor

# what nobody said is one of these numbers of the noise's deviations, for lengths and for angles; first: no limit
_STEPS = 2.0 ** np.arange(1.0, 4.5, 0.5)
GRID = np.concatenate([np.zeros((1, 2)), np.stack(np.meshgrid(_STEPS, _STEPS, indexing="ij"), axis=-1).reshape(-1, 2)])


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
    spread = np.sqrt(np.maximum(np.diagonal(covariance, axis1=1, axis2=2), 1e-18))[:, None]
    off = difference[:, None]
    inside = ndtr((limits - off) / spread) - ndtr((-limits - off) / spread)
    return np.asarray(np.clip(inside.prod(axis=2), 0.0, 1.0 - 1e-9))


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


def looks_of(filter: Filter[Any], sensor: Sensor, one: Any, other: Any) -> Looks:
    """What a sensor is expected to measure of pairs in these states."""
    a, b = filter.expected(one, sensor), filter.expected(other, sensor)
    return Looks(a, b, sensor.residual(a.mean, b.mean), a.covariance + b.covariance - 2.0 * sensor.covariance)


def timed_looks(
    filter: Filter[Any], sensor: Sensor, plots: Array, later: Array, looks: Looks, pairs: Sequence[Any]
) -> Looks:
    """`looks_of` at the time of the plot (n, d) nearest to each midpoint, `later` (n,) than two states of `pairs`."""
    middle = looks.second.mean + 0.5 * looks.difference
    inverse, off = np.linalg.inv(sensor.covariance), np.stack([sensor.residual(plots, _like(m, plots)) for m in middle])
    nearest = np.einsum("kni,ij,knj->kn", off, inverse, off).argmin(axis=1)
    return looks_of(filter, sensor, *(predict_each(filter, states, later[nearest]) for states in pairs))


class Explained(NamedTuple):
    """The plots of a sensor explained by a pair of tracks and false alarms."""

    one: float
    """Logarithm of their likelihood if the pair is unresolved, relative to false alarms alone."""
    two: float
    """If it is not."""
    plot: int
    """The plot (from 0) that is likeliest to be of both, -1: there is none."""
    offers: Array
    """The two plots that it is worth, one of each track, (2, d)."""


def explained(
    sensor: Sensor, z: Array, clutter: Array, looks: Looks, k: int, precision: Array, pull: Array
) -> Explained:
    """How pair k explains plots z (n, d); `clutter` (n,) is the logarithm of the density of false alarms.

    `precision` and `pull` (d,): see `narrowed`. The offers move both tracks as the joint update by a measurement of
    their midpoint, and of their difference, does.
    """
    P = sensor.detection_probability
    difference, covariance = looks.difference[k], looks.covariance[k]
    middle = looks.second.mean[k] + 0.5 * difference
    spread = spread_of(sensor.covariance, covariance, difference)
    off = sensor.residual(z, _like(middle, z))
    at_middle = _density(off, spread) - clutter
    a, b = (_density(sensor.residual(z, _like(e.mean[k], z)), e.covariance[k]) - clutter
            for e in (looks.first, looks.second))  # fmt: skip
    one = float(
        np.logaddexp(2.0 * math.log1p(-P), math.log1p(-((1.0 - P) ** 2)) + logsumexp(np.append(at_middle, -745.0)))
    )
    # each by a plot of its own or by none: no plot serves both
    odds = math.log(P) - math.log1p(-P)
    free = np.exp(np.clip(a + odds, -700.0, 300.0)), np.exp(np.clip(b + odds, -700.0, 300.0))
    both = (1.0 + free[0].sum()) * (1.0 + free[1].sum()) - (free[0] * free[1]).sum()
    two = 2.0 * math.log1p(-P) + math.log(max(float(both), 1.0))
    plot = int(at_middle.argmax()) if len(z) else -1
    if plot < 0:
        return Explained(one, two, plot, off[:0])
    step = 0.5 * np.linalg.solve(spread, off[plot])
    closer = np.linalg.solve(np.eye(len(pull)) + precision[:, None] * covariance, pull)
    steps = step + closer, step - closer
    both_looks = zip((looks.first, looks.second), steps, strict=True)
    return Explained(one, two, plot, np.stack([e.mean[k] + e.covariance[k] @ way for e, way in both_looks]))


def spread_of(noise: Array, covariance: Array, difference: Array) -> Array:
    """Covariance of a plot of two around the midpoint of their predictions; covariance is that of their difference."""
    # echoes of random strength: the centre is anywhere between the two
    return np.asarray(noise + 0.25 * covariance + (np.outer(difference, difference) + covariance) / 12.0)


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


def _like(one: Array, plots: Array) -> Array:
    return np.broadcast_to(one, plots.shape)


def _density(off: Array, covariance: Array) -> Array:
    """Logarithm of the normal density, (n,)."""
    square = np.einsum("ni,ij,nj->n", off, np.linalg.inv(covariance), off)
    return np.asarray(-0.5 * (square + np.linalg.slogdet(2.0 * math.pi * covariance)[1]))
