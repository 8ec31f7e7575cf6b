"""How well tracks agree with their measurements, and which sensors feed them, beside a tracker.

The normalised innovation squared (NIS) of a measurement is v' S^-1 v, with v its distance from the prediction and S the
covariance that filter and sensor give it: its mean is the number of components d. A track's figure is a mean of NIS / d
that forgets by half every fourteen scans: 1 at most if all is as declared (filters that expect manoeuvres have 0.6 in
quiet flight), above if sensors err more than they say, the target manoeuvres more than the filter expects, or the track
takes what is not its own.

References
----------
Y. Bar-Shalom, X. R. Li, T. Kirubarajan, Estimation with Applications to Tracking and Navigation, 5.4.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from assoc._types import Array
from assoc.costs.tracks.tuples import gate_of
from assoc.filters.base import predict_each
from assoc.scene.scan import Scan
from assoc.tracking.adapting.in_use import in_use
from assoc.tracking.records.track import Step
from assoc.tracking.stages.starter import current
from assoc.tracking.state import TrackerState
from assoc.tracking.tracker import Tracker

_KEEP = 0.95
"""Share of a sum that is kept from scan to scan with a detection."""
_ALARM = 3.0
"""A track is inconsistent when its NIS is so many standard deviations above its mean."""


class TrackQuality(NamedTuple):
    """One track so far.

    Attributes
    ----------
    nis : float
        Mean NIS by components, at most 1 if all is as declared; NaN before the second detection.
    consistent : bool
        Whether the NIS is not far above its mean.
    hits : tuple of S int
        Measurements of each sensor that were the track's, by the decisions at the time.
    """

    nis: float
    consistent: bool
    hits: tuple[int, ...]


class Qualities:
    """Quality of all tracks of a tracker; `after` follows each of its steps.

    Parameters
    ----------
    sensors : int
        How many the tracker has.
    """

    def __init__(self, sensors: int) -> None:
        self._ids = np.zeros(0, dtype=np.int64)
        """Ascending."""
        self._hits = np.zeros((0, sensors), dtype=np.int64)
        # fading sums of a scan's mean NIS, its number of components, and the variance of the first
        self._sums = np.zeros((0, 3))

    def of(self, ids: Array) -> tuple[Array, Array, Array]:
        """NIS (n,), whether consistent (n,), and hits (n, S) of tracks (n,); see `TrackQuality`."""
        rows = self._rows(ids)
        squares, freedom, variance = self._sums[rows].T
        with np.errstate(invalid="ignore"):
            nis = np.where(freedom > 0.0, squares, np.nan) / freedom
        return nis, squares - freedom <= _ALARM * np.sqrt(variance), self._hits[rows]

    def of_track(self, track_id: int) -> TrackQuality:
        """Quality of a track, also of one that has ended."""
        nis, consistent, hits = self.of(np.array([track_id]))
        return TrackQuality(float(nis[0]), bool(consistent[0]), tuple(hits[0].tolist()))

    def _rows(self, ids: Array) -> Array:
        """Rows of tracks (n,), which need not be known."""
        rows = np.searchsorted(self._ids, ids)
        if len(ids) and not (np.append(self._ids, -1)[rows] == ids).all():
            known = np.union1d(self._ids, ids)
            before = np.searchsorted(known, self._ids)
            hits, sums = np.zeros((len(known), self._hits.shape[1]), np.int64), np.zeros((len(known), 3))
            hits[before], sums[before] = self._hits, self._sums
            self._ids, self._hits, self._sums = known, hits, sums
            rows = np.searchsorted(known, ids)
        return np.asarray(rows)

    def keep(self, track_ids: Iterable[int]) -> None:
        """Forget all tracks but these."""
        rows = np.isin(self._ids, np.array([*track_ids], dtype=np.int64))
        self._ids, self._hits, self._sums = self._ids[rows], self._hits[rows], self._sums[rows]

    def count(self, assigned: Sequence[Array]) -> None:
        """Count measurements of each sensor by their tracks; 0 is none."""
        for s, ids in enumerate(assigned):
            rows = self._rows(ids[ids > 0])
            self._hits[:, s] += np.bincount(rows, minlength=len(self._ids))

    def _take(self, ids: Array, squares: Array, dims: Array) -> None:
        """Take in a scan: NIS and components of measurements (n,) of tracks (n,); those of one err together."""
        rows, of, counts = np.unique(self._rows(ids), return_inverse=True, return_counts=True)
        square, freedom = (np.bincount(of, weights=values) / counts for values in (squares, dims))
        self._sums[rows] *= _KEEP, _KEEP, _KEEP**2
        self._sums[rows] += np.stack([square, freedom, 2.0 * freedom], axis=1)

    def after(
        self,
        tracker: Tracker,
        before: TrackerState,
        step: Step,
        measurements: Sequence[Array],
        times: Sequence[Array] | None = None,
    ) -> None:
        """Take in a step; see `compare`."""
        self.count(step.assigned)
        self.compare(tracker, before, step, measurements, times)

    def compare(
        self,
        tracker: Tracker,
        before: TrackerState,
        step: Step,
        measurements: Sequence[Array],
        times: Sequence[Array] | None = None,
        names: Mapping[int, int] | None = None,
    ) -> None:
        """Compare a step's measurements with the predictions of their tracks.

        Parameters
        ----------
        tracker : Tracker
            After the step.
        before : TrackerState
            Its state before the step.
        step : Step
        measurements, times
            As they were given to the step.
        names : mapping of int to int, optional
            From the tracker's ids to those of the step.
        """
        scan = Scan(step.scan, step.time, tuple(measurements), times=None if times is None else tuple(times))
        scan = scan.aligned(tracker.sensors)
        settings = tracker.settings.at(step.time)
        if before.estimates is not None:
            settings = in_use(settings, before.estimates)
        known = current(settings, before)
        # those that were renamed under their ids in the step
        named = known.track_id.copy()
        for track_id, name in (names or {}).items():
            named[known.track_id == track_id] = name
        order = np.argsort(named, kind="stable")
        in_order = np.append(named[order], -1)
        found: list[tuple[Array, Array, Array]] = []
        if before.time is None:
            return
        taken = []
        for s, ids in enumerate(step.assigned):
            # of two under one id the last; -1 stands before the first
            index = np.searchsorted(in_order[:-1], ids, side="right") - 1
            number = np.flatnonzero(in_order[index] == ids)
            # from a platform that moved since the scan began: the prediction would be seen from elsewhere
            number = number[: 0 if scan.paths and scan.paths[s] is not None else None]
            taken.append((number, order[index[number]]))
        ends = np.cumsum([0, *(len(number) for number, _ in taken)])
        lags = np.concatenate([own[number] for own, (number, _) in zip(scan.own_times(), taken, strict=True)])
        rows = np.concatenate([row for _, row in taken])
        # of all sensors together: most of the time of a small scene goes into calls
        states = predict_each(settings.filter, known.states[rows], lags - before.time) if len(rows) else known.states
        for s, (sensor, (number, _)) in enumerate(zip(settings.sensors, taken, strict=True)):
            if not len(number):
                continue
            expected = settings.filter.expected(states[ends[s] : ends[s + 1]], sensor)
            off = sensor.residual(scan.measurements[s][number], expected.mean)
            square = (off * np.linalg.solve(expected.covariance, off[:, :, None])[:, :, 0]).sum(axis=1)
            # beyond the gate it was another branch that took the measurement, with another past
            inside = square <= gate_of(sensor, settings.gate_probability)
            ids = step.assigned[s][number[inside]]
            found.append((ids, square[inside], np.full(len(ids), float(sensor.dim))))
        if found:
            self._take(*(np.concatenate(column) for column in zip(*found, strict=True)))
