"""Track a recording of radar plots: tracks, and CT, MT and IT where the aircraft are known."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from assoc._system.interrupts import end_is_asked
from assoc._types import Array
from assoc.metrics import CtMtIt, ct_mt_it, tracks_of_one_identity
from assoc.recordings import Recording, Window
from assoc.scene.scene import Scene
from assoc.tracking.quality import Qualities
from assoc.tracking.smoothing import smoothed
from assoc.tracking.track import Decision, Step
from assoc.tracking.track_table import TrackTable
from assoc.tracking.tracker import Tracker


def step_windows(tracker: Tracker, windows: Iterable[Window], *, stamps: bool = True) -> Iterator[Step]:
    """Step a tracker through windows of plots.

    Parameters
    ----------
    tracker : Tracker
        With one sensor, or with two by `assoc.recordings.with_heights`; must support measurements with times of their
        own.
    windows : iterable of Window
        They may overlap a little in time; a plot older than the last window's end gets that time.
    stamps : bool
        Whether each plot keeps its own time; otherwise all plots of a window get the time of its end.

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
        own = [times[row] for row in rows] if stamps else None
        yield tracker.step(end, measured(tracker, window), own, identities=[known[row] for row in rows])


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
    table = TrackTable()
    scans: list[tuple[list[Array], list[Array]]] = []
    decisions: list[Decision] = []
    ends: list[float] = []
    takers: list[Array] = [np.zeros(0, dtype=np.int64)]
    sure: list[Array] = [np.zeros(0, dtype=np.bool_)]
    altitudes: dict[int, float] = {}
    done: list[Window] = []
    qualities = Qualities(len(tracker.sensors))
    for window in windows:
        before = tracker.state
        try:
            (step,) = step_windows(tracker, [window])
        except KeyboardInterrupt:
            if end_is_asked():
                # the tracker is as it was before this window
                break
            raise
        done.append(window)
        own = rows_of(tracker, window)
        # back in the order of the window
        order = np.argsort(np.concatenate(own))
        ids = np.concatenate(step.assigned)[order]
        takers.append(np.where(ids > 0, ids, -1))
        sure.append(np.concatenate(step.confirmed)[order])
        table.count_identities(ids, np.stack([window.identities, window.addresses], axis=1))
        known = (ids > 0) & np.isfinite(window.altitudes)
        altitudes.update(zip(ids[known].tolist(), window.altitudes[known].tolist(), strict=True))
        ends.append(float(step.time))
        listed = (track for track in tracker.tracks if track.reported or not confirmed)
        stamps = np.clip(window.times, -np.inf if before.time is None else before.time, step.time)
        scans.append((measured(tracker, window), [stamps[row] for row in own]))
        decisions += step.final
        qualities.after(tracker, before, step, *scans[-1])
        table.add(listed, tracker.filter.motion.position, altitudes, qualities)
    table.name_by_identities()
    if smooth and done:
        plots, times = zip(*scans, strict=True)
        scene = Scene(tracker.sensors, np.array(ends), plots, tracker.settings.place.region, measurement_times=times)
        named, table = table, smoothed(tracker, scene, [*decisions, *tracker.flush()], altitudes=altitudes)
        table.take_names(named)
    tracks = np.concatenate(takers)
    aircraft, confirmed_then = recording.aircraft, np.concatenate(sure)
    rates = kept = None
    rows = np.concatenate([np.zeros(0, dtype=np.int64), *(window.rows for window in done)])
    if aircraft is not None and done:
        number = np.repeat(np.arange(len(done)), [len(window) for window in done])
        rates = ct_mt_it(number, aircraft[rows], tracks, confirmed_then)
    names = _names(recording)[rows]
    if (names >= 0).any():
        kept = tracks_of_one_identity(names, tracks, confirmed_then)
    return PlotTracks(recording, done, np.array(ends), tracks, rates, table, kept)


def _names(recording: Recording) -> Array:
    """Number of each plot's identity (n,): aircraft, else address, else Mode 3; -1 for none."""
    if recording.sources is not None:
        return recording.sources
    given = recording.addresses if recording.addresses.any() else recording.identities
    return np.where(given > 0, given, -1)
