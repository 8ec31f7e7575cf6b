"""A track that was lost is taken up again: a new track that continues it gets its id.

Ends of confirmed tracks are predicted on for a while. When a track is confirmed that began after such an end, or after
the last detection of a track that is missed now, two explanations are compared: the target of the old track, with
its predicted position and velocity; or a new target, born anywhere in the region with any usual velocity. Old ends and
new starts are matched by the assignment problem of these log likelihood ratios. A tentative track is confirmed by this
if it continues an old one by far rather than it is of false alarms: so after a hard manoeuvre a track goes on at once.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from assoc._types import Array
from assoc.costs.views import places_of
from assoc.filters.base import predict_each
from assoc.problem import AssignmentProblem
from assoc.tracking.progress import Progress
from assoc.tracking.records.initiation import velocity_components
from assoc.tracking.records.life_cycle import OVERLOOKED
from assoc.tracking.records.track import among, renamed
from assoc.tracking.records.track_batch import TrackBatch
from assoc.tracking.stages.echoes import rather_echoes

# ends are kept for this share of a target's mean lifetime
_KEPT = 0.25
# share of lost targets that have manoeuvred, and their variance as a multiple of the prediction's; share of those that
# have flown on with any usual velocity
_MANOEUVRED, _WIDER, _ANYWHERE = 0.2, 16.0, 0.02
# a tentative track continues a confirmed one at these odds against false alarms, as a logarithm
_SURE = math.log(1e3)


def take_up(progress: Progress) -> Progress:
    """Stage: give new tracks the ids of the old ones that they continue; keep the ends of this step."""
    assert progress.association is not None and progress.step is not None
    method, step, known = progress.settings.method, progress.step, progress.association.tracks
    lost, every = _predicted(progress), progress.state.tracks
    sure, gone = known.track_id[known.confirmed], every.confirmed & (every.missed > 0) & (every.existence < 0.0)
    if len(lost) or gone.any() or not among(every.track_id[every.confirmed], sure).all():
        tracks = method.current(progress.state)
        # single false alarms score less
        likely = (tracks.missed == 0) & (tracks.score > 0.0)
        likely &= ~rather_echoes(progress, tracks)
        new = tracks[(tracks.confirmed | likely) & ~among(tracks.track_id, sure)]
        start = end = np.zeros(0, np.int64)
        if len(new):
            coasting = tracks[tracks.confirmed & (tracks.missed > 0)]
            # trees of one target take turns in the best hypothesis of a multiple hypothesis tracker
            left = _best(known[known.confirmed & ~np.isin(known.track_id, tracks.track_id)])
            old = TrackBatch.concatenate([lost, coasting, left])
            start, end = _matched(progress, new, old, len(left)) if len(old) else (start, end)
        if len(start):
            ids, names = new.track_id[start], old.track_id[end]
            state = method.renamed(progress.state, ids, names)
            tracks = state.tracks.with_parents(names, old.parent[end])
            tracks = tracks.with_confirmed(tracks.confirmed | np.isin(tracks.track_id, names))
            echoes = None if state.echoes is None else state.echoes.renamed(ids, names)
            progress = progress._replace(state=state._replace(tracks=tracks, echoes=echoes))
            lost, step = lost[~np.isin(lost.track_id, names)], renamed(step, ids, names)
            step = replace(step, ended=np.setdiff1d(step.ended, names[np.isin(names, left.track_id)]))
    if len(step.ended):
        lost = TrackBatch.concatenate([lost, _best(known[np.isin(known.track_id, step.ended)])])
    return progress.with_state(lost=lost)._replace(step=step)


def _best(branches: TrackBatch) -> TrackBatch:
    """Of each track the branch with the best score."""
    branches = branches[np.lexsort((-branches.score, branches.track_id))]
    return branches[np.unique(branches.track_id, return_index=True)[1]]


def _predicted(progress: Progress) -> TrackBatch:
    """The ends that may still be taken up, predicted to the scan."""
    settings, lost, dt = progress.settings, progress.state.lost, progress.elapsed
    if not len(lost):
        return lost
    lost = lost.moved(predict_each(settings.filter, lost.states, np.full(len(lost), dt))) if dt else lost
    recent = progress.scan.time - lost.last_detection <= _KEPT * settings.life_cycle.lifetime
    return lost[recent & settings.births.narrow(places_of(settings.filter, lost.states)[1])]


def _matched(progress: Progress, new: TrackBatch, old: TrackBatch, left: int) -> tuple[Array, Array]:
    """Rows of new tracks and of the old ones that they continue; the last `left` of these may be of the same time."""
    settings = progress.settings
    motion, region = settings.filter.motion, settings.scene.region
    place, velocity = np.array(motion.position), velocity_components(motion)
    both = np.concatenate([place, velocity])
    after = new.started[:, None] > old.last_detection[None, :]
    after[:, len(old) - left :] = True
    # tentative tracks continue only those that are probably gone; existence is log odds
    after &= new.confirmed[:, None] | ((np.arange(len(old)) < len(old) - left) & (old.existence < 0.0))
    usual, n = settings.initiation.prior(motion)[1][velocity[:, None], velocity], len(place)
    prior = usual + new.states.covariance[:, velocity[:, None], velocity]
    width = np.maximum(region[:, 1] - region[:, 0], 1.0)[:n]
    born = -0.5 * (_square(new.states.mean[:, velocity], prior) + np.linalg.slogdet(2.0 * math.pi * prior)[1])
    born += math.log(settings.initiation.birth_rate) - np.log(width).sum()
    start, end = np.nonzero(after)
    if progress.state.identities is None:
        # too far apart along an axis, even for a manoeuvre or a flight at any usual speed
        room = -2.0 * born - np.linalg.slogdet(2.0 * math.pi * new.states.covariance[:, both[:, None], both])[1]
        for axis, rate in zip(place.tolist(), np.diagonal(usual).tolist(), strict=True):
            variance = new.states.covariance[start, axis, axis] + old.states.covariance[end, axis, axis]
            flown = np.maximum(new.last_detection[start] - old.last_detection[end], 0.0)
            away = new.states.mean[start, axis] - old.states.mean[end, axis]
            near = away**2 <= room[start] * (_WIDER * variance + rate * flown**2)
            start, end = start[near], end[near]
    off = new.states.mean[start][:, both] - old.states.mean[end][:, both]
    spread = (new.states.covariance[start] + old.states.covariance[end])[:, both[:, None], both]
    # where a track was lost its target may have manoeuvred more than the filter expects
    square, size = _square(off, spread), np.linalg.slogdet(2.0 * math.pi * spread)[1]
    wider = -0.5 * (square / _WIDER + size + len(both) * math.log(_WIDER)) + math.log(_MANOEUVRED)
    continued = np.logaddexp(math.log1p(-_MANOEUVRED - _ANYWHERE) - 0.5 * (square + size), wider)
    since = np.maximum(new.last_detection[start] - old.last_detection[end], 0.0)
    spread[:, :n, :n] += usual * (since**2)[:, None, None]
    spread[:, n:, n:] += usual
    free = -0.5 * (_square(off, spread) + np.linalg.slogdet(2.0 * math.pi * spread)[1]) + math.log(_ANYWHERE)
    # the likelier a track's target is still there, the less it has flown elsewhere
    continued = np.logaddexp(continued, free - np.logaddexp(0.0, old.existence[end]))
    # sensors may have missed it together: no less than a target that is missed until its track ends
    silent = progress.scan.time - old.last_detection[end]
    there = (
        np.maximum(-np.logaddexp(0.0, -old.existence[end]), math.log(OVERLOOKED))
        - silent / settings.life_cycle.lifetime
    )
    gain = there + continued - born[start]
    if progress.state.identities is not None:
        says, possible = progress.state.identities.of_tracks(old.track_id[end], new.track_id[start])
        gain = np.where(possible, gain + says, -np.inf)
    good = np.flatnonzero((gain > 0) & (new.confirmed[start] | (new.score[start] + gain > _SURE)))
    if not len(good):
        return start[:0], end[:0]
    pairs = np.stack([start, end], axis=1)[good]
    solution = progress.work.assign(AssignmentProblem(pairs + 1, -gain[good], [len(new), len(old)]))
    chosen = pairs[solution.indices[solution.indices < len(pairs)]]
    return chosen[:, 0], chosen[:, 1]


def _square(off: Array, spread: Array) -> Array:
    """Squared Mahalanobis distances, (K,)."""
    return np.asarray((off * np.linalg.solve(spread, off[:, :, None])[:, :, 0]).sum(axis=1))
