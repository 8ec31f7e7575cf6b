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

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from assoc._types import Array
from assoc.costs.tracks.tuples import gate_of
from assoc.filters.base import predict_each
from assoc.scene.scan import Scan
from assoc.tracking.adapting.in_use import in_use
from assoc.tracking.births.nursery import current
from assoc.tracking.state import TrackerState
from assoc.tracking.track import Step
from assoc.tracking.tracker import Tracker

_KEEP = 0.95
"""Share of a sum that is kept from scan to scan with a detection."""
_ALARM = 3.0
"""A track is inconsistent when its NIS is so many standard deviations above its mean."""


@dataclass
class TrackQuality:
    """One track so far.

    Attributes
    ----------
    hits : int64 array (S,)
        Measurements of each sensor that were the track's, by the decisions at the time.
    """

    hits: Array
    _squares: float = 0.0
    _freedom: float = 0.0
    _variance: float = 0.0

    def take(self, square: float, freedom: float) -> None:
        """Take in a scan's mean NIS and number of components over the sensors, whose predictions err together."""
        self._squares = _KEEP * self._squares + square
        self._freedom = _KEEP * self._freedom + freedom
        self._variance = _KEEP**2 * self._variance + 2.0 * freedom

    @property
    def nis(self) -> float:
        """Mean NIS by components, at most 1 if all is as declared; NaN before the second detection."""
        return self._squares / self._freedom if self._freedom else math.nan

    @property
    def consistent(self) -> bool:
        """Whether the NIS is not far above its mean."""
        return self._squares - self._freedom <= _ALARM * math.sqrt(self._variance)


class Qualities:
    """Quality of all tracks of a tracker; `after` follows each of its steps.

    Parameters
    ----------
    sensors : int
        How many the tracker has.
    """

    def __init__(self, sensors: int) -> None:
        self._sensors = sensors
        self._of: dict[int, TrackQuality] = {}

    def of_track(self, track_id: int) -> TrackQuality:
        """Quality of a track, also of one that has ended."""
        found = self._of.get(track_id)
        if found is None:
            found = self._of[track_id] = TrackQuality(np.zeros(self._sensors, np.int64))
        return found

    def keep(self, track_ids: Iterable[int]) -> None:
        """Forget all tracks but these."""
        self._of = {number: self._of[number] for number in track_ids if number in self._of}

    def count(self, assigned: Sequence[Array]) -> None:
        """Count measurements of each sensor by their tracks; 0 is none."""
        for s, ids in enumerate(assigned):
            for number in ids[ids > 0].tolist():
                self.of_track(number).hits[s] += 1

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
        if tracker.registration is not None:
            scan = Scan(scan.index, scan.time, tuple(tracker.registration.correct(scan.measurements)))
        settings = tracker.settings.at(step.time)
        if before.estimates is not None:
            settings = in_use(settings, before.estimates)
        known = current(settings, before)
        names = names or {}
        row_of = {names.get(number, number): row for row, number in enumerate(known.track_id.tolist())}
        found: dict[int, list[tuple[float, int]]] = {}
        stamps = scan.own_times()
        for s, (z, ids, sensor) in enumerate(zip(scan.measurements, step.assigned, settings.sensors, strict=True)):
            fit = [(m, i, row_of[i]) for m, i in enumerate(ids.tolist()) if i in row_of]
            # from a platform that moved since the scan began: the prediction would be seen from elsewhere
            if not fit or before.time is None or (scan.paths and scan.paths[s] is not None):
                continue
            number, rows = np.array([m for m, _, _ in fit]), np.array([row for _, _, row in fit])
            states = predict_each(settings.filter, known.states[rows], stamps[s][number] - before.time)
            expected = settings.filter.expected(states, sensor)
            off = sensor.residual(z[number], expected.mean)
            square = (off * np.linalg.solve(expected.covariance, off[:, :, None])[:, :, 0]).sum(axis=1)
            # beyond the gate it was another branch that took the measurement, with another past
            gate = gate_of(sensor, settings.gate_probability)
            for (_, i, _), value in zip(fit, square.tolist(), strict=True):
                if value <= gate:
                    found.setdefault(i, []).append((value, sensor.dim))
        for i, values in found.items():
            squares, freedoms = zip(*values, strict=True)
            self.of_track(i).take(sum(squares) / len(values), sum(freedoms) / len(values))
