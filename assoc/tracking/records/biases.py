"""Biases of sensors and of their clocks, by what they measure of tracks that several of them see.

Normal equations of the biases are summed and forgotten, fast and slowly: a bias may drift. Each memory estimates biases
alone, and clocks with them; what predicts better than no bias is used (`assoc.tracking.records.prequential`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from assoc._types import Array
from assoc.registration.parameters import RegistrationParameters
from assoc.sensors import Sensor
from assoc.tracking.records.estimates import KEEP
from assoc.tracking.records.prequential import mean_evidence, trusted

CLOCK = "time"
# what is kept from scan to scan, by each memory
_KEPT = np.array([0.9, KEEP])
# what is surely 0 has this many times the information of its prior
_SURE = 1e9


class Biases(NamedTuple):
    """Sums over K biases: of each sensor its components, then its clock."""

    information: Array
    """Of each memory, (2, K, K)."""
    vector: Array
    """(2, K)."""
    evidence: Array
    """Logarithm of how much better each memory predicts than no bias, without clocks and with them, (2, 2)."""
    used: Array
    """Biases in use, metres, radians and seconds, (K,)."""

    @staticmethod
    def none(sensors: Sequence[Sensor]) -> Biases:
        """No bias."""
        K = len(names_of(sensors))
        return Biases(np.zeros((2, K, K)), np.zeros((2, K)), np.zeros((2, 2)), np.zeros(K))

    def after(self, sensors: Sequence[Sensor], information: Array, vector: Array) -> Biases:
        """The biases after a scan's normal equations (K, K) and (K,) around those in use."""
        vector = vector + information @ self.used
        found = self._estimates(sensors)
        gain = found @ vector - 0.5 * np.einsum("mci,ij,mcj->mc", found, information, found)
        kept = _KEPT[:, None]
        after = Biases(
            self.information * kept[..., None] + information, self.vector * kept + vector,
            KEEP * self.evidence + gain, self.used,
        )  # fmt: skip
        best = np.unravel_index(int(np.argmax(after.evidence)), after.evidence.shape)
        sure = trusted(mean_evidence(after.evidence.ravel()), np.array(self.used.any()))
        return after._replace(used=after._estimates(sensors)[best] if sure else np.zeros_like(self.used))

    def _estimates(self, sensors: Sequence[Sensor]) -> Array:
        """Biases of each memory, without clocks and with them, (2, 2, K)."""
        parameters, names = RegistrationParameters(), [name for _, name in names_of(sensors)]
        prior = np.array([parameters.spread(name) for name in names]) ** -2.0
        clocks = np.array([name == CLOCK for name in names])
        priors = np.stack([np.diag(np.where(clocks, _SURE * prior, prior)), np.diag(prior)])
        return np.linalg.solve(self.information[:, None] + priors, np.repeat(self.vector[:, None], 2, 1)[..., None])[
            ..., 0
        ]

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
