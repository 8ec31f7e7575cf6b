"""Which tracks of bearings alone are ghosts: a sensor that should see them does not, time after time.

Where bearings of two targets cross, a track can feed on them for long: each of its detections is real, and its score
grows, though a third sensor never sees anything there. Against false alarms that is a target; against the two targets
whose bearings these are it is none. So it is judged by each sensor alone: one that sees a target misses it n times in
a row with probability (1 - P_D)^n.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from assoc._types import Array
from assoc.tracking.life_cycle import OVERLOOKED


class Unseen(NamedTuple):
    """How often in a row each sensor has missed each track."""

    ids: Array
    """Tracks, ascending, int64 (T,)."""
    misses: Array
    """(T, S); a measurement that is a track's only by some probability ends a row as far as that."""

    @staticmethod
    def none(sensors: int) -> Unseen:
        """No track."""
        return Unseen(np.zeros(0, dtype=np.int64), np.zeros((0, sensors)))

    def after(self, ids: Array, detected: Array, looked: Array) -> Unseen:
        """The state after a scan.

        Parameters
        ----------
        ids : int64 array (T,)
            The tracks that live; others are forgotten.
        detected : array (T, S)
            Probability with which each sensor has detected each.
        looked : bool array (T, S)
            Whether it could.
        """
        order = np.argsort(ids)
        known = np.append(self.misses, np.zeros((1, self.misses.shape[1])), axis=0)
        rows = np.searchsorted(self.ids, ids)
        same = np.append(self.ids, -1)[rows] == ids
        before = known[np.where(same, rows, len(self.ids))]
        misses = np.where(looked, (before + 1.0) * (1.0 - detected), before)
        return Unseen(ids[order], misses[order])

    def ghosts(self, miss: Array) -> Array:
        """Ids of the tracks that are no targets, by ln(1 - P_D) of each sensor (S,)."""
        return self.ids[(self.misses * miss < math.log(OVERLOOKED)).any(axis=1)]
