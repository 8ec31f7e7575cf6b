"""The life of a track: when it is confirmed, and when it is deleted."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Literal, get_args

import numpy as np

from assoc._parameters import described, is_whole, positive
from assoc._types import Array
from assoc.costs.tracks.scores import sequential_threshold
from assoc.errors import InvalidInputError

Confirmation = Literal["score", "m-of-n"]
Deletion = Literal["time", "count", "score"]

HISTORY = 62
"""Scans whose detections are remembered, one a bit."""

# share of confirmed tracks that may be false while nobody knows how many there are in an hour, and at the most
_UNKNOWN, _MOST = 1e-6, 1e-2

OVERLOOKED = 1e-4
"""A track is deleted when an existing target would be missed for as long only with this probability."""
# and not before this many scans
_LEAST_SCANS = 3.0


@dataclass(frozen=True)
class LifeCycle:
    """When tracks are confirmed and deleted.

    Parameters
    ----------
    confirmation : "score" or "m-of-n"
        "score": the score reaches ln((1 - beta) / alpha), Sittler's and Blackman's use of Wald's test (S. Blackman, R.
        Popoli, Design and Analysis of Modern Tracking Systems, 1999, section 6.2). A score begins with the density of
        new targets over that of false alarms, so that it is the log odds of a target. alpha is `false_tracks_per_hour`
        over the new targets that are expected in an hour, at most 0.01: of false alarms so many tracks are confirmed
        in an hour on average, at the most (J. Ville, Étude critique de la notion de collectif, 1939).
        "m-of-n": detected in `m` of the last `n` scans.
    false_tracks_per_hour : float
        False tracks that may be confirmed in an hour. There are fewer, if false alarms are as declared.
    false_probability : float, optional
        alpha itself.
    missed_probability : float
        beta of the test, the share of true tracks deleted. A tentative track is deleted when its score has fallen by
        -ln(missed_probability) since its best.
    m, n : int
    deletion : "time", "count" or "score"
        What ends a track, tentative or confirmed: `deletion_time` seconds without a detection (however the
        measurements are grouped), `deletion_count` scans in a row without one, or a score fallen by `deletion_drop`.
    deletion_time : float, optional
        Seconds. Default: the time for which an existing target is missed without a break with probability 1e-4,
        at the usual pace of the scans, and at least three scans; outside of the region none if it is probably gone.
    deletion_count : int
    deletion_drop : float
    lifetime : float
        Mean time for which a target exists, seconds. It determines how fast `Track.existence` falls without
        detections. A track that is lost is deleted later, and is reported again if it is detected before.
    """

    confirmation: Confirmation = described("score", "what confirms a track")
    false_tracks_per_hour: float = described(1.0, "false tracks that may be confirmed in an hour")
    false_probability: float | None = described(
        None, "share of false tracks confirmed by score (default: from those per hour)"
    )
    missed_probability: float = described(2e-3, "share of true tracks given up too early")
    m: int = described(3, "m-of-n: scans with a detection")
    n: int = described(4, "m-of-n: of the last n scans")
    deletion: Deletion = described("time", "what ends a track")
    deletion_time: float | None = described(
        None, "seconds without a detection (default: from the pace of the scans and P_d)"
    )
    deletion_count: int = described(5, "scans in a row without a detection")
    deletion_drop: float = described(25.0, "fall of the score from its best")
    lifetime: float = described(600.0, "mean time for which a target stays, seconds")

    def __post_init__(self) -> None:
        if self.confirmation not in get_args(Confirmation):
            raise InvalidInputError(f"confirmation must be 'score' or 'm-of-n', got {self.confirmation!r}")
        if self.deletion not in get_args(Deletion):
            raise InvalidInputError(f"deletion must be 'time', 'count' or 'score', got {self.deletion!r}")
        for setting in fields(self):
            value = getattr(self, setting.name)
            if isinstance(setting.default, int):
                if not is_whole(value, 1):
                    raise InvalidInputError(f"{setting.name} must be a whole number above 0, got {value!r}")
            elif not isinstance(setting.default, str) and not (value is None and setting.default is None):
                positive(value, setting.name)
                if setting.name.endswith("probability") and value >= 1:
                    raise InvalidInputError(f"{setting.name} must be below 1, got {value!r}")
        if not self.m <= self.n <= HISTORY:
            raise InvalidInputError(f"m and n must be m <= n <= {HISTORY}, got {self.m} and {self.n}")

    def false_share(self, hourly: Array | float) -> Array:
        """Share of confirmed tracks that may be false, with so many new targets in an hour (inf: not known)."""
        hourly = np.asarray(hourly, dtype=np.float64)
        if self.false_probability is not None:
            return np.full(hourly.shape, self.false_probability)
        share = np.minimum(_MOST, self.false_tracks_per_hour / np.maximum(hourly, 1e-300))
        return np.where(np.isinf(hourly), _UNKNOWN, share)

    def confirms(self, score: Array, detections: Array, hourly: Array | float) -> Array:
        """Which tracks are to be confirmed.

        `detections` has one bit for each scan, the last scan lowest; `hourly` are the new targets in an hour, of all
        or for each track.
        """
        if self.confirmation == "score":
            reached: Array = score >= sequential_threshold(self.false_share(hourly), self.missed_probability)
            return reached
        window = (detections & np.int64((1 << self.n) - 1)).astype(np.uint64)
        return np.asarray(count_bits(window) >= self.m)

    def patience(self, miss: Array, pace: float) -> Array:
        """Seconds without a detection, in view, after which tracks are deleted, (T,).

        Parameters
        ----------
        miss : array (T, S)
            Score of a miss of each track by each sensor.
        pace : float
            Usual seconds from scan to scan; 0 while it is not known.
        """
        if self.deletion_time is not None:
            return np.full(len(miss), self.deletion_time)
        if pace == 0:
            return np.full(len(miss), math.inf)
        # nobody's miss has no end
        together = np.minimum(miss.sum(axis=1), -1e-12)
        return np.asarray(np.maximum(_LEAST_SCANS, math.log(OVERLOOKED) / together) * pace)

    def deletes(
        self, confirmed: Array, score: Array, best: Array, silent: Array, missed: Array, patience: Array
    ) -> Array:
        """Which tracks are to be deleted.

        Parameters
        ----------
        confirmed : bool array (T,)
        score, best : arrays (T,)
            The score now and its largest value so far.
        silent : array (T,)
            Seconds since the last detection, those out of view of all sensors left out.
        missed : int array (T,)
            Scans in a row without a detection.
        patience : array (T,)
            Seconds; see `patience`.
        """
        if self.deletion == "time":
            gone = silent > patience * (1 + 1e-9)
        elif self.deletion == "count":
            gone = missed >= self.deletion_count
        else:
            gone = best - score > self.deletion_drop
        tentative: Array = ~confirmed & (best - score > -math.log(self.missed_probability))
        return np.asarray(gone | tentative)


def count_bits(values: Array) -> Array:
    """Number of set bits of each element of a uint64 array."""
    return np.unpackbits(values[:, None].view(np.uint8), axis=1).sum(axis=1)
