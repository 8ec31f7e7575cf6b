"""Targets that are faster than the prior of new tracks allows: seen by what they leave behind."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from assoc.costs.views import places_of
from assoc.filters import ConstantVelocity, ExtendedKalmanFilter, FreeFlight, InteractingMultipleModel
from assoc.filters.base import Filter
from assoc.tracking.progress import Progress
from assoc.tracking.records.initiation import velocity_components
from assoc.tracking.records.track_batch import TrackBatch
from assoc.tracking.settings import TrackerSettings

# a speed is excluded by the prior at so many standard deviations along an axis
_EXCLUDED = 3.0
# starts in a row are on a line if the third is at most this share of a step off it; two such rows or more count if they
# come about by chance with less than this probability. A scan with a prior too wide does little harm
_OFF, _CHANCE = 0.15, 2e-4
_MOST = 40
_ESCAPE = 12e3
"""Nothing stays at the Earth that is faster, m/s."""
_FREE = 1000.0
"""Nothing flies faster than this, m/s, on wings for long."""


def use_speeds(progress: Progress) -> Progress:
    """Stage: widen the prior of velocities for targets that are faster.

    Confirmed tracks say how fast they are. Where the prior excludes what is there, tracks begin anew at each scan and
    go nowhere: three such starts in a row, on a line and equally far apart, are a target.
    """
    prior = float(np.max(progress.settings.initiation.speed))
    found = max(speed_of_tracks(progress.settings, progress.state.tracks), _of_starts(progress, prior))
    if found <= _EXCLUDED * prior:
        return progress
    # in few steps: each is a set of settings of its own
    speed = prior * 2.0 ** math.ceil(math.log2(found / prior))
    return progress._replace(settings=_faster(progress.settings, speed))


@lru_cache(maxsize=16)
def _faster(settings: TrackerSettings, speed: float) -> TrackerSettings:
    filter = falling(settings.filter) if speed > _FREE else settings.filter
    return replace(settings, initiation=replace(settings.initiation, speed=speed), filter=filter)


def falling(filter: Filter[Any]) -> Filter[Any]:
    """A filter like this one, with free flight in place of constant velocity in space."""
    if type(filter) is InteractingMultipleModel:
        models: list[Any] = [falling(model) for model in filter.filters]
        return InteractingMultipleModel(models, filter.transition, filter.weights, interval=filter.interval)
    motion = filter.motion
    if type(filter) is not ExtendedKalmanFilter or type(motion) is not ConstantVelocity or len(motion.position) < 3:
        return filter
    return ExtendedKalmanFilter(FreeFlight(motion.sigma)) if motion.kind == "continuous" else filter


def speed_of_tracks(settings: TrackerSettings, tracks: TrackBatch, at_most: bool = False) -> float:
    """Root mean square of the speeds of confirmed tracks that are sure of them, along an axis.

    If none is: 0, or `at_most` what they may be.
    """
    components, tracks = velocity_components(settings.filter.motion), tracks[tracks.confirmed]
    if not len(tracks) or not len(components):
        return 0.0
    square = (tracks.states.mean[:, components] ** 2).sum(axis=1)
    unsure = np.einsum("bii->bi", tracks.states.covariance[:, components][:, :, components]).sum(axis=1)
    sure = square > 9.0 * unsure
    if not sure.any():
        return math.sqrt(float((square + unsure).mean()) / len(components)) if at_most else 0.0
    return math.sqrt(float(square[sure].mean()) / len(components))


def _of_starts(progress: Progress, prior: float) -> float:
    """The same of targets of which single scans alone are known: starts in a row."""
    settings, tracks = progress.settings, progress.state.tracks
    alone = tracks[(tracks.started == tracks.last_detection) & (tracks.score > 0.0)]
    when = np.unique(alone.started)[-3:]
    if len(when) < 3:
        return 0.0
    axes = len(settings.filter.motion.position)
    parts = [alone[alone.started == time] for time in when]
    if max(map(len, parts)) > _MOST:
        return 0.0
    first, second, third = (places_of(settings.filter, part.states)[0][:, :axes] for part in parts)
    step = (second[None] - first[:, None]).reshape(-1, axes)
    long = np.linalg.norm(step, axis=1)
    # not divided before: what is far beyond all speeds may be beyond floats
    apart = when[1] - when[0]
    fast = (long > _EXCLUDED * prior * math.sqrt(axes) * apart) & (long < _ESCAPE * apart)
    i, j = (index[fast] for index in np.divmod(np.arange(len(step)), len(second)))
    step, long = step[fast], long[fast]
    ahead = second[j] + step * (when[2] - when[1]) / apart
    off = np.linalg.norm(third[None] - ahead[:, None], axis=2)
    rows, ends = np.nonzero(off < _OFF * long[:, None])
    volume = float(np.prod(np.maximum(np.diff(settings.scene.region[:axes], axis=1), 1.0)))
    ball = math.pi if axes == 2 else 4.0 / 3.0 * math.pi
    chance = len(third) / volume * ball * float(((_OFF * long) ** axes).sum())
    count = min(len(np.unique(column)) for column in (i[rows], j[rows], ends))
    if count < 2 or chance**count > _CHANCE * math.factorial(count):
        return 0.0
    return float(np.sqrt(((long[rows] / apart) ** 2).mean() / axes))
