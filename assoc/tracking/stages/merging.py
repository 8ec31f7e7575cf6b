"""Two tracks of one target are found, and merged.

After a manoeuvre an old and a new track may share the measurements of one target: each scan some sensors feed the one,
some the other. No score ends that. But a sensor detects one target once in a scan, and two targets often twice. For
each pair of confirmed tracks that may be in one place, the scans are counted in which a sensor that covered both fed
the one, the other, or none; a scan in which a sensor fed both begins the count anew. The counts are weighed as "one
target, detected with P" against "two targets, each detected with P, independently", averaged over P, whose prior is
about the declared detection probability.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from assoc._types import Array
from assoc.costs.gating import chi_square_quantiles
from assoc.costs.tracks.gating import near_pairs
from assoc.filters.base import Expected
from assoc.tracking.progress import Progress
from assoc.tracking.records.doubles import Doubles
from assoc.tracking.records.track import renamed
from assoc.tracking.records.track_batch import TrackBatch
from assoc.tracking.stages.coverage import dwells

FALSE_MERGE = 1e-6
"""Probability of so much evidence where there are two targets."""

# positions of tracks of one target differ by less in this share of scans; variances are larger in manoeuvres
_TOGETHER, _WIDER = 0.99, 4.0
# with joint probabilities: more detections of two tracks than this are two
_BOTH = 1.5


def merge(progress: Progress) -> Progress:
    """Stage: find tracks of one target; the older id goes on with the more precise state."""
    method, state, step = progress.settings.method, progress.state, progress.step
    assert step is not None
    tracks = method.current(state)
    tracks = tracks[tracks.confirmed]
    first, second = _near(progress, tracks)
    if not len(first):
        return progress.with_state(doubles=Doubles.none(len(progress.settings.sensors)))
    fed, dwelled = method.detected(state._replace(tracks=tracks), step), dwells(progress, tracks.states)
    a, b, covered = fed[first], fed[second], dwelled[first] & dwelled[second]
    total = np.maximum(a + b, 1.0)
    new = np.stack([a / total, b / total, 1.0 - (a + b) / total], axis=2)
    # where no sensor detects either, both may be out of sight
    new *= (covered & (a + b > 0.5).any(axis=1)[:, None])[..., None]
    if progress.shared is not None:
        # what a sensor did not resolve says nothing
        apart = 1.0 - progress.shared.of(tracks.track_id[first], tracks.track_id[second])
        new *= apart[..., None]
        a, b = a * (apart > 0.0), b * (apart > 0.0)
    doubles = state.doubles.of(np.stack([tracks.track_id[first], tracks.track_id[second]], axis=1))
    counts = np.where((a + b > _BOTH).any(axis=1)[:, None, None], 0.0, doubles.counts + new)
    doubles = doubles._replace(counts=counts)
    ratio = doubles.one_target(np.array([sensor.detection_probability for sensor in progress.settings.sensors]))
    found = np.flatnonzero(ratio > -math.log(FALSE_MERGE))
    # each track once, the surest pairs first
    chosen: list[tuple[int, int]] = []
    for k in found[np.argsort(-ratio[found], kind="stable")].tolist():
        if not {first[k], second[k]} & {row for pair in chosen for row in pair}:
            chosen.append((first[k], second[k]))
    progress = progress.with_state(doubles=doubles)
    return merged(progress, tracks, np.array(chosen)) if chosen else progress


def _near(progress: Progress, tracks: TrackBatch) -> tuple[Array, Array]:
    """Rows of pairs of tracks whose targets may be in one place, the lower id first."""
    axes = np.array(progress.settings.filter.motion.position)
    mean, covariance = tracks.states.mean[:, axes], _WIDER * tracks.states.covariance[:, axes[:, None], axes]
    gate = float(chi_square_quantiles(_TOGETHER, len(axes))[len(axes)])
    # twice the larger covariance is no less than the sum
    wide = Expected(np.ascontiguousarray(mean), 2.0 * covariance)
    first, second = near_pairs(wide, wide.mean, (False,) * len(axes), gate)
    if len(first) <= len(mean):
        # each is near itself alone
        return first[:0], second[:0]
    pairs = np.stack([first, second], axis=1)
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    pairs = np.unique(np.sort(pairs, axis=1), axis=0)
    lower = tracks.track_id[pairs[:, 0]] < tracks.track_id[pairs[:, 1]]
    first, second = np.where(lower[:, None], pairs, pairs[:, ::-1]).T
    off, spread = mean[first] - mean[second], covariance[first] + covariance[second]
    square = (off * np.linalg.solve(spread, off[:, :, None])[:, :, 0]).sum(axis=1)
    return first[square <= gate], second[square <= gate]


def merged(progress: Progress, tracks: TrackBatch, pairs: Array) -> Progress:
    """The step with the second track of each pair merged into the first."""
    method, step = progress.settings.method, progress.step
    assert step is not None
    axes = np.array(progress.settings.filter.motion.position)
    size = np.linalg.det(tracks.states.covariance[:, axes[:, None], axes])
    stays, goes = tracks.track_id[pairs].T
    # the one that gets the older name; what had that name ends, and so does a track under its own name
    kept = np.where(size[pairs[:, 1]] < size[pairs[:, 0]], stays, goes)
    state = method.renamed(progress.state, goes, kept)
    state = state._replace(tracks=state.tracks.with_parents(stays, tracks.parent[pairs[:, 0]]))
    step = renamed(step, goes, stays)
    ended = np.sort(np.concatenate([step.ended, goes]))
    merged = np.stack([goes, stays], axis=1)
    return progress._replace(state=state, step=replace(step, ended=ended, merged=merged))
