"""Candidate tuples of a scan whose measurements have their own times.

A tuple is filtered in the order of its measurements' times: predicted to each, corrected by it. So its measurements are
compared through the target's predicted motion, and the logarithms of the predictive densities add up to their joint
one. A tuple without a track starts at its first measurement that determines a position, with the prior velocity of new
tracks.

Coarse pairs are found by the boxes that a track's gate sweeps between the first and the last measurement of a sensor.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from assoc._types import Array
from assoc.costs.limits import refuse_of_tracks
from assoc.costs.tracks.gating import near_pairs
from assoc.costs.tracks.scores import ScoreTerms
from assoc.costs.tracks.tuples import TrackTuples, gate_of, require_states
from assoc.costs.views import Views, log_missed
from assoc.filters.base import Expected, Filter
from assoc.filters.batches import concatenate, placed
from assoc.filters.measurement import periods_of
from assoc.filters.state import gaussian
from assoc.scene.scan import Scan
from assoc.sensors import Sensor

# a gate moves on a curve, the box on a straight line: it is longer by this factor
_CURVED = 1.3
# pairs that are filtered at a time
_BLOCK = 50_000


PairEvidence = Callable[[Array, int, Array], tuple[Array, Array]]
"""Rows of tracks (K,), a sensor, measurements (K,) -> log likelihood ratio (K,), whether they may be one (K,)."""


class Places(NamedTuple):
    """Positions of the measurements of each sensor, and which may start a track."""

    positions: list[Array]
    """(n_s, 3)."""
    covariances: list[Array]
    """(n_s, 3, 3)."""
    fit: list[Array]
    """Whether it may start a track, bool (n_s,)."""
    births: list[Array]
    """Score of each as a new target, misses of other sensors apart, (n_s,)."""


class Followed(NamedTuple):
    """M tuples filtered through all their measurements."""

    states: Any
    """At the time of the last measurement of each."""
    when: Array
    """That time, seconds (M,)."""
    first: Array
    """Time of the first measurement, (M,)."""
    lead: Array
    """Sensor whose measurement started the track, (M,); -1 for an existing track."""
    log_likelihood: Array
    """Of all measurements but the lead's, less their `clutter`, (M,)."""
    inside: Array
    """Whether each measurement passed its gate, bool (M,)."""


class TimedScan:
    """T tracks and the measurements since, each with its own time.

    `before`, a number or (T,), are the times of the states, seconds, none after the measurements'. `scan` ends at its
    time; the sensors are given as they stand then, and its `paths` are those of the ones that moved. `start`
    (positions, covariances, lag) begins tracks at a time `lag` (n,) seconds before that of the positions. `evidence`
    (track, sensor, measurement) adds to pairs of a track and a measurement (K,) a log likelihood ratio, and whether
    they may belong together.
    """

    def __init__(
        self,
        filter: Filter[Any],
        states: Any,
        before: float | Array,
        scan: Scan,
        sensors: Sequence[Sensor],
        places: Places,
        start: Callable[[Array, Array, Array], Any],
        gate_probability: float,
        evidence: PairEvidence | None = None,
    ) -> None:
        self.filter, self.states, self.sensors, self.places = filter, states, sensors, places
        self.before = np.broadcast_to(np.asarray(before, dtype=np.float64), (len(states),))
        self.measurements, self.times, self.end = scan.measurements, scan.own_times(), scan.time
        self.paths = scan.paths or (None,) * len(sensors)
        self.sectors, self.clutter, self.start, self.evidence = scan.sectors, scan.clutter, start, evidence
        self.late = self._moved(states, np.maximum(self.end - self.before, 0.0))
        """The tracks as predicted to the end of the scan."""
        self.gates = [gate_of(sensor, gate_probability) for sensor in sensors]
        sizes = [len(z) for z in scan.measurements]
        self.offsets = np.cumsum([len(states), *sizes])
        """Where each sensor's measurements begin among anchors: tracks, then measurements that began one."""
        # tracks start with sensors that determine positions: these come first
        self.order = sorted(range(len(sensors)), key=lambda s: not places.fit[s].any())

    def stamps(self, rows: Array) -> Array:
        """Times of the measurements of tuples, (M, S), infinite where there is none."""
        return np.stack(
            [np.append(times, np.inf)[rows[:, s] - 1] for s, times in enumerate(self.times)], axis=1
        ).reshape(rows.shape)

    def follow(self, track: Array, rows: Array) -> Followed:
        """Filter tuples of measurements (M, S) in the order of their times.

        `track` (M,) is the row of the track, -1 for a new target, which has a measurement that may begin a track.
        """
        stamps = self.stamps(rows)
        turn = np.argsort(stamps, axis=1, kind="stable")
        count = np.count_nonzero(rows, axis=1)
        first = stamps.min(axis=1, initial=np.inf)
        fresh, old = np.flatnonzero(track < 0), np.flatnonzero(track >= 0)
        require_states(self.states, len(track))
        lead, begun = self._begin(rows[fresh], turn[fresh], stamps[fresh], first[fresh])
        leads = np.full(len(track), -1, dtype=np.int64)
        leads[fresh] = lead
        when = np.empty(len(track))
        when[fresh], when[old] = first[fresh], self.before[track[old]]
        states = placed(len(track), [(old, self.states[track[old]]), (fresh, begun)])
        log_likelihood, inside = np.zeros(len(track)), np.ones(len(track), dtype=np.bool_)
        for k in range(rows.shape[1]):
            due = (count > k) & (turn[:, k] != leads)
            for s, sensor, here in self._turns(due, turn[:, k], stamps):
                now = stamps[here, s]
                moved = self._moved(states[here], now - when[here])
                z = np.ascontiguousarray(self.measurements[s][rows[here, s] - 1])
                done = self.filter.update(moved, z, sensor)
                when[here] = now
                others = np.ones(len(track), dtype=np.bool_)
                others[here] = False
                rest = np.flatnonzero(others)
                states = placed(len(track), [(rest, states[rest]), (here, done.state)]) if len(rest) else done.state
                log_likelihood[here] += done.log_likelihood
                if self.clutter is not None:
                    log_likelihood[here] -= self.clutter[s][rows[here, s] - 1]
                inside[here] &= done.nis <= self.gates[s]
                if self.evidence is not None:
                    known = here[track[here] >= 0]
                    says, possible = self.evidence(track[known], s, rows[known, s] - 1)
                    log_likelihood[known] += says
                    inside[known] &= possible
        return Followed(states, when, first, leads, log_likelihood, inside)

    def _turns(self, due: Array, turn: Array, stamps: Array) -> Iterator[tuple[int, Sensor, Array]]:
        """Sensors, as they stood, and the due tuples whose turn they have."""
        for s in range(len(self.sensors)):
            here = np.flatnonzero(due & (turn == s))
            for sensor, rows in self.by_pose(s, stamps[here, s]):
                yield s, sensor, here[rows]

    def by_pose(self, s: int, times: Array) -> list[tuple[Sensor, Array]]:
        """Sensor s as it stood at times (n,), and the rows of each stand: one of all unless it moved."""
        path = self.paths[s]
        if path is None:
            return [(self.sensors[s], np.arange(len(times)))] if len(times) else []
        when, which = np.unique(times, return_inverse=True)
        places = path.poses(when)[0]
        return [(replace(self.sensors[s], position=places[i]), np.flatnonzero(which == i)) for i in range(len(when))]

    def _moved(self, states: Any, dt: Array) -> Any:
        """Each state its own dt seconds later, without caching models by time step."""
        return self.filter.predict_each(states, dt) if len(states) else states

    def _begin(self, rows: Array, turn: Array, stamps: Array, first: Array) -> tuple[Array, Any]:
        """The sensor that begins each new track, and the tracks, at the time of their first measurements."""
        able = np.stack([np.append(fit, False)[rows[:, s] - 1] for s, fit in enumerate(self.places.fit)], axis=1)
        ordered = np.take_along_axis(able.reshape(rows.shape), turn, axis=1)
        lead = turn[np.arange(len(rows)), np.argmax(ordered, axis=1)] if len(rows) else np.zeros(0, dtype=np.int64)
        positions, covariances = np.zeros((len(rows), 3)), np.zeros((len(rows), 3, 3))
        for s in range(rows.shape[1]):
            mine = np.flatnonzero(lead == s)
            number = rows[mine, s] - 1
            positions[mine], covariances[mine] = self.places.positions[s][number], self.places.covariances[s][number]
        return lead, self.start(positions, covariances, stamps[np.arange(len(rows)), lead] - first)

    def at_end(self, followed: Followed, track: Array) -> Any:
        """States of followed tuples, and of tracks without measurements, at the end of the scan."""
        idle = (followed.first == np.inf) & (track >= 0)
        if not idle.any():
            return self._moved(followed.states, self.end - followed.when)
        seen, missed = np.flatnonzero(~idle), np.flatnonzero(idle)
        moved = self._moved(followed.states[seen], self.end - followed.when[seen])
        return placed(len(track), [(seen, moved), (missed, self.late[track[missed]])])

    def misses(self, terms: ScoreTerms) -> Array:
        """Score of a miss of each track and each measurement's target (as anchors) by each sensor, (A, S)."""
        begun = gaussian(np.concatenate(self.places.positions), np.concatenate(self.places.covariances))
        kinds = (self.late, self.filter.motion.position), (begun, range(3))
        shares = np.concatenate(
            [Views(self.sensors, axes, terms.by_range).shares(states, sectors=self.sectors) for states, axes in kinds]
        )
        for s in range(len(self.sensors)):
            # a sensor covers its own measurements, in spite of rounding
            shares[self.offsets[s] : self.offsets[s + 1], s] = 1.0
        return log_missed(terms.miss, shares)

    def anchors(self, rows: Array, lead: Array) -> Array:
        """The measurement, as anchor, with which each new target began, (M,)."""
        return self.offsets[lead] + np.take_along_axis(rows, lead[:, None], axis=1)[:, 0] - 1

    def grown(
        self, s: int, done: Sequence[int], anchor: Array, track: Array, rows: Array, max_tuples: int
    ) -> tuple[Array, Array, Array, Followed]:
        """Partial tuples with one more measurement, of sensor s, that passes all gates.

        LimitExceededError where these and the ones before are more than `max_tuples`.

        Measurements of the sensors in `done` may have begun new targets. Of the partial tuples: `anchor` (M,), the
        track, or the measurement that began a new target; `track` (M,), the row of the track or -1; `rows` (M, S).
        Returns the rows (K,) of the tuples before, measurements from 0 (K,), the new rows (K, S), filtered.
        """
        near_anchor, near_found = self.near(s)
        for r in done:
            first, second = self.near_beginnings(r, s)
            near_anchor, near_found = np.append(near_anchor, self.offsets[r] + first), np.append(near_found, second)
        order = np.lexsort((near_found, near_anchor))
        parent, found = _join(anchor, near_anchor[order], near_found[order], int(self.offsets[-1]))
        blocks, count = [], len(rows)
        # as many at a time as may be kept: boxes may hold any number that fails its gates
        for block in np.split(np.arange(len(parent)), range(_BLOCK, len(parent), _BLOCK)):
            new = rows[parent[block]]
            new[:, s] = found[block] + 1
            followed = self.follow(track[parent[block]], new)
            good = np.flatnonzero(followed.inside)
            count += len(good)
            if count > max_tuples:
                raise refuse_of_tracks(count, max_tuples)
            blocks.append((block[good], new[good], followed.states[good], [part[good] for part in followed[1:]]))
        kept, new_rows, states, others = zip(*blocks, strict=True)
        chosen = Followed(concatenate(states), *map(np.concatenate, zip(*others, strict=True)))
        every = np.concatenate(kept)
        return parent[every], found[every], np.concatenate(new_rows), chosen

    def near(self, s: int) -> tuple[Array, Array]:
        """Tracks and measurements of sensor s that may pass the gate, ordered by track."""
        nothing = np.zeros(0, dtype=np.int64)
        times = self.times[s]
        if not len(self.states) or not len(times):
            return nothing, nothing
        if self.paths[s] is not None:
            return self._near_moving(s)
        sensor, gate = self.sensors[s], self.gates[s]
        periods, axes = periods_of(sensor), len(self.filter.motion.position)
        # the gate is widest at the end of the scan; before, it moves with the velocity
        late = self.filter.expected(self.late, sensor)
        velocity = np.zeros((len(self.states), 3))
        moving = [k for k in range(axes, 2 * axes) if k < self.filter.motion.dim]
        velocity[:, : len(moving)] = self.late.mean[:, moving]
        position = np.zeros((len(self.states), 3))
        position[:, :axes] = self.late.mean[:, list(self.filter.motion.position)]
        here = _measured(sensor, position, velocity)
        ways = []
        for back in (self.end - float(times.max()), self.end - float(times.min())):
            way = _measured(sensor, position - back * velocity, velocity) - here
            turning = np.array(sensor.angular[: sensor.dim])
            way[:, turning] -= 2 * np.pi * np.round(way[:, turning] / (2 * np.pi))
            ways.append(way)
        spread = np.sqrt(gate * np.einsum("bii->bi", late.covariance))
        reach = spread + 0.5 * _CURVED * np.abs(ways[1] - ways[0])
        box = Expected(late.mean + 0.5 * (ways[0] + ways[1]), _diagonal(reach**2 / gate))
        return near_pairs(box, self.measurements[s], periods, gate)

    def _near_moving(self, s: int) -> tuple[Array, Array]:
        """`near` for a sensor that moved: by the predictions to each time at which it measured."""
        found = []
        for sensor, rows in self.by_pose(s, self.times[s]):
            then = self._moved(self.states, np.maximum(float(self.times[s][rows[0]]) - self.before, 0.0))
            expected, periods = self.filter.expected(then, sensor), periods_of(sensor)
            track, near = near_pairs(expected, self.measurements[s][rows], periods, self.gates[s])
            found.append((track, rows[near]))
        tracks, measurements = (np.concatenate(part) for part in zip(*found, strict=True))
        order = np.lexsort((measurements, tracks))
        return tracks[order], measurements[order]

    def near_beginnings(self, r: int, s: int) -> tuple[Array, Array]:
        """Measurements of sensor r that may begin a track, and of sensor s that may be of it, ordered by the first."""
        nothing = np.zeros(0, dtype=np.int64)
        able = np.flatnonzero(self.places.fit[r])
        if not len(able) or not len(self.times[s]):
            return nothing, nothing
        firsts, seconds = [], []
        for sensor, rows in self.by_pose(s, self.times[s]):
            stamps, ends = self.times[r][able], (float(self.times[s][rows].min()), float(self.times[s][rows].max()))
            lag = np.maximum(np.abs(stamps - ends[0]), np.abs(stamps - ends[1]))
            wide = self.start(self.places.positions[r][able], self.places.covariances[r][able], lag)
            expected, periods = self.filter.expected(wide, sensor), periods_of(sensor)
            first, second = near_pairs(expected, self.measurements[s][rows], periods, self.gates[s])
            firsts.append(able[first])
            seconds.append(rows[second])
        first, second = np.concatenate(firsts), np.concatenate(seconds)
        order = np.argsort(first, kind="stable")
        return first[order], second[order]


def _measured(sensor: Sensor, positions: Array, velocities: Array) -> Array:
    return sensor.measure(positions, velocities) if sensor.measures_velocity else sensor.measure(positions)


def _diagonal(variances: Array) -> Array:
    covariance = np.zeros((*variances.shape, variances.shape[1]))
    np.einsum("bii->bi", covariance)[:] = variances
    return covariance


def grow_timed_tuples(scan: TimedScan, terms: ScoreTerms, misses: Array, max_tuples: int) -> TrackTuples:
    """Candidate tuples of tracks, or of new targets (track -1), and one measurement or none of each sensor.

    The costs of new targets have the density of births at their lead's measurement.

    LimitExceededError for more than `max_tuples`.
    """
    count, width = len(scan.states), len(scan.sensors)
    track, anchor = np.arange(count), np.arange(count)
    rows = np.zeros((count, width), dtype=np.int32)
    costs = -misses[:count].sum(axis=1)
    alone = costs.copy()
    done: list[int] = []
    for s in scan.order:
        parent, _, grown, followed = scan.grown(s, done, anchor, track, rows, max_tuples)
        value = score_costs(scan, followed, grown, terms, misses[anchor[parent]])
        starts = np.flatnonzero(scan.places.fit[s])
        single = np.zeros((len(starts), width), dtype=np.int32)
        single[:, s] = starts + 1
        start_anchor = scan.offsets[s] + starts
        begun = terms.miss[s] - misses[start_anchor].sum(axis=1) - scan.places.births[s][starts]
        costs = np.concatenate([costs, value, begun])
        rows = np.concatenate([rows, grown, single])
        track = np.concatenate([track, track[parent], np.full(len(starts), -1)])
        anchor = np.concatenate([anchor, anchor[parent], start_anchor])
        done.append(s)
    # not cheaper than a track all missed: its measurements are better false alarms, at cost 0
    good = (track < 0) | ~rows.any(axis=1)
    good[~good] = costs[~good] < alone[track[~good]]
    order = np.flatnonzero(good)
    order = order[np.lexsort((*rows[order].T[::-1], track[order]))]
    return TrackTuples(track[order], rows[order], costs[order])


def score_costs(scan: TimedScan, followed: Followed, rows: Array, terms: ScoreTerms, misses: Array) -> Array:
    """Costs of followed tuples, given the score of a miss of each by each sensor, (M, S)."""
    seen = rows > 0
    gain = followed.log_likelihood + seen @ terms.detection + np.where(seen, 0.0, misses).sum(axis=1)
    for s, births in enumerate(scan.places.births):
        mine = np.flatnonzero(followed.lead == s)
        gain[mine] += births[rows[mine, s] - 1] - terms.detection[s]
    return np.asarray(-gain)


def _join(track: Array, near_track: Array, near_found: Array, count: int) -> tuple[Array, Array]:
    """Partial tuples times the measurements near their tracks (sorted by track): row of the tuple, measurement."""
    first = np.searchsorted(near_track, np.arange(count + 1))
    low, high = first[track], first[track + 1]
    lengths = high - low
    parent = np.repeat(np.arange(len(track)), lengths)
    offsets = np.repeat(low - (np.cumsum(lengths) - lengths), lengths)
    return parent, near_found[np.arange(len(parent)) + offsets]
