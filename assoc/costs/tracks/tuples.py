"""Candidate tuples of a track and measurements, and their costs under the track's predicted density.

The track's prediction is corrected with the measurements of a tuple one after the other; the logarithms of
the predictive densities add up to that of all of them together, and each enters against clutter. So the cost
of (track, z_1, ..., z_S) is the negative logarithm of p(z_1, ..., z_S | track) over "all are false alarms".
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from assoc._system import memory
from assoc._types import Array
from assoc.costs.gating import chi_square_quantiles
from assoc.costs.limits import MAX_TUPLES, refuse_of_tracks
from assoc.costs.tracks import depth_first
from assoc.costs.tracks.gating import Near, near_both, near_pairs
from assoc.costs.tracks.scores import ScoreTerms
from assoc.filters.base import Expected, Filter, Parts, complain
from assoc.filters.batches import concatenate, placed
from assoc.filters.kernels.gaussian import GOOD
from assoc.filters.measurement import Measurement, periods_of

# asking for the memory left would take longer than correcting so few tracks
_FEW = 100
# tracks are taken in blocks with about so many pairs: what is corrected for their tuples stays in the cache
_BLOCK = 12_000


class TrackTuples(NamedTuple):
    """M candidate tuples of T tracks; every track has one in which all sensors missed it."""

    track: Array
    """Row of the track, int (M,)."""
    rows: Array
    """1-based measurement of each sensor, 0 where it missed, int32 (M, S)."""
    costs: Array
    """(M,)."""


class TrackPairs(NamedTuple):
    """K measurements of one sensor in the gates of tracks."""

    track: Array
    measurement: Array
    """0-based."""
    log_likelihood: Array
    correct: Callable[[Array], Any]
    """The tracks' states corrected by the pairs in these rows: those that are used, not all."""


def gate_of(sensor: Measurement, probability: float) -> float:
    """Squared Mahalanobis distance within which this share of the measurements lies."""
    return float(chi_square_quantiles(float(probability), sensor.dim)[sensor.dim])


def track_pairs(filter: Filter[Any], states: Any, measurements: Array, sensor: Measurement, gate: float) -> TrackPairs:
    """Pairs of tracks and the measurements of one sensor in their gates."""
    if not len(states) or not len(measurements):
        nothing = np.zeros(0, dtype=np.int64)
        return TrackPairs(nothing, nothing, np.zeros(0), lambda rows: states[nothing])
    expected = filter.expected(states, sensor)
    track, found = near_pairs(expected, measurements, periods_of(sensor), gate)
    return _gated(filter, states, expected, measurements, sensor, gate, track, found)


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


def _gated(
    filter: Filter[Any], states: Any, expected: Expected, z: Array, sensor: Measurement, gate: float,
    track: Array, found: Array,
) -> TrackPairs:  # fmt: skip
    """Of these pairs those that are in the gate."""
    fit = filter.fit(states, expected, track, np.ascontiguousarray(z[found]), sensor) if len(track) else None
    if fit is None:
        return _corrected(filter, states, z, sensor, gate, track, found)
    inside = np.flatnonzero(fit.nis <= gate)
    track, found = track[inside], found[inside]

    def correct(rows: Array) -> Any:
        require_states(states, len(rows))
        if not len(rows):
            return states[rows]
        return filter.update(states[track[rows]], np.ascontiguousarray(z[found[rows]]), sensor).state

    return TrackPairs(track, found, fit.log_likelihood[inside], correct)


def _corrected(
    filter: Filter[Any], states: Any, z: Array, sensor: Measurement, gate: float, track: Array, found: Array
) -> TrackPairs:
    """The same with a filter that has to correct states to say how well measurements fit."""
    if not len(track):
        return TrackPairs(track, found, np.zeros(0), lambda rows: states[track])
    require_states(states, len(track))
    done = filter.update(states[track], np.ascontiguousarray(z[found]), sensor)
    inside = np.flatnonzero(done.nis <= gate)
    return TrackPairs(track[inside], found[inside], done.log_likelihood[inside], lambda rows: done.state[inside[rows]])


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
    margin: float = 0.0,
) -> TrackTuples:
    """Candidate tuples, ordered by track, of T predicted tracks and one measurement or none of each sensor.

    `misses` (T, S) is the score of a miss of each track by each sensor: ln(1 - P_d), less where it cannot see the
    track. A tuple that costs `margin` more than its track all missed is left out: false alarms cost 0, so that no best
    association contains it, though it may be the true one. LimitExceededError for more than `max_tuples`.
    """
    if not any(getattr(sensor, "measures_velocity", True) for sensor in sensors):
        filter, states = filter.positions_alone(states)
    growth = _Growth(
        filter, measurements, sensors, terms, _ahead(terms, misses),
        [gate_of(sensor, gate_probability) for sensor in sensors], [periods_of(sensor) for sensor in sensors],
        margin,
    )  # fmt: skip
    parts = filter.in_parts(states, sensors)
    if parts is None:
        return _in_blocks(growth, states, misses, max_tuples)
    return _depth_first(growth, parts, states, misses, max_tuples)


def corrected(
    filter: Filter[Any], states: Any, measurements: Sequence[Array], sensors: Sequence[Measurement], rows: Array
) -> tuple[Any, Array, Callable[[], Array]]:
    """The states of T tracks corrected by a tuple each, rows (T, S) of 1-based measurements, 0 where one missed.

    Also the log likelihood of each measurement given those before, and, computed when called, the sum of the NIS of
    each tuple; (T, S) and (T,), 0 where there is none.
    """
    log_likelihood, updates = np.zeros(rows.shape), []
    for s, (z, sensor) in enumerate(zip(measurements, sensors, strict=True)):
        seen = np.flatnonzero(rows[:, s])
        if len(seen):
            done = filter.update(states[seen], np.ascontiguousarray(z[rows[seen, s] - 1]), sensor)
            log_likelihood[seen, s] = done.log_likelihood
            updates.append((seen, s, done))
            states = placed(len(states), [(slice(None), states), (seen, done.state)])

    def squares() -> Array:
        nis = np.zeros(rows.shape)
        for seen, s, done in updates:
            nis[seen, s] = done.nis
        return np.asarray(nis.sum(axis=1))

    return states, log_likelihood, squares


class _Growth(NamedTuple):
    """What tuples of all tracks grow by."""

    filter: Filter[Any]
    measurements: Sequence[Array]
    sensors: Sequence[Measurement]
    terms: ScoreTerms
    ahead: Array
    gates: list[float]
    periods: list[tuple[float, ...]]
    margin: float


def _near(growth: _Growth, states: Any, s: int, z: Array) -> Near:
    """The measurements z of sensor s near each track."""
    expected = growth.filter.expected(states, growth.sensors[s])
    track, found = near_pairs(expected, z, growth.periods[s], growth.gates[s])
    return Near(np.searchsorted(track, np.arange(len(states) + 1)), found)


def _depth_first(growth: _Growth, parts: Parts, states: Any, misses: Array, max_tuples: int) -> TrackTuples:
    """The tuples of all tracks by the kernel, for filters that it knows."""
    widest = max(sensor.dim for sensor in growth.sensors)
    near, places, axes = [], [], []
    for s, (z, sensor) in enumerate(zip(growth.measurements, growth.sensors, strict=True)):
        # along the component that tells most of them apart
        spread = np.ptp(z, axis=0) / np.sqrt(np.diag(sensor.covariance)) if len(z) else np.zeros(sensor.dim)
        spread[np.array(growth.periods[s]) > 0.0] = 0.0
        axes.append(int(spread.argmax()) if spread.max() > 0.0 else -1)
        order = np.argsort(z[:, axes[s]], kind="stable")
        pairs = _near(growth, states, s, z[order])
        near.append(pairs._replace(found=order[pairs.found]))
        places.append(np.zeros((len(pairs.found), widest)))
        places[s][:, : sensor.dim] = z[near[s].found]
    begin = np.cumsum([0, *(len(pairs.found) for pairs in near)])[:-1, None]
    with np.errstate(divide="ignore"):
        logs = np.log(parts.weights)
    most = growth.margin - misses.sum(axis=1)
    status, track, rows, costs = depth_first.grow(
        depth_first.Tracks(parts.means, parts.covariances, parts.weights, logs, np.array(misses, order="C"), most),
        depth_first.sensors_of(parts.observations, growth.terms.detection, growth.ahead, np.array(growth.gates)),
        depth_first.Measured(
            begin + [pairs.first for pairs in near], np.concatenate([pairs.found for pairs in near]),
            np.concatenate(places), np.array(axes),
        ),
        max_tuples,
    )  # fmt: skip
    if status != GOOD:
        complain(status)
    if len(track) > max_tuples:
        # ordered by track: extrapolated to those left
        work = np.sum([pairs.first for pairs in near], axis=0)
        raise refuse_of_tracks(len(track) * work[-1] / work[int(track[-1]) + 1], max_tuples)
    return TrackTuples(track, rows, costs)


def _in_blocks(growth: _Growth, states: Any, misses: Array, max_tuples: int) -> TrackTuples:
    """The same sensor by sensor, for all filters."""
    near = [_near(growth, states, s, z) for s, z in enumerate(growth.measurements)]
    count, work = len(states), np.sum([pairs.first for pairs in near], axis=0)
    blocks: list[TrackTuples] = []
    low = made = 0
    while low < count or not blocks:
        high = min(max(low + 1, int(np.searchsorted(work, work[low] + _BLOCK, side="right")) - 1), count)
        here = [Near(pairs.first[low : high + 1] - pairs.first[low], pairs.found[pairs.first[low] : pairs.first[high]])
                for pairs in near]  # fmt: skip
        block = _grown(growth, states[low:high], misses[low:high], here, max_tuples - made)
        made += len(block.track)
        if made > max_tuples:
            raise refuse_of_tracks(made * work[-1] / work[high], max_tuples)
        blocks.append(block._replace(track=low + block.track))
        low = high
    return TrackTuples(*(np.concatenate(arrays) for arrays in zip(*blocks, strict=True)))


def _grown(growth: _Growth, states: Any, misses: Array, near: Sequence[Near], most: int) -> TrackTuples:
    """The tuples of some tracks, ordered; it ends early where there are more than `most`."""
    filter, last = growth.filter, len(growth.sensors) - 1
    track = np.arange(len(states))
    rows = np.zeros((len(states), len(growth.sensors)), dtype=np.int32)
    costs = np.zeros(len(states))
    alone = growth.margin - misses.sum(axis=1)
    for s, (z, sensor, gate) in enumerate(zip(growth.measurements, growth.sensors, growth.gates, strict=True)):
        expected = filter.expected(states, sensor)
        if s:
            # measurements so far narrow the gate
            parent, found = near_both(expected, track, near[s], z, growth.periods[s], gate, most)
        else:
            parent, found = np.repeat(track, np.diff(near[0].first)), near[0].found
        if len(parent) + len(track) > most:
            track = np.concatenate([track, track[parent]])
            return TrackTuples(track, np.zeros((len(track), rows.shape[1]), np.int32), np.zeros(len(track)))
        done = _gated(filter, states, expected, z, sensor, gate, parent, found)
        new = rows[done.track]
        new[:, s] = done.measurement + 1
        costs = np.concatenate(
            [costs - misses[track, s], costs[done.track] - done.log_likelihood - growth.terms.detection[s]]
        )
        rows = np.concatenate([rows, new])
        track = np.concatenate([track, track[done.track]])
        # the sensors left must be able to bring the cost below the most that is kept
        hopeful = np.flatnonzero((costs - growth.ahead[s + 1] < alone[track]) | ~rows.any(axis=1))
        if s < last:
            old = int(np.searchsorted(hopeful, len(states)))
            states = concatenate([states[hopeful[:old]], done.correct(hopeful[old:] - len(states))])
        costs, rows, track = costs[hopeful], rows[hopeful], track[hopeful]
    order = np.lexsort((*rows.T[::-1], track))
    return TrackTuples(track[order], rows[order], costs[order])


def _ahead(terms: ScoreTerms, misses: Array) -> Array:
    """The most that sensors s, s + 1, ... can take off a cost, (S + 1,): no density is above the noise's own."""
    gain = np.maximum(terms.detection + terms.peak, misses.max(axis=0, initial=-np.inf))
    return np.append(np.cumsum(gain[::-1])[::-1], 0.0)
