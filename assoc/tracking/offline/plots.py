"""Track a recording of radar plots: tracks, and CT, MT and IT where the aircraft are known."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from assoc._system.interrupts import end_is_asked
from assoc._types import Array
from assoc.metrics import CtMtIt
from assoc.metrics.ct_mt_it import RatesSoFar
from assoc.metrics.plot_identity import IdentitiesSoFar
from assoc.recordings import Recording, Window
from assoc.tracking.offline.ended_smoothing import EndedSmoothing
from assoc.tracking.quality import Qualities
from assoc.tracking.records.track import Step, TrackColumns
from assoc.tracking.state import may_return
from assoc.tracking.track_table import TrackTable
from assoc.tracking.tracker import Tracker

FORGET = 50
"""Windows after which what is known of tracks that have ended is forgotten."""


def step_windows(tracker: Tracker, windows: Iterable[Window]) -> Iterator[Step]:
    """Step a tracker through windows of plots, each plot at its own time.

    Parameters
    ----------
    tracker : Tracker
        With one sensor, or with two by `assoc.recordings.with_heights`; must support measurements with times of their
        own.
    windows : iterable of Window
        They may overlap a little in time; a plot older than the last window's end gets that time.

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
        known, rows = np.stack([window.identities, window.addresses], axis=1), rows_of(tracker, window)
        stamps, identities = [times[row] for row in rows], [known[row] for row in rows]
        yield tracker.step(end, measured(tracker, window), stamps, identities=identities)


def rows_of(tracker: Tracker, window: Window) -> list[Array]:
    """The plots of a window that belong to each of the tracker's sensors."""
    if len(tracker.sensors) == 1:
        return [np.arange(len(window))]
    high = np.isfinite(window.altitudes)
    return [np.flatnonzero(high), np.flatnonzero(~high)]


def measured(tracker: Tracker, window: Window) -> list[Array]:
    """Their measurements."""
    parts = np.column_stack([window.measurements, window.heights])
    return [parts[row, : sensor.dim] for row, sensor in zip(rows_of(tracker, window), tracker.sensors, strict=True)]


class PlotTracks(NamedTuple):
    """Result of tracking a recording.

    Attributes
    ----------
    recording : Recording
    windows : list of Window
    ends : array (K,)
        The tracker's time after each window, seconds.
    tracks : int array (n,)
        The track that took each plot of the windows, in their order, -1 if none did.
    rates : CtMtIt or None
        CT, MT and IT of the windows; None where no aircraft is known.
    table : TrackTable
        The tracks after each window; their altitude is that of their last plot with one that is not garbled.
    kept : (int, int) or None
        Numbers of confirmed tracks that kept one identity, and that had any: the aircraft if known, else the
        address if any plot has one, else Mode 3. None if no plot has an identity.
    """

    recording: Recording
    windows: Sequence[Window]
    ends: Array
    tracks: Array
    rates: CtMtIt | None
    table: TrackTable
    kept: tuple[int, int] | None


def track_plots(
    tracker: Tracker,
    recording: Recording,
    windows: Iterable[Window],
    *,
    confirmed: bool = True,
    smooth: bool = False,
) -> PlotTracks:
    """Run a tracker of one radar over the windows of a recording.

    Parameters
    ----------
    tracker : Tracker
        As for `step_windows`.
    recording : Recording
    windows : iterable of Window
        Of this recording.
    confirmed : bool
        Whether only confirmed tracks are listed.
    smooth : bool
        Whether the table has the finished tracks instead, see `assoc.tracking.smoothed`; needs a new tracker.
    """
    table, smoothing = TrackTable(), EndedSmoothing(tracker)
    takers = TakenPlots(recording.aircraft is not None, bool(recording.addresses.any()))
    done: list[Followed] = []
    for followed in follow(tracker, windows):
        done.append(followed)
        takers.take(followed)
        table.count_identities(followed.tracks, known_of(followed.window)[:, 1:])
        table.add(*followed.listed(confirmed))
        if smooth:
            smoothing.take(followed.step, followed.measurements, followed.times, followed.altitudes)
    table.name_by_identities()
    if smooth:
        named, table = table, smoothing.finish()
        table.take_names(named)
    ends = np.array([f.step.time for f in done])
    tracks = np.concatenate([np.zeros(0, dtype=np.int64), *(f.tracks for f in done)])
    rates, kept = takers.rates(), takers.kept()
    return PlotTracks(recording, [f.window for f in done], ends, tracks, rates, table, kept)


class Followed(NamedTuple):
    """A window that a tracker has taken."""

    tracker: Tracker
    window: Window
    step: Step
    tracks: Array
    """The track that took each plot, -1 if none did."""
    sure: Array
    """Whether that track was confirmed."""
    measurements: list[Array]
    times: list[Array]
    altitudes: dict[int, float]
    """Last altitude of each track; shared by all windows."""
    qualities: Qualities
    """Shared likewise."""

    def listed(self, confirmed: bool) -> tuple[TrackColumns, Sequence[int], dict[int, float], Qualities]:
        """Arguments of `TrackTable.add`: the tracks after this window, or only the confirmed ones."""
        listed = self.tracker.track_columns()
        listed = listed.rows(listed.reported) if confirmed else listed
        return listed, self.tracker.filter.motion.position, self.altitudes, self.qualities


def follow(tracker: Tracker, windows: Iterable[Window], *, forget: bool = False) -> Iterator[Followed]:
    """Step a tracker through windows, until the program is asked to end.

    With `forget` nothing is kept of tracks that have ended.
    """
    altitudes: dict[int, float] = {}
    qualities = Qualities(len(tracker.sensors))
    for number, window in enumerate(windows):
        before = tracker.state
        try:
            (step,) = step_windows(tracker, [window])
        except KeyboardInterrupt:
            if end_is_asked():
                # the tracker is as it was before this window
                return
            raise
        own = rows_of(tracker, window)
        # back in the order of the window
        order = np.argsort(np.concatenate(own))
        ids = np.concatenate(step.assigned)[order]
        known = (ids > 0) & np.isfinite(window.altitudes)
        altitudes.update(zip(ids[known].tolist(), window.altitudes[known].tolist(), strict=True))
        stamps = np.clip(window.times, -np.inf if before.time is None else before.time, step.time)
        scan = measured(tracker, window), [stamps[row] for row in own]
        qualities.after(tracker, before, step, *scan)
        sure = np.concatenate(step.confirmed)[order]
        yield Followed(tracker, window, step, np.where(ids > 0, ids, -1), sure, *scan, altitudes, qualities)
        if forget and (number + 1) % FORGET == 0:
            living = may_return(tracker.state)
            qualities.keep(living)
            for gone in altitudes.keys() - living:
                del altitudes[gone]


UNKNOWN = -2
"""Stands for the aircraft where it is not known."""


def known_of(window: Window) -> Array:
    """Aircraft, code and address of each plot, (n, 3)."""
    sources = np.full(len(window), UNKNOWN) if window.sources is None else window.sources
    return np.stack([sources, window.identities, window.addresses], axis=1)


class TakenPlots:
    """CT, MT and IT, and how many tracks kept one identity, window after window.

    Parameters
    ----------
    known : bool
        Whether any plot of the recording has an aircraft or a code.
    addressed : bool
        Whether any has an address.
    """

    def __init__(self, known: bool, addressed: bool) -> None:
        self._known, self._addressed, self._count = known, addressed, 0
        self._rates, self._identities = RatesSoFar(), IdentitiesSoFar()

    def take(self, followed: Followed) -> None:
        """Take the next window."""
        known = known_of(followed.window)
        self.add(np.zeros(len(known), dtype=np.int64), known, followed.tracks, followed.sure)

    def add(self, windows: Array, known: Array, tracks: Array, sure: Array) -> None:
        """Take the plots of windows numbered from 0 on, what is known of each (`known_of`), and their tracks."""
        aircraft, codes, addresses = known.T
        sourced = bool(len(aircraft)) and aircraft[0] != UNKNOWN
        codes, addresses = np.where(codes > 0, codes, -1), np.where(addresses > 0, addresses, -1)
        if self._known:
            self._rates.add(self._count + windows, aircraft if sourced else codes, tracks, sure)
        self._identities.add(aircraft if sourced else addresses if self._addressed else codes, tracks, sure)
        self._count += int(windows[-1]) + 1 if len(windows) else 0

    def keep(self, tracks: set[int]) -> None:
        """Forget the last plots of all tracks but these."""
        self._rates.keep(tracks)
        self._identities.keep(tracks)

    def rates(self) -> CtMtIt | None:
        """CT, MT and IT; None where no aircraft is known."""
        return self._rates.result() if self._known and self._count else None

    def kept(self) -> tuple[int, int] | None:
        """Numbers of confirmed tracks that kept one identity, and that had any; None if no plot has an identity."""
        return self._identities.result() if self._identities.any else None
