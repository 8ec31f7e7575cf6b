"""Find tracks of bearings alone that are ghosts: some sensor that should detect them never does.

A track can follow the crossing of two targets' bearings for long: its detections are real, and its score against false
alarms grows, though a third sensor never detects anything there. So each sensor is tested by itself: it misses a target
in its view n times in a row with probability (1 - P_D)^n.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from assoc._types import Array
from assoc.tracking.records.life_cycle import OVERLOOKED
from assoc.tracking.records.track import rows_of_ids


class Unseen(NamedTuple):
    """Misses in a row of each track by each sensor."""

    ids: Array
    """Ids of the tracks, ascending, int64 (T,)."""
    misses: Array
    """(T, S); a detection with probability p multiplies the count by 1 - p."""

    @staticmethod
    def none(sensors: int) -> Unseen:
        """No track."""
        return Unseen(np.zeros(0, dtype=np.int64), np.zeros((0, sensors)))

    def after(self, ids: Array, detected: Array, covered: Array) -> Unseen:
        """The state after a scan, of the living tracks' ids (T,); others are forgotten.

        `detected` (T, S) is the probability with which each sensor has detected each track, `covered` (T, S) whether a
        dwell of it covered the track.
        """
        order = np.argsort(ids)
        known = np.append(self.misses, np.zeros((1, self.misses.shape[1])), axis=0)
        before = known[rows_of_ids(self.ids, ids)]
        misses = np.where(covered, (before + 1.0) * (1.0 - detected), before)
        return Unseen(ids[order], misses[order])

    def ghosts(self, miss: Array) -> Array:
        """Ids of the ghosts; `miss` is ln(1 - P_D) of each sensor, (S,)."""
        return self.ids[(self.misses * miss < math.log(OVERLOOKED)).any(axis=1)]
