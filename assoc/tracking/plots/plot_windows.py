"""Trackers on windows of plots, each plot with a time stamp of its own."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Protocol

import numpy as np

from assoc._types import Array
from assoc.tracking.track import Step
from assoc.tracking.tracker import Tracker


class PlotWindow(Protocol):
    """What a window of plots offers; `assoc.recordings.Window` does."""

    @property
    def times(self) -> Array:
        """Time stamps (n,), not decreasing, seconds."""

    @property
    def measurements(self) -> Array:
        """Measurements (n, d) of one sensor."""

    @property
    def identities(self) -> Array:
        """Mode 3/A codes (n,), 0 where there is none."""

    @property
    def addresses(self) -> Array:
        """ICAO addresses (n,), 0 where there is none."""


def step_windows(tracker: Tracker, windows: Iterable[PlotWindow], *, stamps: bool = True) -> Iterator[Step]:
    """Take windows of plots in, one after the other.

    Parameters
    ----------
    tracker : Tracker
        Of a single sensor, one that takes measurements with times of their own.
    windows : iterable of windows
        By the antenna's turn they may overlap a little in time; a plot older than the last window's end
        counts as of that end.
    stamps : bool
        Whether each plot keeps its own time; otherwise all of a window are taken to be of its end.

    Yields
    ------
    Step
        One for each window.
    """
    for window in windows:
        early = tracker.time
        times = np.asarray(window.times, dtype=np.float64)
        if early is not None:
            times = np.maximum(times, early)
        end = float(times[-1]) if len(times) else float(early or 0.0)
        known = None
        if tracker.settings.identity is not None:
            known = [np.stack([window.identities, window.addresses], axis=1)]
        yield tracker.step(end, [window.measurements], [times] if stamps else None, identities=known)
