"""Where one target becomes two: the new track names the old one that it parted from."""

from __future__ import annotations

import math

import numpy as np

from assoc._types import Array
from assoc.tracking.births.initiation import velocity_components
from assoc.tracking.progress import Progress
from assoc.tracking.track_batch import TrackBatch

# how much likelier a position is where an old track was than anywhere in the region
_LIKELIER = 100.0
# an old track is this many scans older: targets side by side are detected together
_OLDER = 2


def name_parents(progress: Progress) -> Progress:
    """Stage: give newly confirmed tracks that began where another one was, which goes on, the id of that one."""
    assert progress.found is not None
    every, known = progress.state.tracks, progress.found.tracks
    sure = known.track_id[known.confirmed]
    if np.isin(every.track_id[every.confirmed], sure).all():
        return progress
    tracks = progress.settings.method.current(progress.state)
    old = np.isin(tracks.track_id, sure)
    new, old = tracks[tracks.confirmed & ~old], tracks[tracks.confirmed & old & (tracks.missed == 0)]
    if not len(new) or not len(old):
        return progress
    ratio = _ratio(progress, new, old)
    row = np.argmax(ratio, axis=1)
    likely = np.flatnonzero(ratio.max(axis=1) > math.log(_LIKELIER))
    if not len(likely):
        return progress
    return progress.with_state(tracks=every.with_parents(new.track_id[likely], old.track_id[row[likely]]))


def _ratio(progress: Progress, new: TrackBatch, old: TrackBatch) -> Array:
    """Log likelihood ratio of the place of each new track when it began: with an old one, or anywhere; (N, T)."""
    motion, region = progress.settings.filter.motion, progress.settings.place.region
    place, velocity = list(motion.position), velocity_components(motion)
    n, back = len(place), new.started - progress.scan.time
    both = np.concatenate([place, velocity])
    H = np.concatenate([np.tile(np.eye(n), (len(new), 1, 1)), back[:, None, None] * np.eye(n)], axis=2)[:, None]
    off = new.states.mean[:, None, both] - old.states.mean[None, :, both]
    spread = new.states.covariance[:, None][..., both[:, None], both] + old.states.covariance[..., both[:, None], both]
    off, spread = (H @ off[..., None])[..., 0], H @ spread @ H.transpose(0, 1, 3, 2)
    square = (off * np.linalg.solve(spread, off[..., None])[..., 0]).sum(axis=2)
    volume = np.maximum(region[:n, 1] - region[:n, 0], 1.0).prod()
    ratio = math.log(volume) - 0.5 * (square + np.linalg.slogdet(2.0 * math.pi * spread)[1])
    older = old.started[None] <= new.started[:, None] - _OLDER * progress.state.pace
    return np.where(older, ratio, -np.inf)
