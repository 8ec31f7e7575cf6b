"""Smooths the tracks of a recording as they end, so that memory does not grow with its length."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from assoc._types import Array
from assoc.errors import AssocWarning
from assoc.scene.geodesy import Origin
from assoc.scene.scene import Scene
from assoc.tracking.offline.smoothing import smoothed
from assoc.tracking.records.track import Decision, Step
from assoc.tracking.track_table import TrackTable
from assoc.tracking.tracker import Tracker


class EndedSmoothing:
    """Smooths confirmed tracks that have ended; it keeps the windows since the oldest living one began.

    Parameters
    ----------
    tracker : Tracker
        See `assoc.tracking.smoothed`.
    origin : tuple of latitude, longitude, height, optional
        As of `TrackTable`.
    """

    def __init__(self, tracker: Tracker, origin: Origin | None = None) -> None:
        self._tracker, self._origin = tracker, origin
        # ends, measurements and their times, of windows from number _first on; the last may not be decided yet
        self._windows: list[tuple[float, list[Array], list[Array]]] = []
        self._decisions: list[Decision] = []
        self._first = 0
        self._latest: Mapping[int, float] = {}
        self._altitudes: dict[int, float] = {}
        # after how many windows which tracks lived
        self._lived: list[tuple[int, set[int]]] = []

    def take(self, step: Step, measurements: list[Array], times: list[Array], altitudes: Mapping[int, float]) -> None:
        """Take the next window, and the last altitude of each track."""
        self._windows.append((step.time, measurements, times))
        self._decisions += step.final
        self._latest = altitudes

    def end(self, living: set[int]) -> TrackTable:
        """Smooth the tracks whose measurements are all decided and that are not among the living."""
        if not self._windows:
            return TrackTable(self._origin)
        self._altitudes |= self._latest
        decided = self._first + len(self._decisions)
        self._lived.append((self._first + len(self._windows), living))
        while len(self._lived) > 1 and self._lived[1][0] <= decided:
            del self._lived[0]
        count, alive = self._lived[0]
        ended = _taken(self._decisions[: count - self._first]) - alive if count <= decided else set()
        own = [_part(decision, ended, -self._first) for decision in self._decisions]
        left = _taken(self._decisions) - ended
        self._decisions = [_part(decision, left) for decision in self._decisions]
        ends, plots, times = zip(*self._windows, strict=True)
        sensors, region = self._tracker.sensors, self._tracker.settings.scene.region
        with warnings.catch_warnings():
            # a few windows at a time are no sample of the recording
            warnings.simplefilter("ignore", AssocWarning)
            scene = Scene(sensors, np.array(ends), plots, region, measurement_times=times, origin=self._origin)
        table = smoothed(self._tracker, scene, own, altitudes=self._altitudes)
        gone = next((k for k, decision in enumerate(self._decisions) if _taken([decision])), len(self._decisions))
        del self._windows[:gone], self._decisions[:gone]
        self._first += gone
        left = left.union(*(alive for _, alive in self._lived))
        self._altitudes = {track: value for track, value in self._altitudes.items() if track in left}
        return table

    def finish(self) -> TrackTable:
        """Smooth all that are left."""
        self._decisions += self._tracker.flush()
        return self.end(set())


def _taken(decisions: list[Decision]) -> set[int]:
    """Tracks that took measurements."""
    every = [ids for decision in decisions for ids in decision.assigned]
    return {*np.unique(np.concatenate(every)).tolist()} - {0} if every else set()


def _part(decision: Decision, tracks: set[int], later: int = 0) -> Decision:
    """A decision with these tracks alone, its scan numbered so much later."""
    listed = np.array([*tracks], dtype=np.int64)
    assigned: tuple[Array, ...] = tuple(np.where(np.isin(ids, listed), ids, 0) for ids in decision.assigned)
    return replace(decision, scan=decision.scan + later, assigned=assigned)
