"""Estimates of what is declared but may be wrong: noise, detection probabilities, false alarms, manoeuvres.

All of them are sums that forget exponentially, over a prior at the declared values. The noise of S sensors is S factors
of variances, x, and that of predictions one more: the square of a residual has the mean g x with known g, so that
weighted least squares finds them together, whoever is to blame (`assoc.tracking.adapting.residuals`). Of the process
noise a few factors are tried. Each estimate is used while it predicts better than what was declared
(`assoc.tracking.records.prequential`).

A track's detections and misses count once it is detected again later: what follows the last detection may be the
target's end. Read backwards from the last detection, the earlier ones are independent of the choice.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from assoc._types import Array
from assoc.costs.views import BANDS, reach
from assoc.sensors import Sensor
from assoc.tracking.records.prequential import gain_of_rates, gain_of_shares, mean_evidence, trusted
from assoc.tracking.records.track import rows_of_ids

KEEP = 0.98
"""Share of a sum that is kept from turn to turn."""

FACTORS = 4.0 ** np.arange(-3, 5)
"""By which the variance of the process noise may be multiplied."""

# the priors count as so many squared residuals, dwells on targets, and scans
_RESIDUALS, _DWELLS, _SCANS = 10.0, 20.0, 3.0
# and are forgotten like all else, but for this share
_LEFT = 0.05
# log odds of detection differ by so much from band to band of range, and from the sensor's
_FROM_BAND, _FROM_SENSOR, _NEWTON = 0.7, 2.0, 2
# beyond these log odds a probability is no other number than 0 or 1
_ODDS = 12.0
_WALK = np.diff(np.eye(BANDS), axis=0) / _FROM_BAND
_BY_RANGE = _WALK.T @ _WALK + np.eye(BANDS) / _FROM_SENSOR**2
# what is used is changed in steps of this share
_STEP = 0.1
_LARGEST = 100.0
"""Variances are multiplied by at most this, and divided by at most this."""
NOISE, DETECTION, ALARMS, RANGES = 0, 1, 2, 3
"""Columns of `Estimates.used`, and of its evidence."""
PER_TRACK = ("ids", "open_hits", "open_dwells")
"""Those of the `Estimates` that have a row for each track."""


class Estimates(NamedTuple):
    """What S sensors and the targets have shown so far."""

    factors: Array
    """Factors of the variances of the sensors' noise and, last, of predictions, (S + 1,)."""
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
    evidence: Array
    """Logarithm of how much better each estimate predicted than what was declared, (S, 4); of P_d by range than P_d."""
    agility: Array
    """The same of `FACTORS` of the process noise, (G,)."""
    manoeuvres: float = 1.0
    """Factor of the process noise's variance in use."""

    @staticmethod
    def declared(sensors: Sequence[Sensor]) -> Estimates:
        """Nothing seen, everything as declared."""
        S, used = len(sensors), declared_values(sensors)
        none, nothing = np.zeros((0, S)), np.zeros((S, BANDS))
        return Estimates(
            np.ones(S + 1), 0.5 * _RESIDUALS * np.eye(S + 1), nothing, nothing, np.zeros(S), np.zeros(S),
            np.zeros(0, dtype=np.int64), none, none, used, np.repeat(used[:, DETECTION, None], BANDS, axis=1),
            np.zeros((S, 4)), np.zeros(len(FACTORS)),
        )  # fmt: skip

    def found(self, sensors: Sequence[Sensor]) -> Array:
        """Estimates as in `used`, (S, 3)."""
        return self._found_of(sensors)[0]

    def found_and_spreads(self, sensors: Sequence[Sensor]) -> tuple[Array, Array]:
        """Estimates as in `used`, and standard deviations of their logarithms (P_d: of ln(P / (1 - P))), (S, 3)."""
        found, dwells, alarms = self._found_of(sensors)
        seen, of_factors = found[:, DETECTION], np.sqrt(np.diagonal(np.linalg.inv(self.weights)))[:-1]
        spreads = [of_factors, 1.0 / np.sqrt(dwells * seen * (1.0 - seen)), 1.0 / np.sqrt(alarms)]
        return found, np.stack(spreads, axis=1)

    def _found_of(self, sensors: Sequence[Sensor]) -> tuple[Array, Array, Array]:
        """`found`, and the numbers of dwells and of false alarms that it rests on, (S,)."""
        P, rate = declared_values(sensors).T[1:]
        left = np.maximum(1.0 - (1.0 - KEEP) * self.turns, _LEFT)
        dwells, alarms = self.dwells.sum(axis=1) + _DWELLS * left, self.alarms + _SCANS * left * rate
        seen = (self.hits.sum(axis=1) + _DWELLS * left * P) / dwells
        return np.stack([self.factors[:-1], seen, alarms / (self.turns + _SCANS * left)], axis=1), dwells, alarms

    def by_range(self, seen: Array) -> tuple[Array, Array]:
        """Detection probabilities by bands of range, (S, B), and the information about their log odds, (S, B, B).

        The log odds of a band are about those of its neighbours, and, more loosely, about those of the sensor, `seen`
        (S,) at all ranges; they are the likeliest ones by Newton's method, from those in use.
        """
        middle, odds = _odds(seen[:, None]), _odds(self.bands)
        for _ in range(_NEWTON):
            P = 1.0 / (1.0 + np.exp(-odds))
            weights = _BY_RANGE + (self.dwells * P * (1.0 - P))[:, :, None] * np.eye(BANDS)
            slope = self.hits - self.dwells * P - (odds - middle) @ _BY_RANGE
            odds = np.clip(odds + np.linalg.solve(weights, slope[..., None])[..., 0], -_ODDS, _ODDS)
        return 1.0 / (1.0 + np.exp(-odds)), weights

    @property
    def agile(self) -> tuple[float, float]:
        """Factor of the process noise that predicts best on average, and the standard deviation of its logarithm."""
        weights, values = np.exp(self.agility - self.agility.max()), np.log(FACTORS)
        weights /= weights.sum()
        mean = float(weights @ values)
        # within half a step nothing was tried
        return math.exp(mean), math.sqrt(float(weights @ (values - mean) ** 2) + (values[1] - values[0]) ** 2 / 12.0)

    def gained(self, noise: Array, agility: Array) -> Estimates:
        """Add evidence for the factors of noise (S,) and of the process noise (G,)."""
        evidence = self.evidence.copy()
        evidence[:, NOISE] += noise
        return self._replace(evidence=evidence, agility=self.agility + agility)

    @property
    def _variances(self) -> Array:
        """Factors in use, in the order of `factors`: predictions are used as they are."""
        return np.append(self.used[:, NOISE], 1.0)

    def weighed(self, matrix: Array, right: Array) -> Estimates:
        """Take in residuals by their normal equations, relative to the factors in use."""
        weights, noise = self.weights + matrix, self._variances
        factors = noise * np.linalg.solve(weights, self.weights @ (self.factors / noise) + right)
        return self._replace(weights=weights, factors=np.clip(factors, 1.0 / _LARGEST, _LARGEST))

    def heard(self, sensors: Sequence[Sensor], alarms: Array, turns: Array) -> Estimates:
        """Count measurements of no target in so many turns, (S,) each."""
        rates, evidence = self.found(sensors)[:, ALARMS], self.evidence.copy()
        evidence[:, ALARMS] += gain_of_rates(alarms, turns, rates, declared_values(sensors)[:, ALARMS])
        return self._replace(alarms=self.alarms + alarms, turns=self.turns + turns, evidence=evidence)

    def counted(self, sensors: Sequence[Sensor], ids: Array, dwells: Array, hits: Array, bands: Array) -> Estimates:
        """Count a scan's detections and misses of T confirmed tracks, by ascending ids; others are forgotten.

        `dwells` and `hits` (T, S) say which sensors could see each track, and detected it; `bands` (T, S) is the
        track's band of range from each.
        """
        rows, nobody = rows_of_ids(self.ids, ids), np.zeros((1, len(self.hits)))
        open_hits, open_dwells = (np.append(each, nobody, axis=0)[rows] for each in (self.open_hits, self.open_dwells))
        again = hits.any(axis=1)
        shape = self.hits.shape
        cell = (np.arange(shape[0]) * shape[1] + bands[again]).ravel()
        done_hits, done_dwells = (
            np.bincount(cell, counts[again].ravel(), shape[0] * shape[1]).reshape(shape)
            for counts in (open_hits, open_dwells)
        )
        open_hits[again] = open_dwells[again] = 0.0
        seen, evidence = self.found(sensors)[:, DETECTION], self.evidence.copy()
        P = declared_values(sensors)[:, DETECTION]
        evidence[:, DETECTION] += gain_of_shares(done_hits.sum(axis=1), done_dwells.sum(axis=1), seen, P)
        of_range = gain_of_shares(done_hits, done_dwells, self.by_range(seen)[0], seen[:, None])
        evidence[:, RANGES] += of_range.sum(axis=1)
        return self._replace(
            evidence=evidence, hits=self.hits + done_hits, dwells=self.dwells + done_dwells,
            ids=ids, open_hits=open_hits + hits, open_dwells=open_dwells + dwells,
        )  # fmt: skip

    def forgotten(self, turns: Array) -> Estimates:
        """The sums after a scan in which each sensor made so many turns, (S,)."""
        mean, S = float(turns.mean()), len(turns)
        kept, prior = KEEP**turns, (1.0 - KEEP**mean) * _LEFT * 0.5 * _RESIDUALS * np.eye(S + 1)
        fading = self._replace(weights=self.weights * KEEP**mean).weighed(prior, prior @ (1.0 / self._variances))
        return fading._replace(
            hits=self.hits * kept[:, None], dwells=self.dwells * kept[:, None],
            alarms=self.alarms * kept, turns=self.turns * kept,
            evidence=self.evidence * kept[:, None], agility=self.agility * KEEP**mean,
        )  # fmt: skip

    def settled(self, sensors: Sequence[Sensor]) -> Estimates:
        """The estimates with what is to be used from now on."""
        found, declared, before = self.found(sensors), declared_values(sensors), self.used
        # that too much noise, or too many false alarms, are declared does little harm; and false alarms are not even:
        # fewer on average may be more near some targets
        found[:, [NOISE, ALARMS]] = np.maximum(found[:, [NOISE, ALARMS]], declared[:, [NOISE, ALARMS]])
        chosen = np.where(trusted(self.evidence[:, :RANGES], before != declared), found, declared)
        used = np.where((chosen != declared) & ~_moved(_scales(chosen), _scales(before)), before, chosen)
        # all bands of a sensor, or none
        of_sensor = np.broadcast_to(used[:, DETECTION, None], self.bands.shape)
        differ = (self.bands != before[:, DETECTION, None]).any(axis=1)
        by_range = trusted(self.evidence[:, RANGES], differ) & [bool(reach(sensor)) for sensor in sensors]
        bands = of_sensor.copy()
        if by_range.any():
            seen = self.by_range(found[:, DETECTION])[0]
            still = differ & ~_moved(_odds(seen), _odds(self.bands)).any(axis=1)
            bands = np.where(by_range[:, None], np.where(still[:, None], self.bands, seen), of_sensor)
        if (used[:, NOISE] > before[:, NOISE]).any():
            # what looked like manoeuvres may have been noise
            return self._replace(used=used, bands=bands, manoeuvres=1.0, agility=np.zeros(len(FACTORS)))
        better = mean_evidence(self.agility[FACTORS != 1.0])
        best = float(FACTORS[np.argmax(self.agility)])
        agile = best if trusted(better, np.array(self.manoeuvres != 1.0)) else 1.0
        return self._replace(used=used, bands=bands, manoeuvres=agile)


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


def _moved(scales: Array, now: Array) -> Array:
    """Whether values are worth a change: each makes settings anew."""
    return np.asarray(np.abs(scales - now) > _STEP)
