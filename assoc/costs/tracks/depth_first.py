"""The candidate tuples of tracks grown depth-first, in one kernel: only the states of one branch are held at a time.

A partial tuple has measurements of the sensors before s, or misses. It is continued by a miss of sensor s and by each
of the sensor's measurements in its gate. All that share a partial tuple share gain and covariance; and where a sensor
is linear, so do all partial tuples of a track in which the same sensors detected it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from assoc._system.compiled import inner_njit, lean_inner_njit, literal_njit, njit
from assoc._types import Array
from assoc.filters.kernels.gaussian import (
    BAD_COVARIANCE,
    GOOD,
    LINEAR,
    LOG_TURN,
    STATUSES,
    H,
    R,
    V,
    blur,
    correct,
    correct_mean,
    folding_of,
    innovate,
    linearise_at,
    squared,
)
from assoc.filters.kernels.linear_algebra import factor
from assoc.filters.measurement import Observation
from assoc.sensors.codes import POSITION
from assoc.sensors.kernels.dispatch import fold, wrap

# what comes next for a sensor, if not a number in its queue; what is told instead of a number of tuples
_MISS, _NEW = -1, -2
_BAD, _FULL = -1, -2

_Made = tuple[Array, Array, Array]


class Tracks(NamedTuple):
    """T predicted tracks, mixtures of m Gaussians, and their scores."""

    means: Array  # (T, m, n)
    covariances: Array  # (T, m, n, n)
    weights: Array  # (T, m)
    logs: Array  # of the weights, (T, m)
    misses: Array  # score of a miss by each sensor, (T, S)
    most: Array  # tuples of a track with measurements cost less, (T,)


class Sensors(NamedTuple):
    """S sensors of at most D quantities that read at most C columns; see `assoc.filters.kernels.gaussian.unpack`."""

    sizes: Array  # code, numbers of quantities and of columns, int (S, 3)
    positions: Array  # (S, 3)
    columns: Array  # int (S, C)
    matrices: Array  # (S, D, C)
    noise: Array  # (S, D, D)
    detection: Array  # score of a detection, but for the density of the measurement, (S,)
    ahead: Array  # the most that sensors s, s + 1, ... can take off a cost, (S + 1,)
    gates: Array  # squared Mahalanobis distances, (S,)


class Measured(NamedTuple):
    """K measurements near tracks: of sensor s and track t those from first[s, t] to first[s, t + 1]."""

    first: Array  # int (S, T + 1)
    found: Array  # their numbers from 0, int (K,)
    places: Array  # (K, D), those of a track ascending along the axis
    axes: Array  # a component, or -1: in any order, int (S,)


class _Space(NamedTuple):
    """Working space, for states that sensor s - 1 has made at 2 s - 1 and 2 s, at 0 that of the track.

    What belongs to a sensor is there twice (see `_side`), so that misses do not drive out what others share.
    """

    means: Array  # of states, (2 S + 1, m, n)
    covariances: Array
    weights: Array  # of the components of states, and their logarithms, (2 S + 1, 2, m)
    versions: Array  # numbers that change with the states' covariances, the last one given, int (2 S + 2,)
    at: Array  # the state of the partial tuple before each sensor, int (S,)
    seen: Array  # the version that a sensor was last linearised with, and whether it is corrected, int (S, 2, 2)
    linear: Array  # see `assoc.filters.kernels.gaussian.H`, (S, 2, m, 3, ...)
    work: Array  # see `assoc.filters.kernels.gaussian.X`, (S, 2, m, 6, ...)
    S: Array  # covariances of residuals, (S, 2, m, D, D)
    log_dets: Array  # theirs, (S, 2, m)
    h: Array  # expected measurements, (S, m, D)
    v: Array  # residuals, (m, D)
    middle: Array  # expected measurement of the mixture, (D,)
    whole: Array  # covariance of the mixture's residual, and its factor with the diagonal inverted, (2, D, D)
    joint: Array  # logarithms of weights times likelihoods, (m,)
    queue: Array  # measurements in the gate, int (S, most of a track)
    queued: Array  # how many they are, int (S,)
    following: Array  # which is next, int (S,)
    row: Array  # the partial tuple, int (S,)
    cost: Array  # of its beginnings, (S + 1,)


def sensors_of(models: Sequence[Observation], detection: Array, ahead: Array, gates: Array) -> Sensors:
    """Put sensors beside each other for the kernel."""
    D = max(model.dim for model in models)
    sizes, positions = np.zeros((len(models), 3), np.int64), np.zeros((len(models), 3))
    C = max(int(model.packed[0, 2]) for model in models)
    columns, matrices = np.zeros((len(models), C), np.int64), np.zeros((len(models), D, C))
    noise = np.zeros((len(models), D, D))
    for s, model in enumerate(models):
        packed, d, c = model.packed[0], model.dim, int(model.packed[0, 2])
        sizes[s], positions[s], columns[s, :c] = (model.code, d, c), packed[3:6], packed[6 : 6 + c].view(np.int64)
        matrix = packed[6 + c : -d * d].reshape(-1, c)
        matrices[s, : len(matrix), :c], noise[s, :d, :d] = matrix, model.covariance[0]
    return Sensors(sizes, positions, columns, matrices, noise, detection, ahead, gates)


@inner_njit
def _space(tracks: Tracks, sensors: Sensors, near: Measured) -> _Space:
    _, m, n = tracks.means.shape
    S, D = len(sensors.gates), near.places.shape[1]
    wide, longest = max(n, D), 1
    for s in range(S):
        for t in range(len(tracks.means)):
            longest = max(longest, near.first[s, t + 1] - near.first[s, t])
    linear = np.zeros((S, 2, m, 3, D, max(3, n, D)))
    for s in range(S):
        d = sensors.sizes[s, 1]
        for bit in range(2):
            for j in range(m):
                for a in range(d):
                    for e in range(d):
                        linear[s, bit, j, R, a, e] = sensors.noise[s, a, e]
    return _Space(
        np.empty((2 * S + 1, m, n)), np.empty((2 * S + 1, m, n, n)), np.empty((2 * S + 1, 2, m)),
        np.zeros(2 * S + 2, np.int64), np.zeros(S, np.int64), np.zeros((S, 2, 2), np.int64), linear,
        np.empty((S, 2, m, 6, wide, wide)), np.empty((S, 2, m, D, D)), np.empty((S, 2, m)), np.empty((S, m, D)),
        np.empty((m, D)), np.empty(D), np.zeros((2, D, D)), np.empty(m), np.empty((S, longest), np.int64),
        np.zeros(S, np.int64), np.zeros(S, np.int64), np.zeros(S, np.int32), np.zeros(S + 1),
    )  # fmt: skip


@njit
def grow(tracks: Tracks, sensors: Sensors, near: Measured, most: int) -> tuple[int, Array, Array, Array]:
    """Tuples of tracks: track (M,), 1-based measurements (M, S) and costs (M,), ordered by tracks and measurements.

    It ends with the first track at which there are more than `most`. The first number is a status as of
    `assoc.filters.kernels.gates.fits`.
    """
    S = len(sensors.gates)
    space = _space(tracks, sensors, near)
    made = np.empty(1024, np.int64), np.empty((1024, S), np.int32), np.empty(1024)
    count, t, status = 0, 0, GOOD
    while t < len(tracks.means) and count <= most:
        after = _of_track(tracks, sensors, near, t, space, made, count)
        if after == _BAD:
            status = BAD_COVARIANCE + STATUSES * t
            break
        if after == _FULL:
            made = _doubled(made)
        else:
            count, t = after, t + 1
    track, rows, costs = made
    return status, track[:count], rows[:count], costs[:count]


@inner_njit
def _doubled(made: _Made) -> _Made:
    """Copies with twice the room."""
    track, rows, costs = made
    M, S = rows.shape
    more, more_rows, more_costs = np.empty(2 * M, np.int64), np.empty((2 * M, S), np.int32), np.empty(2 * M)
    for k in range(M):
        more[k], more_costs[k] = track[k], costs[k]
        for s in range(S):
            more_rows[k, s] = rows[k, s]
    return more, more_rows, more_costs


@lean_inner_njit
def _of_track(tracks: Tracks, sensors: Sensors, near: Measured, t: int, space: _Space, made: _Made, count: int) -> int:
    """Write the tuples of a track after those that were made before; how many there are then, _FULL or _BAD."""
    track, rows, costs = made
    row, cost, following, queued = space.row, space.cost, space.following, space.queued
    s, found, last = 0, 0, len(sensors.gates) - 1
    _begin(tracks, t, space)
    following[0] = _NEW
    while s >= 0:
        if following[s] == _NEW:
            queued[s] = _look(sensors, near, t, s, space)
            if queued[s] == _BAD:
                return _BAD
            following[s], row[s] = _MISS, 0
        at = following[s]
        if at == queued[s]:
            found -= row[s] > 0
            s -= 1
            continue
        following[s] += 1
        likelihood = 0.0
        if at == _MISS:
            cost[s + 1] = cost[s] - tracks.misses[t, s]
        else:
            found += row[s] == 0
            k = space.queue[s, at]
            row[s] = near.found[k] + 1
            likelihood = _likelihood(sensors, near, k, s, space)
            cost[s + 1] = cost[s] - likelihood - sensors.detection[s]
        # the sensors left must be able to bring the cost below the most that is kept
        if not (cost[s + 1] - sensors.ahead[s + 1] < tracks.most[t] or found == 0):
            continue
        if s < last:
            space.at[s + 1] = space.at[s]
            if at != _MISS:
                _correct(sensors, s, likelihood, space)
            s += 1
            following[s] = _NEW
            continue
        if count == len(track):
            return _FULL
        track[count], costs[count] = t, cost[last + 1]
        for i in range(last + 1):
            rows[count, i] = row[i]
        count += 1
    return count


@lean_inner_njit
def _version(space: _Space) -> int:
    """A new number."""
    space.versions[-1] += 1
    return space.versions[-1]


@lean_inner_njit
def _begin(tracks: Tracks, t: int, space: _Space) -> None:
    """Make the state of a track the first one."""
    _, m, n = tracks.means.shape
    space.versions[0], space.at[0] = _version(space), 0
    for j in range(m):
        space.weights[0, 0, j] = tracks.weights[t, j]
        space.weights[0, 1, j] = tracks.logs[t, j]
        for i in range(n):
            space.means[0, j, i] = tracks.means[t, j, i]
            for k in range(n):
                space.covariances[0, j, i, k] = tracks.covariances[t, j, i, k]


@lean_inner_njit
def _side(s: int, at: int) -> int:
    """Which of the two places of sensor s is for a state: 1 if the sensor before has made it."""
    return 1 if at >= 2 * s - 1 else 0


@lean_inner_njit
def _look(sensors: Sensors, near: Measured, t: int, s: int, space: _Space) -> int:
    """Expect a measurement of sensor s, and queue those in the gate, ascending; how many, or _BAD."""
    at, d = space.at[s], sensors.sizes[s, 1]
    side = _side(s, at)
    code, c, m = sensors.sizes[s, 0], sensors.sizes[s, 2], space.weights.shape[2]
    position, columns, matrix = sensors.positions[s], sensors.columns[s, :c], sensors.matrices[s]
    known = (code == LINEAR or code == POSITION) and space.seen[s, side, 0] == space.versions[at]
    for j in range(m):
        if known:
            _expect(code, columns, matrix, space.means[at, j], space.h[s, j, :d])
        else:
            linear = space.linear[s, side, j]
            linearise_at(code, position, columns, matrix, space.means[at, j], space.h[s, j, :d], linear[H])
            P, work, S = space.covariances[at, j], space.work[s, side, j], space.S[s, side, j]
            folding = folding_of(code, matrix)
            if folding > 0.0:
                blur(folding, P, columns, sensors.noise[s], linear[H], linear[R])
            if d == 3 and c == 3:
                good, space.log_dets[s, side, j] = innovate(3, 3, P, columns, linear, work, S)
            else:
                good, space.log_dets[s, side, j] = innovate(d, c, P, columns, linear, work, S)
            if not good:
                return _BAD
    if not known:
        space.seen[s, side, 0], space.seen[s, side, 1] = space.versions[at], 0
    if not (_mix(3, code, 0.0, s, at, space) if d == 3 else _mix(d, code, folding_of(code, matrix), s, at, space)):
        return _BAD
    return _queue(sensors, near, code, t, s, space)


@lean_inner_njit
def _expect(code: int, columns: Array, matrix: Array, mean: Array, h: Array) -> None:
    """Write the measurement of a linear sensor that is expected of a mean into h (d,)."""
    for a in range(len(h)):
        if code == POSITION:
            h[a] = mean[columns[a]]
            continue
        total = 0.0
        for p in range(len(columns)):
            total += matrix[a, p] * mean[columns[p]]
        h[a] = total


@literal_njit
def _mix(d: int, code: int, folding: float, s: int, at: int, space: _Space) -> bool:
    """Mean and covariance of the expected measurements of all components, and its factor, the diagonal inverted."""
    side, m = _side(s, at), space.weights.shape[2]
    weights, middle, v, S, L = space.weights[at, 0], space.middle, space.v, space.whole[0], space.whole[1]
    for a in range(d):
        middle[a] = 0.0
        for e in range(a + 1):
            S[a, e] = 0.0
    for j in range(m):
        for a in range(d):
            v[j, a] = space.h[s, j, a] - space.h[s, 0, a]
        wrap(code, v[j])
        fold(folding, v[j])
        for a in range(d):
            middle[a] += weights[j] * v[j, a]
    for j in range(m):
        for a in range(d):
            for e in range(a + 1):
                away = (v[j, a] - middle[a]) * (v[j, e] - middle[e])
                S[a, e] += weights[j] * (space.S[s, side, j, a, e] + away)
    for a in range(d):
        middle[a] += space.h[s, 0, a]
    good = factor(S, d, L)
    # measurements are many: they are multiplied
    for a in range(d if good else 0):
        L[a, a] = 1.0 / L[a, a]
    return bool(good)


@lean_inner_njit
def _queue(sensors: Sensors, near: Measured, code: int, t: int, s: int, space: _Space) -> int:
    """Queue the measurements of sensor s in the gate of what `_mix` has found, ascending; how many."""
    d, gate, axis = sensors.sizes[s, 1], sensors.gates[s], near.axes[s]
    places, queue, middle, v, L = near.places, space.queue, space.middle, space.v[0], space.whole[1]
    low, high, end = near.first[s, t], near.first[s, t + 1], math.inf
    if axis >= 0:
        reach = math.sqrt(gate * space.whole[0, axis, axis]) * (1.0 + 1e-9)
        end = middle[axis] + reach
        low = _not_below(places, axis, middle[axis] - reach, low, high)
    count, turns = 0, (code, folding_of(code, sensors.matrices[s]))
    for k in range(low, high):
        if axis >= 0 and places[k, axis] > end:
            break
        if d == 3:
            fits = _in_gate(3, turns, places, k, middle, L, v, gate)
        else:
            fits = _in_gate(d, turns, places, k, middle, L, v, gate)
        if fits:
            # ascending; those of a track are in another order
            at = count
            while at > 0 and near.found[queue[s, at - 1]] > near.found[k]:
                queue[s, at] = queue[s, at - 1]
                at -= 1
            queue[s, at] = k
            count += 1
    return count


@literal_njit
def _in_gate(
    d: int, turns: tuple[int, float], places: Array, k: int, middle: Array, L: Array, v: Array, gate: float
) -> bool:
    """Whether measurement k of d quantities is in the gate; `turns` are code and folding interval of the sensor."""
    for a in range(d):
        v[a] = places[k, a] - middle[a]
    wrap(turns[0], v)
    fold(turns[1], v)
    square = 0.0
    for a in range(d):
        for e in range(a):
            v[a] -= L[a, e] * v[e]
        v[a] *= L[a, a]
        square += v[a] * v[a]
        if not square <= gate:
            return False
    return True


@lean_inner_njit
def _not_below(places: Array, axis: int, value: float, low: int, high: int) -> int:
    """The first of the rows from low to high, sorted along the axis, that is not below the value."""
    while low < high:
        middle = (low + high) // 2
        if places[middle, axis] < value:
            low = middle + 1
        else:
            high = middle
    return low


@lean_inner_njit
def _likelihood(sensors: Sensors, near: Measured, k: int, s: int, space: _Space) -> float:
    """Log-likelihood of a measurement under the partial tuple; residuals and shares of the components are left."""
    at, d = space.at[s], sensors.sizes[s, 1]
    side, m = _side(s, at), space.weights.shape[2]
    code, highest, total = sensors.sizes[s, 0], -math.inf, 0.0
    folding = folding_of(code, sensors.matrices[s])
    for j in range(m):
        linear, v = space.linear[s, side, j], space.v[j]
        for a in range(d):
            v[a] = near.places[k, a] - space.h[s, j, a]
        wrap(code, v)
        fold(folding, v)
        for a in range(d):
            linear[V, 0, a] = v[a]
        work = space.work[s, side, j]
        nis = squared(3, linear, work) if d == 3 else squared(d, linear, work)
        space.joint[j] = space.weights[at, 1, j] - 0.5 * (nis + space.log_dets[s, side, j] + d * LOG_TURN)
        highest = max(highest, space.joint[j])
    for j in range(m):
        # of the highest without an exponential
        total += 1.0 if space.joint[j] == highest else math.exp(space.joint[j] - highest)
    return highest + math.log(total)


@lean_inner_njit
def _correct(sensors: Sensors, s: int, likelihood: float, space: _Space) -> None:
    """Correct the state of a partial tuple by the measurement that `_likelihood` was last asked about."""
    at, d = space.at[s], sensors.sizes[s, 1]
    side = _side(s, at)
    to = 2 * s + 1 + side
    space.at[s + 1] = to
    c, corrected = sensors.sizes[s, 2], space.seen[s, side, 1] == 1
    if not corrected:
        space.seen[s, side, 1], space.versions[to] = 1, _version(space)
    columns = sensors.columns[s, :c]
    for j in range(space.weights.shape[2]):
        work, linear = space.work[s, side, j], space.linear[s, side, j]
        if not corrected:
            P, S, new = space.covariances[at, j], space.S[s, side, j], space.covariances[to, j]
            if d == 3 and c == 3:
                correct(3, 3, P, columns, linear, work, S, new)
            else:
                correct(d, c, P, columns, linear, work, S, new)
        correct_mean(space.means[at, j], work, space.v[j, :d], space.means[to, j])
        space.weights[to, 1, j] = space.joint[j] - likelihood
        space.weights[to, 0, j] = math.exp(space.weights[to, 1, j])
