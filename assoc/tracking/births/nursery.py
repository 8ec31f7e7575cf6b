"""A nursery: where tracks begin whose sensors measure angles alone, for trackers that decide each scan at once.

A bearing tells no position. Where bearings of several sensors cross, most crossings are ghosts, and one scan cannot
tell them from targets: two targets in line with a sensor may as well have one another's bearing. A tracker that decides
each scan at once believes the wrong crossings as soon as they look better by chance, and these ghosts then keep the
bearings that the targets need. So such a tracker gives what its tracks leave over to a nursery: the state of a multiple
hypothesis tracker inside its own state, which puts decisions off for some scans, and hands over the tracks that have
stood the test. Tracks in the nursery are reported as soon as they are confirmed. A tracker that decides at once may
still let two tracks swap bearings, until they are ghosts: those end by `assoc.tracking.births.ghosts`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np

from assoc._types import Array
from assoc.errors import LimitExceededError
from assoc.problem import AssignmentProblem
from assoc.scene.scan import Scan
from assoc.tracking.looks import out_of_view
from assoc.tracking.progress import Progress
from assoc.tracking.settings import TrackerSettings
from assoc.tracking.state import Nursery, TrackerState
from assoc.tracking.track import Decision, Step
from assoc.tracking.track_batch import TrackBatch

_GROWN = 5
"""Scans since a track began after which it is taken over: confirmation takes two or three, decisions three more."""


def with_nursery(settings: TrackerSettings) -> TrackerSettings:
    """The same settings, with those of a nursery where the tracker needs one."""
    method = settings.method.nursery
    if method is None or not settings.angles_alone:
        return settings
    return replace(settings, nursery=replace(settings, method=method, registration=None, identity=None))


def current(settings: TrackerSettings, state: TrackerState) -> TrackBatch:
    """The tracks to hand out, those in the nursery included, by their ids."""
    tracks: TrackBatch = settings.method.current(state)
    if settings.nursery is None or state.nursery is None:
        return tracks
    both = TrackBatch.concatenate([tracks, settings.nursery.method.current(state.nursery.state)])
    return both[np.argsort(both.track_id, kind="stable")]


def take_over(progress: Progress) -> Progress:
    """Stage: the tracks that have grown up leave the nursery."""
    settings = progress.settings.nursery
    assert settings is not None and progress.state.nursery is not None
    young, grown = settings.method.hand_over(progress.state.nursery.state, _GROWN)
    tracks = TrackBatch.concatenate([progress.state.tracks, grown])
    return progress.with_state(tracks=tracks, nursery=progress.state.nursery._replace(state=young))


def end_ghosts(progress: Progress) -> Progress:
    """Stage: delete tracks that a sensor does not see although it should; their bearings are free again."""
    state, step, miss = progress.state, progress.step, progress.settings.terms.miss
    assert state.nursery is not None and step is not None
    if progress.timed is not None:
        return progress
    detected = progress.settings.method.detected(state, step)
    unseen = state.nursery.unseen.after(state.tracks.track_id, detected, ~out_of_view(progress))
    progress = progress.with_state(nursery=state.nursery._replace(unseen=unseen))
    ghosts = unseen.ghosts(miss)
    if not len(ghosts):
        return progress
    ghosts = np.union1d(ghosts, partners(progress, step, ghosts))
    gone = np.isin(state.tracks.track_id, ghosts)
    free = [np.isin(one, ghosts) for one in step.assigned]
    step = replace(
        step,
        assigned=tuple(np.where(own, 0, one) for own, one in zip(free, step.assigned, strict=True)),
        confirmed=tuple(~own & one for own, one in zip(free, step.confirmed, strict=True)),
        ended=np.sort(np.concatenate([step.ended, state.tracks.track_id[gone & state.tracks.confirmed]])),
    )
    return progress.with_state(tracks=state.tracks[~gone])._replace(step=step)


def partners(progress: Progress, step: Step, ghosts: Array) -> Array:
    """Tracks that have swapped bearings with ghosts.

    By this scan alone, they hold bearings that belong together with those of a ghost, and bearings that do not.
    """
    free = [np.ones(len(one), dtype=np.bool_) for one in step.assigned]
    try:
        found = progress.settings.births.crossings(progress.scan, free)
    except LimitExceededError:
        # too many crossings to tell: the ghosts end, and so does the swap
        return ghosts[:0]
    if found is None:
        return ghosts[:0]
    problem = AssignmentProblem(found.rows, found.costs, progress.scan.sizes)
    tuples = progress.work.assign(problem).tuples
    owners = np.stack([np.append(0, one)[tuples[:, s]] for s, one in enumerate(step.assigned)], axis=1)
    touched = owners[np.isin(owners, ghosts).any(axis=1)]
    apart = [track for track in np.unique(owners) if (owners == track).any(axis=1).sum() > 1]
    return np.intersect1d(touched, [track for track in apart if track > 0])


def raise_young(progress: Progress, stages: Iterable[Callable[[Progress], Progress]]) -> Progress:
    """Take the nursery through these stages with the measurements that the tracks have left over."""
    settings, state, step, scan = progress.settings, progress.state, progress.step, progress.scan
    assert settings.nursery is not None and state.nursery is not None and step is not None
    free = [ids == 0 for ids in step.assigned]
    z = tuple(one[own] for one, own in zip(scan.measurements, free, strict=True))
    times = None if scan.times is None else tuple(one[own] for one, own in zip(scan.times, free, strict=True))
    left = Scan(scan.index, scan.time, z, times=times, sectors=scan.sectors)
    young = Progress(settings.nursery, state.nursery.state, left, progress.work)
    for stage in stages:
        young = stage(young)
    assert young.step is not None
    assigned, confirmed = [one.copy() for one in step.assigned], [one.copy() for one in step.confirmed]
    for s, own in enumerate(free):
        assigned[s][own], confirmed[s][own] = young.step.assigned[s], young.step.confirmed[s]
    now = Decision(scan.index, scan.time, tuple(assigned), tuple(confirmed))
    ended = np.sort(np.concatenate([step.ended, young.step.ended]))
    step = replace(step, assigned=now.assigned, confirmed=now.confirmed, final=(now,), ended=ended)
    return progress.with_state(nursery=Nursery(young.state, state.nursery.unseen))._replace(step=step)
