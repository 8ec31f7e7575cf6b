"""Candidate tuples of a track and measurements, and their costs under the track's predicted density.

The track's prediction is corrected with the measurements of a tuple one after the other; the logarithms of
the predictive densities add up to that of all of them together, and each enters against clutter. So the cost
of (track, z_1, ..., z_S) is the negative logarithm of p(z_1, ..., z_S | track) over "all are false alarms".
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from assoc._system import memory
from assoc._types import Array
from assoc.costs.gating import chi_square_quantiles
from assoc.costs.limits import MAX_TUPLES
from assoc.costs.tracks.gating import Near, angular_components, near_both, near_pairs
from assoc.costs.tracks.scores import ScoreTerms
from assoc.errors import LimitExceededError
from assoc.filters.base import Filter
from assoc.filters.batches import concatenate
from assoc.filters.measurement import Measurement

# asking for the memory left would take longer than correcting so few tracks
_FEW = 100


class TrackTuples(NamedTuple):
    """M candidate tuples of T tracks; every track has one in which all sensors missed it."""

    track: Array
    """Row of the track, int (M,)."""
    rows: Array
    """1-based measurement of each sensor, 0 where it missed, int32 (M, S)."""
    costs: Array
    """(M,)."""
    states: Any
    """The corrected states, one for each tuple."""


class TrackPairs(NamedTuple):
    """K measurements of one sensor in the gates of tracks, and the tracks corrected by them."""

    track: Array
    measurement: Array
    """0-based."""
    log_likelihood: Array
    states: Any


def gate_of(sensor: Measurement, probability: float) -> float:
    """Squared Mahalanobis distance within which this share of the measurements lies."""
    return float(chi_square_quantiles(float(probability), sensor.dim)[sensor.dim])


def track_pairs(filter: Filter[Any], states: Any, measurements: Array, sensor: Measurement, gate: float) -> TrackPairs:
    """Correct tracks by every measurement of one sensor in their gates."""
    nothing = np.zeros(0, dtype=np.int64)
    if not len(states) or not len(measurements):
        return TrackPairs(nothing, nothing, np.zeros(0), states[nothing])
    track, found = near_pairs(filter.expected(states, sensor), measurements, angular_components(sensor), gate)
    return _corrected(filter, states, measurements, sensor, gate, track, found)


def require_states(states: Any, count: int) -> None:
    """Refuse to correct more tracks than memory allows."""
    if count <= _FEW:
        return
    arrays = [value for value in vars(states).values() if isinstance(value, np.ndarray)] if len(states) else []
    each = sum(array.nbytes for array in arrays) / max(len(states), 1)
    # selected, corrected, and a filter's temporaries
    memory.require(
        4.0 * each * count,
        f"{count} pairs of {len(states)} tracks and measurements",
        "lower gate_probability, or end uncertain tracks sooner",
    )


def _corrected(
    filter: Filter[Any], states: Any, measurements: Array, sensor: Measurement, gate: float, track: Array, found: Array
) -> TrackPairs:
    if not len(track):
        return TrackPairs(track, found, np.zeros(0), states[track])
    require_states(states, len(track))
    done = filter.update(states[track], np.ascontiguousarray(measurements[found]), sensor)
    inside = done.nis <= gate
    if inside.all():
        return TrackPairs(track, found, done.log_likelihood, done.state)
    return TrackPairs(track[inside], found[inside], done.log_likelihood[inside], done.state[inside])


def grow_track_tuples(
    filter: Filter[Any],
    states: Any,
    measurements: Sequence[Array],
    sensors: Sequence[Measurement],
    terms: ScoreTerms,
    misses: Array,
    *,
    gate_probability: float,
    max_tuples: int = MAX_TUPLES,
) -> TrackTuples:
    """Candidate tuples of predicted tracks and one measurement or none of each sensor.

    Parameters
    ----------
    filter : Filter
    states
        The T predicted states.
    measurements : sequence over sensors of arrays (n_s, d_s)
    sensors : sequence of Sensor
    terms : ScoreTerms
        Of these sensors.
    misses : array (T, S)
        Score of a miss of each track by each sensor: ln(1 - P_d), less where it cannot see the track.
    gate_probability : float
        Share of true measurements that a gate lets through.
    max_tuples : int
        The most tuples that may be made.

    Returns
    -------
    TrackTuples
        Ordered by track. A tuple that costs as much as its track all missed is left out: false alarms cost 0.

    Raises
    ------
    LimitExceededError
        There are more tuples than `max_tuples`.
    """
    count = len(states)
    track = np.arange(count)
    rows = np.zeros((count, len(sensors)), dtype=np.int32)
    costs = np.zeros(count)
    grown = states
    alone, ahead = -misses.sum(axis=1), _ahead(sensors, terms, misses)
    for s, (z, sensor) in enumerate(zip(measurements, sensors, strict=True)):
        gate = gate_of(sensor, gate_probability)
        angles = angular_components(sensor)
        parent, found = near_pairs(filter.expected(states, sensor), z, angles, gate)
        if s:
            # measurements so far narrow the gate
            near = Near(np.searchsorted(parent, np.arange(count + 1)), found)
            parent, found = near_both(filter.expected(grown, sensor), track, near, z, angles, gate, max_tuples)
        if len(parent) + len(track) > max_tuples:
            # ordered by tuple: extrapolated to those left
            about = len(track) + len(parent) * len(track) / (int(parent[-1]) + 1 if len(parent) else 1)
            raise LimitExceededError(
                f"about {about:.3g} candidate tuples of tracks and measurements, "
                f"more than max_tuples = {max_tuples}; lower gate_probability or raise max_tuples"
            )
        done = _corrected(filter, grown, z, sensor, gate, parent, found)
        new = rows[done.track]
        new[:, s] = done.measurement + 1
        missed = costs - misses[track, s]
        costs = np.concatenate([missed, costs[done.track] - done.log_likelihood - terms.detection[s]])
        rows = np.concatenate([rows, new])
        track = np.concatenate([track, track[done.track]])
        grown = concatenate([grown, done.states])
        # the sensors left must be able to bring the cost below that of a track all missed
        hopeful = np.flatnonzero((costs - ahead[s + 1] < alone[track]) | ~rows.any(axis=1))
        if len(hopeful) < len(rows):
            costs, rows, track, grown = costs[hopeful], rows[hopeful], track[hopeful], grown[hopeful]
    order = np.lexsort((*rows.T[::-1], track))
    return TrackTuples(track[order], rows[order], costs[order], grown[order])


def _ahead(sensors: Sequence[Measurement], terms: ScoreTerms, misses: Array) -> Array:
    """The most that sensors s, s + 1, ... can take off a cost, (S + 1,): no density is above the noise's own."""
    peak = [-0.5 * float(np.linalg.slogdet(2.0 * math.pi * sensor.covariance)[1]) for sensor in sensors]
    gain = np.maximum(terms.detection + np.array(peak), misses.max(axis=0, initial=-np.inf))
    return np.append(np.cumsum(gain[::-1])[::-1], 0.0)
