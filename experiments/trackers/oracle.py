"""A tracker that is told which measurement is whose: what no tracker with the same filter can beat by association."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from assoc._types import Array
from assoc.costs.tracks.own_times import TimedScan
from assoc.scene import Scene
from assoc.scene.scan import Scan
from assoc.tracking import Step
from assoc.tracking.filter_choice import manoeuvre_noise, pace_of, two_speeds
from assoc.tracking.single_scan.base import ScanOutcome, SingleScanTracker


class OracleTracker(SingleScanTracker):
    """Tracks by the sources of the measurements, with the filter and the life of tracks of any other tracker.

    scene: With truth.
    **options: As for `Tracker`.
    """

    name = "oracle"

    def __init__(self, scene: Scene, **options: Any) -> None:
        noise = manoeuvre_noise(pace_of(scene.times))
        super().__init__(scene.sensors, **{"filter": two_speeds(noise), "region": scene.region} | options)
        assert scene.truth is not None and scene.truth.sources is not None
        self._sources = scene.truth.sources
        self._target_of: dict[int, int] = {}

    def step(
        self,
        time: float,
        measurements: Sequence[Array],
        times: Sequence[Array] | None = None,
        sectors: Array | None = None,
    ) -> Step:
        """Take one scan in; see `Tracker.step`."""
        sources = self._sources[self._scan]
        step = super().step(time, measurements, times, sectors)
        for source, ids in zip(sources, step.assigned, strict=True):
            self._target_of |= {i: t for i, t in zip(ids.tolist(), source.tolist(), strict=True) if i}
        return step

    def _true_rows(self, scan: Scan) -> tuple[Array, Array]:
        """Measurements of each track, and of the targets without one."""
        sources = self._sources[scan.index]
        known = [self._target_of[i] for i in self._batch.track_id.tolist()]
        fresh = sorted({t for source in sources for t in source.tolist() if t >= 0} - set(known))
        return _rows(sources, known), _rows(sources, fresh)

    def _associate_timed(self, scan: Scan, timed: TimedScan, scores: Array) -> ScanOutcome:
        rows, fresh = self._true_rows(scan)
        return self._outcome(scan, timed, timed.looked(), rows, fresh)

    def _associate(self, scan: Scan, states: Any, scores: Array) -> ScanOutcome:
        rows, fresh = self._true_rows(scan)
        gain = np.full(len(rows), float(self.terms.miss.sum()))
        for s, (z, sensor) in enumerate(zip(scan.measurements, self.sensors, strict=True)):
            seen = np.flatnonzero(rows[:, s])
            if not len(seen):
                continue
            done = self.filter.update(states[seen], np.ascontiguousarray(z[rows[seen, s] - 1]), sensor)
            gain[seen] += done.log_likelihood + self.terms.detection[s] - self.terms.miss[s]
            states = _with(states, seen, done.state)
        return ScanOutcome(states, gain, rows, fresh)


def _rows(sources: Sequence[Array], targets: Sequence[int]) -> Array:
    """1-based measurements (T, S) of these targets, 0 where missed."""
    rows = np.zeros((len(targets), len(sources)), dtype=np.int32)
    for s, source in enumerate(sources):
        number = {t: m + 1 for m, t in enumerate(source.tolist()) if t >= 0}
        rows[:, s] = [number.get(t, 0) for t in targets]
    return rows


def _with(states: Any, rows: Array, corrected: Any) -> Any:
    """The states, those in `rows` replaced."""
    from assoc.filters.batches import concatenate

    rest = np.setdiff1d(np.arange(len(states)), rows)
    back = np.argsort(np.concatenate([rows, rest]), kind="stable")
    return concatenate([corrected, states[rest]])[back]
