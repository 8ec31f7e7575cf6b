"""Targets that return several plots a scan, spread over their extent: what says so, and how large they are."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from scipy.special import comb, gammaln

from assoc._types import Array
from assoc.tracking.records.track import rows_of_ids

SPREADS = 133.0 * 2.0 ** -np.arange(8.0)
"""Standard deviations of plots about a target that are weighed, metres; first that of the longest hull, of 460 m."""

# log likelihood ratios: what one scan says at most, for nobody's model is exact; at what a track is taken for a point
_MOST, _POINT = 3.0, -6.0
# odds of targets with an extent before any was seen: with, without
_BEFORE = (0.2, 20.0)
_SURE = math.log(3.0)
# and odds against a target where no track is confirmed
_NEW = 7.0
# a spread taken for the extent counts as so many plots, and plots so many at most: extents turn with their targets
_FIRST, _LAST = 4.0, 60.0
# with fewer plots a dwell than that, in so many dwells, a target is a point after all
_ONE, _DWELLS, _KEPT = 1.15, 10.0, 0.95
# numbers of points that may be there instead, each detected with this share of P_d; and with what probability it is
# neither, for a target comes or goes
_MANY, _SHARES, _OTHER = np.arange(1.0, 25.0), np.array([0.85, 1.0]), 0.02
# and how many there must be, or it is targets that are missed
_SEVERAL = 1.5


def binomial(number: Array, points: Array, P: Array) -> Array:
    """Probability of a number of plots of so many points, each detected with P. (scipy.stats takes long to import.)"""
    missed = np.maximum(points - number, 0.0)
    return np.asarray(comb(points, number) * P**number * (1.0 - P) ** missed)


def gamma_poisson(number: Array, shape: float, rate: float) -> Array:
    """Probability of a Poisson number of plots whose mean has a gamma distribution of this shape and rate."""
    ways = gammaln(number + shape) - gammaln(number + 1.0) - gammaln(shape)
    return np.asarray(np.exp(ways + shape * np.log(rate / (rate + 1.0)) - number * np.log(rate + 1.0)))


class Extents(NamedTuple):
    """T tracks for which several plots of one sensor were seen, with G spreads and S sensors."""

    ids: Array
    """Ids, ascending, int64 (T,)."""
    evidence: Array
    """Log likelihood ratio of one target with this spread against several points, by numbers of plots, (T, G)."""
    places: Array
    """The same by where these plots are, never above 0, (T, G)."""
    plots: Array
    """Plots of such a target so far, by sensor, (T, S, G)."""
    points: Array
    """Probability that it is so many points instead, detected so often (`_MANY`, `_SHARES`), (T, S, G, M, 2)."""
    dwells: Array
    """Dwells in which they were counted, (T, S)."""
    shapes: Array
    """Covariance of the plots of such a target, m^2, (T, G, 3, 3)."""
    shape_plots: Array
    """So many plots say what it is, (T, G)."""
    last: Array
    """Plots of a target with an extent, and dwells, old ones forgotten, (T, S, 2)."""
    covariance: Array
    """Of the plots about the target, 0 where it is taken for a point, m^2, (T, 3, 3)."""
    weight: Array
    """So many plots say what it is, (T,)."""
    past: Array
    """Scan, sensor and number of the plot that each plot was put into, of scans that are not final; int64 (M, 3)."""

    @staticmethod
    def none(sensors: int) -> Extents:
        """No track."""
        few = len(SPREADS)
        return Extents(
            np.zeros(0, dtype=np.int64), np.zeros((0, few)), np.zeros((0, few)), np.zeros((0, sensors, few)),
            np.zeros((0, sensors, few, len(_MANY), len(_SHARES))), np.zeros((0, sensors)),
            np.zeros((0, few, 3, 3)), np.zeros((0, few)),
            np.zeros((0, sensors, 2)), np.zeros((0, 3, 3)), np.zeros(0), np.zeros((0, 3), dtype=np.int64),
        )  # fmt: skip

    def of(self, ids: Array) -> Extents:
        """Those of tracks with these ids (K,), ascending; nothing was seen of those that are new."""
        rows, found = rows_of_ids(self.ids, ids), []
        for value in self[1:11]:
            found.append(np.append(value, np.zeros((1, *value.shape[1:])), axis=0)[rows])
        return Extents._make([ids, *found, self.past])

    @property
    def extended(self) -> Array:
        """Which have an extent, bool (T,)."""
        return self.weight > 0.0

    def rates(self, row: int, s: int) -> Array:
        """Plots in a dwell of sensor s that are expected of a track with each spread, (G,)."""
        return np.asarray((1.0 + self.plots[row, s]) / (1.0 + self.dwells[row, s]))

    def opened(self, row: int, axes: int) -> Extents:
        """With a track of which more than one plot was seen: its plots are weighed from now on."""
        points, shapes, count = (np.array(each) for each in (self.points, self.shapes, self.shape_plots))
        points[row], count[row] = 1.0 / points[0, 0, 0].size, _FIRST
        shapes[row] = (SPREADS**2)[:, None, None] * np.diag(np.arange(3) < axes)
        return self._replace(points=points, shapes=shapes, shape_plots=count)

    @property
    def lengths(self) -> Array:
        """How long the targets with an extent are, if their plots are spread evenly along them, metres."""
        return np.asarray(np.sqrt(12.0 * np.linalg.eigvalsh(self.covariance[self.extended])[:, -1]))

    @property
    def open(self) -> Array:
        """Of which tracks the plots are weighed, bool (T,)."""
        return np.asarray(self.shape_plots.any(axis=1))

    def weighed(self, row: int, s: int, P: float, ratio: Array, plots: Array, scatter: Array) -> Extents:
        """After a dwell of sensor s, which detects with P, with so many plots of a target with each spread (G,).

        `ratio` (G,) is the log likelihood ratio of their places, `scatter` (G, 3, 3) the sum of their squares about
        their mean, without noise.
        """
        evidence, places = self.evidence.copy(), self.places.copy()
        counts, dwells, points = self.plots.copy(), self.dwells.copy(), self.points.copy()
        number = np.round(plots)
        several = (1.0 - _OTHER) * binomial(number[:, None, None], _MANY[:, None], P * _SHARES) + _OTHER / len(_MANY)
        likelihood = (points[row, s] * several).sum(axis=(1, 2))
        target = gamma_poisson(number, 1.0 + counts[row, s], 1.0 + dwells[row, s])
        # tracks that are where no target is are no sign of an extent
        places[row] = np.minimum(places[row] + np.clip(ratio, -_MOST, _MOST), 0.0)
        evidence[row] += np.log((1.0 - _OTHER) * target + _OTHER / len(_MANY)) - np.log(likelihood)
        weights = points[row, s] * several / likelihood[:, None, None]
        points[row, s] = (1.0 - _OTHER) * weights + _OTHER / weights[0].size
        counts[row, s] += plots
        dwells[row, s] += 1.0
        shapes, before, more = self.shapes.copy(), self.shape_plots.copy(), np.maximum(plots - 1.0, 0.0)
        share = (more / (before[row] + more))[:, None, None]
        mixed = (1.0 - share) * shapes[row] + scatter / (before[row] + more)[:, None, None]
        values, vectors = np.linalg.eigh(mixed)
        shapes[row] = (vectors * np.maximum(values, 0.0)[:, None]) @ vectors.swapaxes(1, 2)
        before[row] += more
        return self._replace(
            evidence=evidence,
            places=places,
            plots=counts,
            points=points,
            dwells=dwells,
            shapes=shapes,
            shape_plots=before,
        )

    def after(self, before: Extents) -> Extents:
        """These, after a scan, whose evidence is limited; `before` are the same tracks before it."""
        said = np.clip(self.evidence - before.evidence, -_MOST, _MOST)
        return self._replace(evidence=np.maximum(before.evidence + said, _POINT))

    def with_past(self, scan: int, index: Sequence[Array]) -> Extents:
        """The same with the number of the plot that each plot of each sensor was put into in a scan, (n_s,)."""
        rows = [(scan, s, int(n)) for s, numbers in enumerate(index) for n in numbers]
        past = np.concatenate([self.past, np.array(rows, dtype=np.int64).reshape(-1, 3)])
        return self._replace(past=past)

    @property
    def numbers(self) -> Array:
        """Plots in a dwell of each sensor of a target with an extent, (T, S)."""
        return np.asarray((1.0 + self.last[..., 0]) / (1.0 + self.last[..., 1]))

    def spread(self, row: int, s: int, plots: int, covariance: Array | None) -> Extents:
        """After a dwell with so many plots of an extended target, whose covariance without noise was (3, 3)."""
        last = self.last.copy()
        last[row, s] = _KEPT * last[row, s] + [plots, 1.0]
        found = self._replace(last=last)
        if covariance is None:
            return found
        more, weight, every = plots - 1.0, self.weight.copy(), self.covariance.copy()
        mixed = every[row] + more / (weight[row] + more) * (covariance - every[row])
        values, vectors = np.linalg.eigh(mixed)
        every[row] = (vectors * np.clip(values, 0.0, SPREADS[0] ** 2)) @ vectors.T
        weight[row] = min(weight[row] + more, _LAST)
        return found._replace(covariance=every, weight=weight)

    def chosen(self, confirmed: Array) -> Array:
        """The spread (its number) of each track that is rather a target with that extent, -1 of the others, int (T,).

        `confirmed` (T,) says which were targets already.
        """
        extended = np.count_nonzero(self.extended)
        prior = math.log((_BEFORE[0] + extended) / (_BEFORE[1] + np.count_nonzero(confirmed) - extended))
        several = (self.plots / np.maximum(self.dwells, 1.0)[..., None]).max(axis=1) > _SEVERAL
        evidence = np.where(several, self.evidence + self.places, -math.inf)
        sure = evidence.max(axis=1, initial=-math.inf) + prior - _NEW * ~confirmed > _SURE
        return np.where(sure, evidence.argmax(axis=1), -1)

    def with_extent(self, row: int, number: int) -> Extents:
        """The same with this spread of the plots of a track."""
        every, weight, last = self.covariance.copy(), self.weight.copy(), self.last.copy()
        every[row] = self.shapes[row, number]
        weight[row], last[row] = _FIRST, np.stack([self.plots[row, :, number], self.dwells[row]], axis=1)
        return self._replace(covariance=every, weight=weight, last=last)._closed(np.arange(len(self.ids)) == row)

    def _closed(self, rows: Array) -> Extents:
        """The same with nothing weighed of some tracks, bool (T,)."""
        left = [np.where(rows.reshape(-1, *[1] * (value.ndim - 1)), 0.0, value) for value in self[1:8]]
        return Extents._make([self.ids, *left, *self[8:]])

    def kept(self) -> Extents:
        """The tracks of which there is something to say: no points, and none that have become so."""
        looks = self.last[..., 1]
        single = self.extended & ((self.numbers < _ONE) | (looks < 1.0)).all(axis=1) & (looks.max(axis=1) > _DWELLS)
        found = self._closed(
            (self.dwells.sum(axis=1) > 0.0) & ((self.evidence + self.places).max(axis=1, initial=_POINT) <= _POINT)
        )
        rows = np.flatnonzero((found.open | self.extended) & ~single)
        return Extents._make([*(value[rows] for value in found[:11]), self.past])


def one_by_one(decision: Any, past: Array) -> Any:
    """A decision about each plot, from that about those they were put into; see `Extents.past`."""
    own = past[past[:, 0] == decision.scan]
    if not len(own):
        return decision
    index = [own[own[:, 1] == s, 2] for s in range(len(decision.assigned))]
    return replace(
        decision,
        assigned=tuple(ids[rows] for ids, rows in zip(decision.assigned, index, strict=True)),
        confirmed=tuple(sure[rows] for sure, rows in zip(decision.confirmed, index, strict=True)),
    )
