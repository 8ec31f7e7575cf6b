"""Pairs of confirmed tracks that may be too close for a sensor, and what each sensor's resolution is.

Of a sensor whose resolution nobody said, a grid of resolutions is weighed against "unlimited" by how well each predicts
the plots of pairs that are known to be two (`assoc.tracking.stages.unresolved`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from assoc._types import Array
from assoc.costs.tracks.unresolved import GRID
from assoc.scene.scan import Scan
from assoc.tracking.records.track import rows_of_ids

SURE = 3
"""Scans in which one sensor detected both of a pair, each by a plot of its own, after which they are taken for two."""

# odds against any limit before anything was seen
_PRIOR = np.append(0.0, np.full(len(GRID) - 1, -5.0 - np.log(len(GRID) - 1)))
# what the plots of a pair in one scan say at most: nobody's model is exact
_MOST = 3.0


class Unresolved(NamedTuple):
    """K pairs of confirmed tracks within reach of the resolution of some of S sensors."""

    ids: Array
    """The older track, then the younger, int64 (K, 2)."""
    apart: Array
    """Scans in which one sensor detected both, at most `SURE`, int64 (K,)."""
    confirmed: Array
    """Ids of all confirmed tracks, ascending, int64 (T,)."""
    evidence: Array
    """Log likelihood of each resolution in `assoc.costs.tracks.unresolved.resolutions`, (S, G)."""

    @staticmethod
    def none(sensors: int) -> Unresolved:
        """No pair, nothing learnt."""
        nothing = np.zeros(0, dtype=np.int64)
        return Unresolved(nothing.reshape(0, 2), nothing, nothing, np.zeros((sensors, len(GRID))))

    def weights(self, s: int) -> Array:
        """Probability of each resolution of sensor s, (G,)."""
        found = np.exp(self.evidence[s] + _PRIOR - (self.evidence[s] + _PRIOR).max())
        return np.asarray(found / found.sum())

    def learnt(self, s: int, unresolved: Array, one: Array, two: Array) -> Unresolved:
        """Weigh the plots of N pairs, whose logarithmic likelihoods are `one` if unresolved, `two` if not, (N,).

        `unresolved` (N, G) are the probabilities by each resolution; the first says never.
        """
        ratio = np.clip(one - two, -_MOST, _MOST)[:, None]
        evidence = self.evidence.copy()
        evidence[s] += np.logaddexp(np.log1p(-unresolved), np.log(np.maximum(unresolved, 1e-300)) + ratio).sum(axis=0)
        return self._replace(evidence=evidence)


class Shared(NamedTuple):
    """K pairs of tracks that may be unresolved in this scan."""

    ids: Array
    """int64 (K, 2)."""
    probability: Array
    """With which each sensor did not resolve them, 1 where it was decided so, (K, S)."""
    plots: tuple[tuple[int, int], ...] = ()
    """Sensor and measurement (from 0) of the plots that count twice."""
    wider: tuple[Array, Array] = (np.zeros(0), np.zeros(0))
    """Ids of tracks with such plots (L,), and by what covariances are larger than after own ones (L, n, n)."""
    measured: Scan | None = None
    """The scan in which they count once."""

    def hidden(self, ids: Array) -> Array:
        """Whether tracks with ascending `ids` (T,) have probably no plot of their own of each sensor, bool (T, S)."""
        found = np.zeros((len(ids) + 1, self.probability.shape[1]), dtype=np.bool_)
        for side in self.ids.T:
            np.logical_or.at(found, rows_of_ids(ids, side), self.probability > 0.5)
        return found[:-1]

    def of(self, first: Array, second: Array) -> Array:
        """The probability of pairs of ids (L,), (L,), in any order; (L, S)."""
        known = {frozenset(pair): row for pair, row in zip(self.ids.tolist(), self.probability, strict=True)}
        nothing = np.zeros(self.probability.shape[1])
        pairs = zip(first.tolist(), second.tolist(), strict=True)
        return np.array([known.get(frozenset(pair), nothing) for pair in pairs]).reshape(-1, len(nothing))
