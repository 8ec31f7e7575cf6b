"""What the dwells of sensors covered: how often in a scan, what a miss of a track says.

A sensor that cannot see a track has not missed it: its detection probability counts times the share of the track's
predicted density in its view (`assoc.costs.views`).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from assoc._types import Array
from assoc.costs.views import log_missed, places_of
from assoc.scene.own_times import FULL_TURN, looked_at
from assoc.tracking.progress import Progress
from assoc.tracking.records.clutter import YOUNG, ClutterMap
from assoc.tracking.records.echoes import STRAYS
from assoc.tracking.records.track_batch import TrackBatch
from assoc.tracking.settings import TrackerSettings

_FORGETTING = 0.05
# a scan counts for a track if this share of it is in view of a sensor
_COVERED = 0.5
_HOUR = 3600.0
# logarithm beyond which numbers of false alarms are as good as infinite
_SURELY_FALSE = 500.0


def keep_pace(progress: Progress) -> Progress:
    """Update the exponential means of the scans' pace and of the sensors' turns, both of which may change."""
    state, dt = progress.state, progress.elapsed
    if dt == 0:
        return progress
    share = max(1.0 / max(state.scan, 1), _FORGETTING)
    sectors, turns = progress.scan.sectors, state.turns
    if sectors is not None:
        turns = turns + ((sectors[:, 1] - sectors[:, 0]) / FULL_TURN - turns) * share
    return progress.with_state(pace=state.pace + (dt - state.pace) * share, turns=turns)


def count_out_of_view(progress: Progress) -> Progress:
    """Add the time since the last scan to that for which no sensor could see a track, for those inside the region.

    Neither can one that is off: a sector without width.
    """
    dt, tracks, settings, sectors = progress.elapsed, progress.state.tracks, progress.settings, progress.scan.sectors
    if dt == 0.0 or not len(tracks):
        return progress
    states = tracks.states if progress.timed is None else progress.timed.late
    seen = in_view(progress, states)
    hidden = ~(seen if sectors is None else seen & (sectors[:, 0] != sectors[:, 1])).any(axis=1)
    if not hidden.any():
        return progress
    hidden &= inside(settings, states, 3)
    return progress.with_state(tracks=tracks.hidden_for(np.where(hidden, dt, 0.0)))


def inside(settings: TrackerSettings, states: Any, most: int) -> Array:
    """Which tracks are inside the region along the first axes, at most so many, bool (T,)."""
    region, axes = settings.scene.region, min(most, len(settings.filter.motion.position))
    where = places_of(settings.filter, states)[0][:, :axes]
    return np.asarray(((where >= region[:axes, 0]) & (where <= region[:axes, 1])).all(axis=1))


def in_view(progress: Progress, states: Any) -> Array:
    """Which tracks are in which sensors' fields of view by their means, bool (T, S)."""
    return np.asarray(progress.settings.views.at_means(states) > 0.0)


def detected_or_in_view(progress: Progress, states: Any, detected: Array) -> Array:
    """Which tracks were detected, bool (T,), or are in some sensor's field of view, bool (T,)."""
    if detected.all():
        return detected
    found, rows = detected.copy(), np.flatnonzero(~detected)
    found[rows] = in_view(progress, states[rows]).any(axis=1)
    return found


def dwells(progress: Progress, states: Any) -> Array:
    """Which tracks the dwells of which sensors covered in this scan, by their means, bool (T, S)."""
    sectors, seen = progress.scan.sectors, in_view(progress, states)
    if sectors is None:
        return seen
    where = places_of(progress.settings.filter, states)[0]
    away = where[:, None] - np.array([sensor.position for sensor in progress.settings.sensors])
    azimuths = np.arctan2(away[..., 1], away[..., 0]).T
    return seen & np.stack([looked_at(*both) for both in zip(sectors, azimuths, strict=True)], axis=1)


def misses(progress: Progress, states: Any) -> Array:
    """Score of a miss of tracks predicted to a scan of one instant by each sensor, (T, S)."""
    return log_missed(progress.settings.terms.miss, progress.settings.views.shares(states))


def misses_of(progress: Progress, states: Any, s: int) -> Array:
    """`misses` of sensor s alone, (T,)."""
    share = progress.settings.views.shares(states, slice(s, s + 1))[:, 0]
    return log_missed(progress.settings.terms.miss[s], share)


def covered(progress: Progress, misses: Array) -> Array:
    """Whether dwells of any sensor covered tracks, by their scores of a miss (T, S); bool (T,)."""
    terms = progress.settings.terms
    least = _COVERED * (np.array(1.0) if terms.by_range is None else terms.by_range.min(axis=1))
    return np.asarray((misses <= log_missed(terms.miss, least)).any(axis=1))


def an_hour(progress: Progress) -> tuple[float, float]:
    """New targets in the region that are expected in an hour, and false alarms of all sensors.

    Scores of the tracks that a scan begins count a target once, whatever the number of sensors. Both are inf while the
    pace of the scans is not known.
    """
    state, settings = progress.state, progress.settings
    if state.pace <= 0.0:
        return math.inf, math.inf
    alarms = np.array([sensor.false_alarm_rate for sensor in settings.sensors])
    in_a_scan = settings.initiation.birth_rate * min(1.0, float(state.turns.sum())), float(alarms @ state.turns)
    return in_a_scan[0] * _HOUR / state.pace, in_a_scan[1] * _HOUR / state.pace


def new_targets_at(progress: Progress, tracks: TrackBatch) -> Array | float:
    """New targets in an hour for tracks that may be confirmed; false alarms where more of these begin tracks, (T,).

    So it is outside of the region, for which there is no number of new targets, beside a track whose echo it may be,
    and at places where false alarms are denser. At what may yet turn out to be a place, all that a track has gained so
    far may be as much too much.
    """
    hourly, alarms = an_hour(progress)
    life, clutter, before = progress.settings.life_cycle, progress.clutter, progress.state.clutter
    new = np.flatnonzero(~tracks.confirmed & life.confirms(tracks.score, tracks.detections, hourly))
    if not len(new):
        return hourly
    usual = life.false_tracks_per_hour / float(life.false_share(hourly)) if math.isinf(hourly) else hourly
    doubted, echoes, denser = (
        ~inside(progress.settings, tracks.states[new], 3),
        progress.state.echoes,
        np.zeros(len(new)),
    )
    if echoes is not None:
        doubted |= np.isin(tracks.track_id[new], echoes.ids[echoes.counts[:, STRAYS] == 0.0, 0])
    if before is not None and clutter is not None:
        used = densities_at(progress, tracks[new], clutter)[0]
        denser = np.maximum(used.max(axis=1), used @ (before.clock < YOUNG) * tracks.hits[new])
    at = np.full(len(tracks), usual)
    at[new[doubted | (denser > 0.0)]] = usual if math.isinf(alarms) else max(usual, alarms)
    at[new] *= np.exp(np.minimum(denser, _SURELY_FALSE))
    return at


def densities_at(progress: Progress, tracks: TrackBatch, clutter: ClutterMap) -> Array:
    """Logarithms of the densities where each sensor expects tracks: in use, and all, see `ClutterMap`; (2, T, S)."""
    assert progress.state.clutter is not None
    young = progress.state.clutter.clock < YOUNG
    crowded = [bool(own) or bool(crowd.any()) for own, crowd in zip(young, progress.crowds, strict=True)]
    found = np.zeros((2, len(tracks), len(crowded)))
    if any(crowded) and len(tracks):
        expected = [
            progress.settings.filter.expected(tracks.states, sensor).mean if some else np.zeros((0, sensor.dim))
            for sensor, some in zip(progress.settings.sensors, crowded, strict=True)
        ]
        both = clutter.used_and_found(progress.work.settings.sensors, progress.scan, expected)
        for s in np.flatnonzero(crowded).tolist():
            found[:, :, s] = [values[s] for values in both]
    return found
