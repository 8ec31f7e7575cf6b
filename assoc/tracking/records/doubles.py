"""Pairs of tracks that may have one target, and how their measurements weigh "one target" against "two"."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.special import betaln

from assoc._types import Array

# a declared detection probability counts as much as this many dwells; sums take it to lie between the two bounds
_LOOKS, _LEAST, _MOST = 5.0, 0.05, 0.95


class Doubles(NamedTuple):
    """K pairs of tracks that may have one target."""

    ids: Array
    """The older track, then the younger, int64 (K, 2)."""
    counts: Array
    """Dwells of each sensor that fed the older one, the younger one, none; (K, S, 3)."""

    @staticmethod
    def none(sensors: int) -> Doubles:
        """No pair."""
        return Doubles(np.zeros((0, 2), dtype=np.int64), np.zeros((0, sensors, 3)))

    def of(self, ids: Array) -> Doubles:
        """These pairs (L, 2), with their counts so far."""
        row = {pair: k for k, pair in enumerate(map(tuple, self.ids.tolist()))}
        nothing = np.zeros(self.counts.shape[1:])
        counts = [self.counts[row[pair]] if pair in row else nothing for pair in map(tuple, ids.tolist())]
        return Doubles(ids, np.stack(counts))

    def one_target(self, detection_probability: Array) -> Array:
        """Log likelihood ratio of one target against two, (K,); minus infinity while one of them was never fed."""
        P = np.clip(detection_probability, _LEAST, _MOST)
        once, never = self.counts[..., 0] + self.counts[..., 1], self.counts[..., 2]
        hit, missed = _LOOKS * P + once, _LOOKS * (1.0 - P) + never
        ratio = betaln(hit, missed) - betaln(hit, missed + once + never) - once * math.log(2.0)
        fed = (self.counts[..., :2].sum(axis=1) > 0.5).all(axis=1)
        return np.where(fed, ratio.sum(axis=1), -np.inf)
