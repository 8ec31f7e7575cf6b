"""A starter: starts tracks where all sensors measure angles alone, for trackers that decide each scan at once.

A bearing determines no position. Where bearings of several sensors cross, most crossings are ghosts, and one scan
cannot distinguish them from targets. A tracker that decides each scan at once chooses a wrong crossing whenever it
scores better by chance, and such ghosts keep the bearings that the targets need. So it passes the measurements that its
tracks do not use to a starter: the state of a multiple hypothesis tracker inside its own state, which defers decisions
for some scans and then hands its tracks over. Tracks in the starter are reported as soon as they are confirmed.
Tracks of a tracker that decides at once may still swap bearings and become ghosts; `assoc.tracking.records.ghosts` ends
those.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np

from assoc._types import Array
from assoc.errors import LimitExceededError
from assoc.problem import AssignmentProblem
from assoc.scene.scan import Scan
from assoc.tracking.progress import Progress
from assoc.tracking.records.track import Decision, Step
from assoc.tracking.records.track_batch import TrackBatch
from assoc.tracking.settings import TrackerSettings
from assoc.tracking.stages.coverage import in_view
from assoc.tracking.state import Starter, TrackerState

_GROWN = 5
"""Age in scans at which a track is taken over: confirmation takes two or three, decisions three more."""


def with_starter(settings: TrackerSettings) -> TrackerSettings:
    """The same settings, with those of a starter if the tracker needs one."""
    method = settings.method.starter
    if method is None or not settings.angles_alone:
        return settings
    return replace(settings, starter=replace(settings, method=method, identity=None, adapt=False))


def current(settings: TrackerSettings, state: TrackerState) -> TrackBatch:
    """The tracks that users see, those in the starter included, sorted by id."""
    tracks: TrackBatch = settings.method.current(state)
    if settings.starter is None or state.starter is None:
        return tracks
    both = TrackBatch.concatenate([tracks, settings.starter.method.current(state.starter.state)])
    return both[np.argsort(both.track_id, kind="stable")]


def take_over(progress: Progress) -> Progress:
    """Stage: take over the tracks that are old enough from the starter."""
    settings = progress.settings.starter
    assert settings is not None and progress.state.starter is not None
    rest, grown = settings.method.hand_over(progress.state.starter.state, _GROWN)
    tracks = TrackBatch.concatenate([progress.state.tracks, grown])
    return progress.with_state(tracks=tracks, starter=progress.state.starter._replace(state=rest))


def end_ghosts(progress: Progress) -> Progress:
    """Stage: delete ghosts; their bearings are free again."""
    state, step, miss = progress.state, progress.step, progress.settings.terms.miss
    assert state.starter is not None and step is not None
    if progress.timed is not None:
        return progress
    detected = progress.settings.method.detected(state, step)
    unseen = state.starter.unseen.after(state.tracks.track_id, detected, in_view(progress, state.tracks.states))
    progress = progress.with_state(starter=state.starter._replace(unseen=unseen))
    ghosts = unseen.ghosts(miss)
    if not len(ghosts):
        return progress
    ghosts = np.union1d(ghosts, partners(progress, step, ghosts))
    gone = np.isin(state.tracks.track_id, ghosts)
    free = [np.isin(ids, ghosts) for ids in step.assigned]
    step = replace(
        step,
        assigned=tuple(np.where(mask, 0, ids) for mask, ids in zip(free, step.assigned, strict=True)),
        confirmed=tuple(~mask & flags for mask, flags in zip(free, step.confirmed, strict=True)),
        ended=np.sort(np.concatenate([step.ended, state.tracks.track_id[gone & state.tracks.confirmed]])),
    )
    return progress.with_state(tracks=state.tracks[~gone])._replace(step=step)


def partners(progress: Progress, step: Step, ghosts: Array) -> Array:
    """Tracks that have swapped bearings with ghosts.

    In the best association of this scan alone, some of their bearings are in a tuple with a ghost's, others are not.
    """
    free = [np.ones(len(ids), dtype=np.bool_) for ids in step.assigned]
    try:
        found = progress.settings.births.crossings(progress.scan, free)
    except LimitExceededError:
        # too many crossings to find partners: only the ghosts end
        return ghosts[:0]
    if found is None:
        return ghosts[:0]
    problem = AssignmentProblem(found.rows, found.costs, progress.scan.sizes)
    tuples = progress.work.assign(problem).tuples
    owners = np.stack([np.append(0, ids)[tuples[:, s]] for s, ids in enumerate(step.assigned)], axis=1)
    touched = owners[np.isin(owners, ghosts).any(axis=1)]
    apart = [track for track in np.unique(owners) if (owners == track).any(axis=1).sum() > 1]
    return np.intersect1d(touched, [track for track in apart if track > 0])


def step_starter(progress: Progress, stages: Iterable[Callable[[Progress], Progress]]) -> Progress:
    """Take the starter through these stages with the measurements that no track took."""
    settings, state, step, scan = progress.settings, progress.state, progress.step, progress.scan
    assert settings.starter is not None and state.starter is not None and step is not None
    free = [ids == 0 for ids in step.assigned]
    z = tuple(array[mask] for array, mask in zip(scan.measurements, free, strict=True))
    times = None if scan.times is None else tuple(array[mask] for array, mask in zip(scan.times, free, strict=True))
    left = Scan(scan.index, scan.time, z, times=times, sectors=scan.sectors, paths=scan.paths)
    inner = Progress(settings.starter, state.starter.state, left, progress.work)
    for stage in stages:
        inner = stage(inner)
    assert inner.step is not None
    assigned, confirmed = [ids.copy() for ids in step.assigned], [flags.copy() for flags in step.confirmed]
    for s, mask in enumerate(free):
        assigned[s][mask], confirmed[s][mask] = inner.step.assigned[s], inner.step.confirmed[s]
    now = Decision(scan.index, scan.time, tuple(assigned), tuple(confirmed))
    ended = np.sort(np.concatenate([step.ended, inner.step.ended]))
    step = replace(step, assigned=now.assigned, confirmed=now.confirmed, final=(now,), ended=ended)
    return progress.with_state(starter=Starter(inner.state, state.starter.unseen))._replace(step=step)
