"""Where tracks end: which are deleted after a scan.

How long one may be missed is said by its `LifeCycle` (records/life_cycle.py), counted in dwells of sensors that see it.
"""

from __future__ import annotations

import numpy as np

from assoc._types import Array
from assoc.costs.views import log_missed, places_of
from assoc.tracking.progress import Progress
from assoc.tracking.records.initiation import velocity_components
from assoc.tracking.records.track_batch import TrackBatch
from assoc.tracking.settings import TrackerSettings
from assoc.tracking.stages.coverage import inside

# turns in a scan; with fewer all sensors are taken to be off, and no track is deleted
_LEAST_TURN = 1e-3
# standard deviations below the region's floor
_SURELY = 3.0


def to_delete(progress: Progress, tracks: TrackBatch) -> Array:
    """Which tracks are to be deleted after the scan, bool (T,)."""
    settings, state, time = progress.settings, progress.state, progress.scan.time
    # dwells are counted in scans of the sensor that turns fastest
    most = float(state.turns.max())
    if most < _LEAST_TURN:
        return np.zeros(len(tracks), dtype=np.bool_)
    # a track with a detection at this instant need not wait for one
    patience, rows = np.full(len(tracks), np.inf), np.flatnonzero(tracks.last_detection < time)
    if len(rows):
        states = tracks.states[rows]
        share = settings.views.at_means(states)
        if settings.by_range is not None:
            # where little is detected, tracks of false alarms would wait long for a second detection
            usual = np.maximum(share, settings.by_range.mean(axis=1))
            share = np.where(tracks.confirmed[rows, None] | (share == 0.0), share, usual)
        dark = np.flatnonzero(~share.any(axis=1))
        if len(dark):
            # nothing is lost with a track that no sensor sees and that is tentative, or outside the region
            share[dark] = ~(tracks.confirmed[rows[dark]] & inside(settings, states[dark], 3))[:, None]
        miss = log_missed(settings.terms.miss, share) * (state.turns / most)
        patience[rows] = settings.life_cycle.patience(miss, state.pace / most)
    gone = tracks.to_delete(settings.life_cycle, time, patience)
    if settings.life_cycle.deletion == "time" and settings.life_cycle.deletion_time is None:
        # a missed target that has probably left the region is not waited for, nor shown, unless a sensor that
        # measures distances sees that far; heights may be unknown
        left = np.flatnonzero(tracks.confirmed & (tracks.missed > 0) & (tracks.existence < 0.0))
        if len(left):
            seen = settings.views.at_means(tracks.states[left])[:, settings.ranging].any(axis=1)
            gone[left] |= ~seen & ~inside(settings, tracks.states[left], 2)
    if settings.height is None:
        gone |= _came_down(settings, tracks, time)
    # out of view for so long that nobody knows where it is
    hidden = np.flatnonzero(tracks.hidden > 0.0)
    if len(hidden):
        gone[hidden] |= ~settings.births.narrow(places_of(settings.filter, tracks.states[hidden])[1])
    return gone


def _came_down(settings: TrackerSettings, tracks: TrackBatch, time: float) -> Array:
    """Which tracks are missed and surely below the region's floor, above which they were last detected, bool (T,)."""
    down = np.zeros(len(tracks), dtype=np.bool_)
    missed, velocities = np.flatnonzero(tracks.last_detection < time), velocity_components(settings.filter.motion)
    if len(velocities) < 3 or not len(missed):
        return down
    states, floor = tracks.states[missed], settings.scene.region[2, 0]
    height, climb = states.mean[:, [settings.filter.motion.position[2], velocities[2]]].T
    # where the floor is wrong, targets are detected below it
    above = height - climb * (time - tracks.last_detection[missed]) >= floor
    below = np.flatnonzero(above & (height < floor))
    if len(below):
        spread = places_of(settings.filter, states[below])[1]
        down[missed[below]] = height[below] + _SURELY * np.sqrt(spread[:, 2, 2]) < floor
    return down
