"""Estimates of what is declared but may be wrong: noise, detection probabilities, false alarms, manoeuvres.

All of them are sums that forget exponentially, over a prior at the declared values. The noise of S sensors and the
manoeuvres are S + 1 factors of variances, x: the square of a residual has the mean g x with known g, so that weighted
least squares finds them together, whoever is to blame (`assoc.tracking.adapting.residuals`).

A track's detections and misses count once it is detected again later: what follows the last detection may be the
target's end. Read backwards from the last detection, the earlier ones are independent of the choice.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from assoc._types import Array
from assoc.costs.views import BANDS, reach
from assoc.sensors import Sensor

KEEP = 0.98
"""Share of a sum that is kept from turn to turn."""

# the priors count as so many squared residuals, dwells on targets, and scans
_RESIDUALS, _MANOEUVRES, _DWELLS, _SCANS = 50.0, 10.0, 20.0, 5.0
# log odds of detection differ by so much from band to band of range, and from the sensor's
_FROM_BAND, _FROM_SENSOR, _NEWTON = 0.7, 2.0, 2
# beyond these log odds a probability is no other number than 0 or 1
_ODDS = 12.0
_WALK = np.diff(np.eye(BANDS), axis=0) / _FROM_BAND
_BY_RANGE = _WALK.T @ _WALK + np.eye(BANDS) / _FROM_SENSOR**2
# an estimate is used where it is this many standard deviations from what was declared, until it is closer than these
_SURE, _UNSURE = 3.5, 2.0
# and is changed in steps of this share
_STEP = 0.1
_AXES = 3.0
_LARGEST = 100.0
"""Variances are multiplied by at most this, and divided by at most this."""
NOISE, DETECTION, ALARMS = 0, 1, 2
"""Columns of `Estimates.used`."""
PER_TRACK = ("ids", "open_hits", "open_dwells")
"""Those of the `Estimates` that have a row for each track."""


class Estimates(NamedTuple):
    """What S sensors and the targets have shown so far."""

    factors: Array
    """Factors of the variances of the sensors' noise, and of the predictions, (S + 1,)."""
    weights: Array
    """Their information, relative to the factors in use, (S + 1, S + 1)."""
    hits: Array
    """Detections of tracks by bands of range, (S, B)."""
    dwells: Array
    """Detections and misses, (S, B)."""
    alarms: Array
    """Measurements of no track, (S,)."""
    turns: Array
    """Turns in which they came, (S,)."""
    ids: Array
    """Tracks whose last detections and misses do not count yet, ascending, int64 (T,)."""
    open_hits: Array
    """Their detections, (T, S)."""
    open_dwells: Array
    """Their detections and misses, (T, S)."""
    used: Array
    """Factor of the noise's variance, P_d, false alarms a scan in use, (S, 3)."""
    bands: Array
    """P_d in use by bands of range, (S, B): the sensor's where there is no better."""
    manoeuvres: float = 1.0
    """Factor of the process noise's variance in use."""

    @staticmethod
    def declared(sensors: Sequence[Sensor]) -> Estimates:
        """Nothing seen, everything as declared."""
        S, used = len(sensors), declared_values(sensors)
        none, nothing = np.zeros((0, S)), np.zeros((S, BANDS))
        return Estimates(
            np.ones(S + 1), np.diag(_prior(S)), nothing, nothing, np.zeros(S), np.zeros(S),
            np.zeros(0, dtype=np.int64), none, none, used, np.repeat(used[:, DETECTION, None], BANDS, axis=1),
        )  # fmt: skip

    def found(self, sensors: Sequence[Sensor]) -> tuple[Array, Array]:
        """Estimates as in `used`, and standard deviations of their logarithms (P_d: of ln(P / (1 - P))), (S, 3)."""
        P, rate = declared_values(sensors).T[1:]
        dwells, alarms = self.dwells.sum(axis=1) + _DWELLS, self.alarms + _SCANS * rate
        seen = (self.hits.sum(axis=1) + _DWELLS * P) / dwells
        # beside a filter's cautious predictions alone, noise looks smaller than it is
        factors = self.factors[:-1] if len(sensors) > 1 else np.maximum(self.factors[:-1], 1.0)
        values = [factors, seen, alarms / (self.turns + _SCANS)]
        spreads = [self.spreads[:-1], 1.0 / np.sqrt(dwells * seen * (1.0 - seen)), 1.0 / np.sqrt(alarms)]
        return np.stack(values, axis=1), np.stack(spreads, axis=1)

    def by_range(self, seen: Array) -> tuple[Array, Array]:
        """Detection probabilities by bands of range, and standard deviations of their log odds, (S, B) each.

        The log odds of a band are about those of its neighbours, and, more loosely, about those of the sensor, `seen`
        (S,) at all ranges; they are the likeliest ones by Newton's method, from those in use.
        """
        middle, odds = _odds(seen[:, None]), _odds(self.bands)
        for _ in range(_NEWTON):
            P = 1.0 / (1.0 + np.exp(-odds))
            weights = _BY_RANGE + (self.dwells * P * (1.0 - P))[:, :, None] * np.eye(BANDS)
            slope = self.hits - self.dwells * P - (odds - middle) @ _BY_RANGE
            odds = np.clip(odds + np.linalg.solve(weights, slope[..., None])[..., 0], -_ODDS, _ODDS)
        spreads = np.sqrt(np.diagonal(np.linalg.inv(weights), axis1=1, axis2=2))
        return 1.0 / (1.0 + np.exp(-odds)), spreads

    @property
    def spreads(self) -> Array:
        """Standard deviations of the factors' logarithms, (S + 1,)."""
        return np.sqrt(np.diagonal(np.linalg.inv(self.weights)))

    @property
    def _in_use(self) -> Array:
        return np.append(self.used[:, NOISE], self.manoeuvres)

    def weighed(self, matrix: Array, right: Array) -> Estimates:
        """Take in residuals by their normal equations, relative to the factors in use."""
        weights = self.weights + matrix
        factors = self._in_use * np.linalg.solve(weights, self.weights @ (self.factors / self._in_use) + right)
        return self._replace(weights=weights, factors=np.clip(factors, 1.0 / _LARGEST, _LARGEST))

    def counted(self, ids: Array, dwells: Array, hits: Array, bands: Array) -> Estimates:
        """Count a scan's detections and misses of T confirmed tracks, by ascending ids; others are forgotten.

        `dwells` and `hits` (T, S) say which sensors could see each track, and detected it; `bands` (T, S) is the
        track's band of range from each.
        """
        row = np.searchsorted(self.ids, ids)
        known = np.append(self.ids, -1)[row] == ids
        open_hits, open_dwells = np.zeros((2, len(ids), len(self.hits)))
        open_hits[known], open_dwells[known] = self.open_hits[row[known]], self.open_dwells[row[known]]
        again = hits.any(axis=1)
        shape = self.hits.shape
        cell = (np.arange(shape[0]) * shape[1] + bands[again]).ravel()
        done_hits, done_dwells = (
            np.bincount(cell, counts[again].ravel(), shape[0] * shape[1]).reshape(shape)
            for counts in (open_hits, open_dwells)
        )
        open_hits[again] = open_dwells[again] = 0.0
        return self._replace(
            hits=self.hits + done_hits, dwells=self.dwells + done_dwells,
            ids=ids, open_hits=open_hits + hits, open_dwells=open_dwells + dwells,
        )  # fmt: skip

    def forgotten(self, turns: Array) -> Estimates:
        """The sums after a scan in which each sensor made so many turns, (S,)."""
        kept, prior = KEEP**turns, (1.0 - KEEP ** float(turns.mean())) * np.diag(_prior(len(self.used)))
        weights = self.weights * KEEP ** float(turns.mean())
        fading = self._replace(weights=weights).weighed(prior, prior @ (1.0 / self._in_use))
        return fading._replace(
            hits=self.hits * kept[:, None], dwells=self.dwells * kept[:, None],
            alarms=self.alarms * kept, turns=self.turns * kept,
        )  # fmt: skip

    def settled(self, sensors: Sequence[Sensor]) -> Estimates:
        """The estimates with what is to be used from now on."""
        found, spreads = self.found(sensors)
        # less noise than declared does no harm
        found[:, NOISE] = np.maximum(found[:, NOISE], 1.0)
        S, noise = len(sensors), self.used[:, NOISE]
        declared = declared_values(sensors)
        choice = _choice(_scales(self.used), _scales(declared), _scales(found), spreads)
        used = np.choose(choice, [declared, self.used, found])
        of_sensor, before = (np.broadcast_to(own[:, DETECTION, None], self.bands.shape) for own in (used, self.used))
        bands = np.where(self.bands == before, of_sensor, self.bands)
        seen, spreads_of_bands = self.by_range(found[:, DETECTION])
        # all bands of a sensor as soon as one is surely different
        choice = _choice(_odds(bands), _odds(of_sensor), _odds(seen), spreads_of_bands, axis=1)
        choice[[not reach(sensor) for sensor in sensors]] = 0
        self = self._replace(bands=np.choose(choice, [of_sensor, bands, seen]))
        if (used[:, NOISE] > noise).any():
            # what looked like manoeuvres may have been noise
            factors, weights = self.factors.copy(), self.weights.copy()
            factors[S], weights[S], weights[:, S], weights[S, S] = 1.0, 0.0, 0.0, 0.5 * _MANOEUVRES
            return self._replace(used=used, manoeuvres=1.0, factors=factors, weights=weights)
        # manoeuvres that do not occur may begin at any time; each is along one axis, and a gate too narrow ends a track
        now, factor = max(self.manoeuvres / _AXES, 1.0), max(float(self.factors[S]), 1.0)
        choice = _choice(np.log([now]), np.zeros(1), np.log([factor]), self.spreads[S:])
        return self._replace(used=used, manoeuvres=(1.0, self.manoeuvres, _AXES * factor)[int(choice[0])])


def declared_values(sensors: Sequence[Sensor]) -> Array:
    """What is declared, in the order of `Estimates.used`, (S, 3)."""
    return np.array([(1.0, sensor.detection_probability, sensor.false_alarm_rate) for sensor in sensors])


def _scales(values: Array) -> Array:
    """Logarithms, of probabilities those of the odds."""
    found = np.log(values)
    found[:, DETECTION] = _odds(values[:, DETECTION])
    return found


def _odds(probabilities: Array) -> Array:
    """Logarithms of odds."""
    return np.asarray(np.log(probabilities) - np.log1p(-probabilities))


def _prior(sensors: int) -> Array:
    """Information of the prior about the factors of variances, (S + 1,)."""
    return np.append(np.full(sensors, 0.5 * _RESIDUALS), 0.5 * _MANOEUVRES)


def _choice(now: Array, declared: Array, found: Array, deviation: Array, axis: tuple[int, ...] | int = ()) -> Array:
    """Whether to use what is declared (0), what is in use now (1), or the estimate (2); of an axis all or none."""
    away = np.abs(found - declared) / deviation
    trusted = ((away > _SURE) | ((now != declared) & (away > _UNSURE))).any(axis=axis, keepdims=True)
    moved = (np.abs(found - now) > np.maximum(_STEP, 0.5 * deviation)).any(axis=axis, keepdims=True)
    return np.broadcast_to(np.where(trusted, np.where(moved, 2, 1), 0), found.shape).copy()
