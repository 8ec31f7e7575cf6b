"""Where one target becomes two: the new track names the old one that it parted from."""

from __future__ import annotations

import math

import numpy as np

from assoc._types import Array
from assoc.costs.tracks.gating import near_pairs
from assoc.filters.base import Expected
from assoc.tracking.progress import Progress
from assoc.tracking.records.initiation import velocity_components
from assoc.tracking.records.track import among
from assoc.tracking.records.track_batch import TrackBatch

# how much likelier a position is where an old track was than anywhere in the region
_LIKELIER = 100.0
# an old track is this many scans older: targets side by side are detected together
_OLDER = 2


def name_parents(progress: Progress) -> Progress:
    """Stage: give newly confirmed tracks that began where another one was, which goes on, the id of that one."""
    assert progress.association is not None
    every, known = progress.state.tracks, progress.association.tracks
    sure = known.track_id[known.confirmed]
    if among(every.track_id[every.confirmed], sure).all():
        return progress
    tracks = progress.settings.method.current(progress.state)
    old = np.isin(tracks.track_id, sure)
    new, old = tracks[tracks.confirmed & ~old], tracks[tracks.confirmed & old & (tracks.missed == 0)]
    if not len(new) or not len(old):
        return progress
    row, column, ratio = _ratios(progress, new, old)
    best = np.lexsort((column, -ratio, row))
    best = best[np.unique(row[best], return_index=True)[1]]
    best = best[ratio[best] > math.log(_LIKELIER)]
    if not len(best):
        return progress
    return progress.with_state(tracks=every.with_parents(new.track_id[row[best]], old.track_id[column[best]]))


def _ratios(progress: Progress, new: TrackBatch, old: TrackBatch) -> tuple[Array, Array, Array]:
    """Log likelihood ratios of the places of new tracks when they began: with an old one, or anywhere.

    Pairs (new, old) that may be above the limit, and their ratios, each (K,).
    """
    motion, region = progress.settings.filter.motion, progress.settings.scene.region
    place, velocity = list(motion.position), velocity_components(motion)
    n, back = len(place), new.started - progress.scan.time
    both = np.concatenate([place, velocity])
    volume = math.log(np.maximum(region[:n, 1] - region[:n, 0], 1.0).prod())
    parts = [np.zeros((0, 2), dtype=np.int64)]
    ours, theirs = (tracks.states.covariance[:, both[:, None], both] for tracks in (new, old))
    for when in np.unique(back).tolist():
        H = np.concatenate([np.eye(n), when * np.eye(n)], axis=1)
        rows = np.flatnonzero(back == when)
        older = np.flatnonzero(old.started <= new.started[rows[0]] - _OLDER * progress.state.pace)
        if not len(older):
            continue
        own, widest = H @ ours[rows] @ H.T, (H @ theirs[older] @ H.T).max(axis=0)
        # the ratio is at most that of a pair whose covariance is no more than the new track's own
        gate = 2.0 * (volume - math.log(_LIKELIER)) - np.linalg.slogdet(2.0 * math.pi * own)[1]
        wide = np.maximum(gate, 0.0)[:, None, None] * (own + np.diag(np.diagonal(widest)))
        there = Expected(new.states.mean[rows][:, both] @ H.T, wide)
        first, second = near_pairs(there, old.states.mean[older][:, both] @ H.T, (False,) * n, 1.0)
        parts.append(np.stack([rows[first], older[second]], axis=1))
    row, column = np.concatenate(parts).T
    H = np.concatenate([np.tile(np.eye(n), (len(row), 1, 1)), back[row, None, None] * np.eye(n)], axis=2)
    off = (H @ (new.states.mean[row][:, both] - old.states.mean[column][:, both])[..., None])[..., 0]
    spread = H @ (ours[row] + theirs[column]) @ H.transpose(0, 2, 1)
    square = (off * np.linalg.solve(spread, off[..., None])[..., 0]).sum(axis=1)
    return row, column, volume - 0.5 * (square + np.linalg.slogdet(2.0 * math.pi * spread)[1])
