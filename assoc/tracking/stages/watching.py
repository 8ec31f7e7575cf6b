"""Finds identities that cannot all be right, by `assoc.tracking.adapting.identity_watch`."""

from __future__ import annotations

import numpy as np

from assoc._text.plain import one_line
from assoc.costs.gating import chi_square_quantiles
from assoc.recordings.several import NO_HEIGHT
from assoc.tracking.adapting.identity_watch import TrackLookup
from assoc.tracking.progress import Progress
from assoc.tracking.records.track_batch import TrackBatch
from assoc.tracking.stages.starter import current

# tracks whose positions differ by less than their uncertainty lets expect in this share of cases may be one target's
_TOGETHER = 0.999


def watch_identities(progress: Progress) -> Progress:
    """Stage: take in the identities of this scan's plots."""
    settings, state, scan, step = progress.settings, progress.state, progress.scan, progress.step
    if scan.identities is None:
        return progress
    assert step is not None
    # plots of one radar with heights and without are one sensor
    names = [one_line(sensor.name.removesuffix(NO_HEIGHT)) for sensor in settings.sensors]
    names = [name or f"sensor {s}" for s, name in enumerate(names, 1)]

    def tracks() -> TrackBatch:
        return TrackBatch.concatenate([current(settings, state), state.lost])

    lookup = TrackLookup(lambda track: _near(progress, tracks(), track), lambda: {*tracks().track_id.tolist()})
    used = settings.identity is not None
    watch = state.watch.after(
        scan.index, scan.time, names, step.assigned, step.confirmed, scan.times, scan.identities, lookup, used=used
    )
    return progress.with_state(watch=watch)


def _near(progress: Progress, tracks: TrackBatch, track: int) -> list[int]:
    """The confirmed tracks that may have the target of a track, the nearest first."""
    axes = np.array(progress.settings.filter.motion.position)
    rows = np.flatnonzero(tracks.track_id == track)
    others = tracks[tracks.confirmed & (tracks.track_id != track)]
    if not len(rows) or not len(others):
        return []
    mine = tracks[rows[:1]].states
    off = (others.states.mean - mine.mean)[:, axes]
    spread = (others.states.covariance + mine.covariance)[:, axes[:, None], axes]
    square = (off * np.linalg.solve(spread, off[:, :, None])[:, :, 0]).sum(axis=1)
    order = np.argsort(square, kind="stable")
    within = square[order] <= chi_square_quantiles(_TOGETHER, len(axes))[len(axes)]
    return [*others.track_id[order[within]].tolist()]
