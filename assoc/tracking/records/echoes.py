"""Tracks that may be echoes of other tracks, and how their detections weigh "an echo" against "a target".

A radar sees a target again by a detour, farther at the same azimuth (multipath), or by a side lobe of its antenna, at
the same range in another direction. Echoes move like targets and are confirmed like targets. But they are detected
only with the target, at its range or azimuth within the noise, and more seldom than a target would be.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import betaln

from assoc._types import Array

RANGE, AZIMUTH = 0, 1
"""Component that a plot shares with that of its target: range in side lobes, azimuth in multipath."""
HITS, MISSES, STRAYS, SQUARE, CHANCE, FRESH = range(6)
"""Columns of the counts of a pair."""

# share of echoes that are detected: beta distribution; so many looks tell a target's from the sensor's P_d
_ECHO, _LOOKS = (1.0, 1.0), 60.0
# an echo seems to be detected by itself so often: the target's plot was missed, or went to another track
_STRAY = 0.1
# share of targets that keep the range or the azimuth of a certain other one
_STATION = 0.003
# before any was seen: echoes, and targets
_BEFORE = (0.02, 20.0)
# standard deviations by which more must be seen than chance brings
_SURELY = 2.0


class Echoes(NamedTuple):
    """K pairs of tracks."""

    ids: Array
    """The track that may be an echo, and that of the target, int64 (K, 2)."""
    kinds: Array
    """Sensor, and `RANGE` or `AZIMUTH`, int64 (K, 2)."""
    counts: Array
    """Of the sensor's dwells with a plot of the target: hits, misses; detections without one; squared distance in the
    shared component in variances, summed over the hits; how often a target would be there by chance, relative to an
    echo; detections of the first if the pair was formed when it was new, else 0; (K, 6)."""
    hidden: Array
    """Ids of tracks that are echoes rather than targets, ascending, int64 (H,)."""
    short: Array
    """Tracks that began as echoes would and ended without being shown, by sensor and kind, (S, 2)."""
    expected: Array
    """How many of them chance brings, (S, 2)."""
    targets: float
    """Tracks that were shown."""
    found: Array
    """Tracks that were hidden so far, by sensor and kind, (S, 2)."""

    @staticmethod
    def none(sensors: int) -> Echoes:
        """No pair."""
        ids, nothing = np.zeros((0, 2), dtype=np.int64), np.zeros((sensors, 2))
        return Echoes(ids, ids, np.zeros((0, 6)), ids[:, 0], nothing, nothing, 0.0, nothing)

    def of(self, rows: Array) -> Echoes:
        """Select pairs."""
        return self._replace(ids=self.ids[rows], kinds=self.kinds[rows], counts=self.counts[rows])

    def renamed(self, ids: Array, names: Array) -> Echoes:
        """The pairs with these names (K,) in place of ids (K,)."""
        now = self.ids.copy()
        for i, name in zip(ids.tolist(), names.tolist(), strict=True):
            now[self.ids == i] = name
        return self._replace(ids=now)

    @property
    def seen(self) -> Array:
        """Short tracks of echoes beyond what chance brings, (S, 2)."""
        beyond = self.short - self.expected - _SURELY * np.sqrt(self.expected)
        # a single one may be chance in one of many sensors
        return np.where(self.short > 1.0, np.maximum(beyond, 0.0), 0.0)

    def log_odds(self, detection_probability: Array) -> Array:
        """Log odds of an echo against a target of its own, which the sensor detects with this probability (K,)."""
        hits, misses, strays, square, chance, _ = self.counts.T
        P = np.clip(detection_probability, 0.05, 0.95)
        echo = betaln(_ECHO[0] + hits, _ECHO[1] + misses) - betaln(*_ECHO)
        target = betaln(_LOOKS * P + hits, _LOOKS * (1.0 - P) + misses) - betaln(_LOOKS * P, _LOOKS * (1.0 - P))
        # one that was hidden may have been a target
        known = (self.seen + np.maximum(self.found - 1.0, 0.0))[tuple(self.kinds.T)]
        prior = np.log((_BEFORE[0] + known) / (_BEFORE[1] + self.targets))
        # a target that is there by chance stays the more seldom the longer; one that keeps station does as an echo does
        tied = -np.log(_STATION + chance / np.maximum(hits, 1.0)) - 0.5 * np.maximum(square - hits, 0.0)
        return np.asarray(prior + tied + echo - target + strays * np.log(_STRAY))
