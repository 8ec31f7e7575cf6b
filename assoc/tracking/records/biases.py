"""Biases of sensors and of their clocks, by what they measure of tracks that several of them see.

Normal equations of the biases, and of what they change by from scan to scan, are summed and forgotten, fast and slowly.
Each memory estimates biases alone, and clocks with them, that stay or drift; what predicts better than no bias is used
(`assoc.tracking.records.prequential`). A drift is damped, so that it does not go on without measurements (E. S.
Gardner and E. McKenzie, Forecasting trends in time series, Management Science 31, 1985).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from assoc._types import Array
from assoc.registration.parameters import RegistrationParameters
from assoc.sensors import Sensor
from assoc.tracking.records.estimates import KEEP
from assoc.tracking.records.prequential import NEEDED, mean_evidence, trusted

CLOCK = "time"
# what is kept from scan to scan, by each memory
_KEPT = np.array([0.9, KEEP])
# what is surely 0 has this many times the information of its prior
_SURE = 1e9
# a drift is as large as biases are in so many scans, and this much of it is left from scan to scan
_DRIFT, _DAMPED = 50.0, KEEP


class Biases(NamedTuple):
    """Sums over K biases: of each sensor its components, then its clock."""

    information: Array
    """Of each memory, of biases and of their changes in a scan, (2, 2K, 2K)."""
    vector: Array
    """(2, 2K)."""
    evidence: Array
    """Logarithm of how much better each memory predicts than no bias: biases, clocks too; the same drifting; (2, 4)."""
    used: Array
    """Biases in use, metres, radians and seconds, (K,)."""

    @staticmethod
    def none(sensors: Sequence[Sensor]) -> Biases:
        """No bias."""
        K = len(names_of(sensors))
        return Biases(np.zeros((2, 2 * K, 2 * K)), np.zeros((2, 2 * K)), np.zeros((2, 4)), np.zeros(K))

    def after(self, sensors: Sequence[Sensor], information: Array, vector: Array) -> Biases:
        """The biases after a scan's normal equations (K, K) and (K,) around those in use."""
        K, vector = len(vector), vector + information @ self.used
        found = self._expected(sensors)
        gain = found @ vector - 0.5 * np.einsum("mci,ij,mcj->mc", found, information, found)
        # those before, by those now: biases had not changed yet
        before = np.block([[np.eye(K), -np.eye(K)], [np.zeros((K, K)), np.eye(K) / _DAMPED]])
        informations = _KEPT[:, None, None] * (before.T @ self.information @ before)
        vectors = _KEPT[:, None] * (self.vector @ before)
        informations[:, :K, :K] += information
        vectors[:, :K] += vector
        after = Biases(informations, vectors, KEEP * self.evidence + gain, self.used)
        # a drift must show: beside biases that stay it is what is not declared
        shown = after.evidence - [0.0, 0.0, NEEDED, NEEDED]
        best = np.unravel_index(int(np.argmax(shown)), shown.shape)
        sure = trusted(mean_evidence(after.evidence.ravel()), np.array(self.used.any()))
        return after._replace(used=after._expected(sensors)[best] if sure else np.zeros_like(self.used))

    def _expected(self, sensors: Sequence[Sensor]) -> Array:
        """Biases of the next scan, of each memory as `evidence` has them, (2, 4, K)."""
        parameters, names = RegistrationParameters(), [name for _, name in names_of(sensors)]
        spread, K = np.array([parameters.spread(name) for name in names]), len(names)
        prior = np.concatenate([spread, spread / _DRIFT]) ** -2.0
        clocks, drifts = np.tile([name == CLOCK for name in names], 2), np.arange(2 * K) >= K
        fixed = np.stack([clocks | drifts, drifts, clocks, np.zeros(2 * K, dtype=np.bool_)])
        priors = np.where(fixed, _SURE * prior, prior)[:, None] * np.eye(2 * K)
        found = np.linalg.solve(self.information[:, None] + priors, self.vector[:, None, :, None])[..., 0]
        return found[..., :K] + _DAMPED * found[..., K:]

    def of(self, sensors: Sequence[Sensor]) -> list[dict[str, float]]:
        """Those in use by names of components, for each sensor; clocks against most of them."""
        found: list[dict[str, float]] = [{} for _ in sensors]
        for (s, name), value in zip(names_of(sensors), self.used.tolist(), strict=True):
            found[s][name] = value
        middle = float(np.median([own[CLOCK] for own in found]))
        return [own | {CLOCK: own[CLOCK] - middle} for own in found]


def names_of(sensors: Sequence[Sensor]) -> list[tuple[int, str]]:
    """Sensor and component of each bias."""
    parts = [sensor.position_part for sensor in sensors]
    return [(s, name) for s, part in enumerate(parts) for name in (*part.components[: part.dim], CLOCK)]
