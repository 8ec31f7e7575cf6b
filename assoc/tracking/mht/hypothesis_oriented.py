"""Hypothesis-oriented multiple hypothesis tracking: Reid's generation, Murty's m best, n-scan pruning.

A hypothesis says of every measurement so far: false alarm, one of the existing targets, or a new target. Its
probability is equation 2.1 of the thesis on clustering time windows,

    p = 1/c  P_D^N_d  (1 - P_D)^(N_t - N_d)  P_FA^N_fa  P_NT^N_nt  prod p(z | t)  p_parent,

with N_d the targets that were detected, densities for P_FA and P_NT. Relative to "all false alarms" its
logarithm is the sum of the scores of the hypothesis' tracks (`assoc.costs.tracks.scores`), so that both forms
of the tracker count alike.

References
----------
D. B. Reid, An algorithm for tracking multiple targets, IEEE Trans. Automatic Control 24, 1979.
I. J. Cox, S. L. Hingorani, An efficient implementation of Reid's multiple hypothesis tracking algorithm,
IEEE Trans. Pattern Analysis and Machine Intelligence 18, 1996.
"""

from __future__ import annotations

import heapq
from typing import Any

import numpy as np

from assoc._system import memory
from assoc._system.door import doors
from assoc._types import Array
from assoc.costs.tracks.tuples import TrackPairs
from assoc.errors import InvalidInputError
from assoc.filters.base import predict_each
from assoc.problem import AssignmentProblem
from assoc.ranking.kbest import kbest
from assoc.scene.scan import Scan
from assoc.tracking.checkpoint import PREFIX, check_window, require_field
from assoc.tracking.gated_pairs import gated_pairs
from assoc.tracking.mht.pruning import MOST_SCANS
from assoc.tracking.track import Decision, Step, decision
from assoc.tracking.track_batch import TrackBatch
from assoc.tracking.tracker import Tracker


@doors
class HypothesisOrientedMHT(Tracker):
    """Multiple hypothesis tracker that keeps the m best hypotheses about everything.

    Parameters
    ----------
    sensors, filter, ...
        As for `Tracker`. Sensors of a scan are taken in one after the other; with a single sensor each
        measurement may have its own time. The `solver` is not used: the ranking is Murty's.
    max_hypotheses : int
        m.
    depth : int
        Scans after which a decision is final, n; at most 1000.
    hypothesis_drop : float
        A hypothesis whose log-probability is this far below the best is dropped.
    **options
        As for `Tracker`.
    """

    name = "mht-hypothesis"
    weighs_identities = False

    def __init__(
        self, *arguments: Any, max_hypotheses: int = 20, depth: int = 3, hypothesis_drop: float = 15.0, **options: Any
    ) -> None:
        super().__init__(*arguments, **options)
        for value, what in ((depth, "depth"), (max_hypotheses, "max_hypotheses")):
            if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < 1:
                raise InvalidInputError(f"{what} must be a whole number above 0, got {value!r}")
        if depth > MOST_SCANS:
            raise InvalidInputError(f"depth must be at most {MOST_SCANS} scans, got {depth}")
        if not isinstance(hypothesis_drop, (int, float)) or not hypothesis_drop > 0:
            raise InvalidInputError(f"hypothesis_drop must be a number above 0, got {hypothesis_drop!r}")
        self.max_hypotheses, self.depth = int(max_hypotheses), int(depth)
        self.hypothesis_drop = float(hypothesis_drop)
        self._members: list[Array] = [np.zeros(0, dtype=np.int64)]
        """Rows of the batch that each hypothesis believes in, the best hypothesis first."""
        self._weight = np.zeros(1)
        """Log-probability of each hypothesis, up to a constant."""
        self._line = np.zeros((1, self.depth), dtype=np.int64)
        """Ancestors of each hypothesis: which one it came from in this scan, in the last, ..."""
        self._history = np.zeros((0, self.depth * len(self.sensors)), dtype=np.int32)
        self._window: list[tuple[float, Array]] = []

    def _current(self) -> TrackBatch:
        rows = self._members[0]
        return self._batch[rows[np.argsort(self._batch.track_id[rows], kind="stable")]]

    @property
    def probabilities(self) -> Array:
        """Probabilities of the hypotheses that are kept, the best first."""
        p = np.exp(self._weight - self._weight.max())
        return np.asarray(p / p.sum())

    def _adopt(self, batch: TrackBatch) -> None:
        super()._adopt(batch)
        self._history = np.zeros((len(batch), self._history.shape[1]), dtype=np.int32)
        self._members = [np.arange(len(batch))]

    def _step(self, scan: Scan) -> Step:
        time, measurements, times = scan.time, scan.measurements, scan.times
        if scan.sectors is not None or (times is not None and len(self.sensors) > 1):
            raise InvalidInputError("times: measurements with own times need a tracker of a single sensor")
        count = len(self.sensors)
        before = time if self._time is None else self._time
        history = np.zeros_like(self._history)
        history[:, count:] = self._history[:, : history.shape[1] - count]
        self._history = history
        parent = np.arange(len(self._members))
        for s, z in enumerate(measurements):
            parent = parent[self._generate(s, z, time, before, None if times is None else times[s])]
            before = time
        self._line = np.column_stack([parent, self._line[parent][:, : self.depth - 1]])
        self._batch = self._batch.counted(np.asarray((self._history[:, :count] > 0).any(axis=1)))
        self._window.insert(0, (time, np.array([len(z) for z in measurements], dtype=np.int64)))
        self._confirm()
        now = self._decision(0)
        final: tuple[Decision, ...] = ()
        if len(self._window) == self.depth:
            # hypotheses that disagree with the best about the oldest scan end here
            ancestor = self._line[:, self.depth - 2]
            self._keep(np.flatnonzero(ancestor == ancestor[0]) if self.depth > 1 else np.arange(1))
            final = (self._decision(self.depth - 1),)
            self._window.pop()
        ended = self._delete_tracks(time)
        return Step(now.scan, now.time, now.assigned, now.confirmed, final=final, ended=ended)

    def _generate(self, s: int, z: Array, time: float, before: float, stamps: Array | None) -> Array:
        """Children of all hypotheses by one sensor's measurements; returns the parent of each that is kept."""
        batch, history = self._batch, self._history
        sensor = self.sensors[s]
        # hypotheses of equal weight are kept by number: measurements are numbered by value, so that the order in which
        # they are given does not matter
        order = np.lexsort((*z.T[::-1], *(() if stamps is None else (stamps,))))
        z, stamps = z[order], None if stamps is None else stamps[order]
        gated = gated_pairs(self.filter, batch.states, before, time, z, stamps, sensor, self.gate_probability)
        pairs = gated.pairs
        gain = pairs.log_likelihood + self.terms.detection[s]
        roots, root_history, numbers = self._roots(s, z, time, stamps)
        missed = batch.scored(gated.predicted, self.terms.miss[s])
        hit = batch[pairs.track].scored(pairs.states, gain, gated.when)
        hit_history = history[pairs.track]
        hit_history[:, s] = pairs.measurement + 1
        # rows of the next batch: missed branches, detected branches, new targets
        self._batch = TrackBatch.concatenate([missed, hit, roots])
        self._history = np.concatenate([history, hit_history, root_history])
        given = np.concatenate([[0], order + 1]).astype(np.int32)
        self._history[:, s] = given[self._history[:, s]]
        offsets = (len(batch), len(batch) + len(pairs.track))
        # no branch gains more than this
        most = np.full(len(batch), self.terms.miss[s])
        np.maximum.at(most, pairs.track, gain)
        births = float(np.maximum(roots.score, 0.0).sum())
        children: list[tuple[float, int, int, Array]] = []
        number = 0
        for h in np.argsort(-self._weight, kind="stable").tolist():
            reachable = self._weight[h] + float(most[self._members[h]].sum()) + births
            if len(children) == self.max_hypotheses and reachable <= children[0][0]:
                continue
            for weight, rows in self._ranked(h, s, pairs, gain, numbers, roots.score, len(z), offsets):
                number += 1
                entry = (weight, -number, h, rows)
                if len(children) < self.max_hypotheses:
                    heapq.heappush(children, entry)
                elif weight > children[0][0]:
                    heapq.heapreplace(children, entry)
                else:
                    break
            memory.require(
                len(children) * (16.0 * len(self._members[h]) + 400.0),
                f"max_hypotheses = {self.max_hypotheses}: {len(children)} hypotheses",
                "keep fewer",
            )
        children.sort(key=lambda one: (-one[0], one[2], one[3].tolist()))
        best = children[0][0]
        children = [one for one in children if one[0] >= best - self.hypothesis_drop]
        self._weight = np.array([one[0] for one in children]) - best
        self._members = [one[3] for one in children]
        self._forget()
        return np.array([one[2] for one in children], dtype=np.int64)

    def _ranked(
        self,
        h: int,
        s: int,
        pairs: TrackPairs,
        gain: Array,
        numbers: Array,
        birth: Array,
        count: int,
        offsets: tuple[int, int],
    ) -> list[tuple[float, Array]]:
        """The m best children of a hypothesis: log-probabilities and rows of the next batch."""
        own = self._members[h]
        place = np.full(offsets[0], -1, dtype=np.int64)
        place[own] = np.arange(len(own))
        mine = np.flatnonzero(place[pairs.track] >= 0)
        # Cox and Hingorani's matrix: a target or a new one takes a measurement, what is left is a false alarm
        targets, new = len(own), len(numbers)
        rows = np.concatenate([place[pairs.track[mine]], np.arange(targets), targets + np.arange(new)]) + 1
        columns = np.concatenate([pairs.measurement[mine] + 1, np.zeros(targets, np.int64), numbers + 1])
        costs = np.concatenate([-gain[mine], np.full(targets, -self.terms.miss[s]), -birth])
        meaning = np.concatenate([offsets[0] + mine, own, offsets[1] + np.arange(new)])
        if not len(rows):
            return [(float(self._weight[h]), own)]
        problem = AssignmentProblem(np.stack([rows, columns], axis=1), costs, [targets + new, count])
        found = []
        for solution in kbest(problem, self.max_hypotheses):
            used = solution.indices[solution.indices < len(meaning)]
            found.append((float(self._weight[h]) - solution.cost, np.sort(meaning[used])))
        return found

    def _roots(self, s: int, z: Array, time: float, stamps: Array | None) -> tuple[TrackBatch, Array, Array]:
        numbers = np.arange(len(z))
        states, fit, positions, score = self._new_tracks.singles(s, z)
        numbers = numbers[fit]
        when = np.full(len(numbers), time) if stamps is None else stamps[numbers]
        ids = np.empty(len(numbers), dtype=np.int64)
        ids[np.lexsort((*positions.T, when))] = self._new_ids(len(numbers))
        history = np.zeros((len(numbers), self._history.shape[1]), dtype=np.int32)
        history[:, s] = numbers + 1
        return TrackBatch.new(predict_each(self.filter, states, time - when), ids, score, when), history, numbers

    def _keep(self, hypotheses: Array, weights: Array | None = None) -> None:
        self._members = [self._members[h] for h in hypotheses]
        self._weight = self._weight[hypotheses] if weights is None else weights
        self._line = self._line[hypotheses]
        self._weight = self._weight - self._weight.max()
        self._forget()

    def _forget(self) -> None:
        """Drop the branches that no hypothesis believes in."""
        used = np.unique(np.concatenate(self._members)) if self._members else np.zeros(0, dtype=np.int64)
        place = np.zeros(len(self._batch), dtype=np.int64)
        place[used] = np.arange(len(used))
        self._batch, self._history = self._batch[used], self._history[used]
        self._members = [place[rows] for rows in self._members]

    def _merge(self) -> None:
        """Put hypotheses together that have become the same since tracks in which they differed are deleted."""
        places: dict[bytes, list[int]] = {}
        for h, rows in enumerate(self._members):
            places.setdefault(rows.tobytes(), []).append(h)
        if len(places) == len(self._members):
            return
        weights = [float(np.logaddexp.reduce(self._weight[same])) for same in places.values()]
        order = sorted(range(len(weights)), key=lambda i: (-weights[i], i))
        firsts = [same[0] for same in places.values()]
        self._keep(np.array([firsts[i] for i in order], dtype=np.int64), np.array([weights[i] for i in order]))

    def _confirm(self) -> None:
        batch, rows = self._batch, self._members[0]
        good = batch.track_id[rows[batch.confirm(self.life_cycle).confirmed[rows]]]
        self._batch = batch.with_confirmed(batch.confirmed | np.isin(batch.track_id, good))

    def _decision(self, age: int) -> Decision:
        count = len(self.sensors)
        time, sizes = self._window[age]
        rows = self._members[0]
        assigned = []
        for s in range(count):
            ids = np.zeros(int(sizes[s]) + 1, dtype=np.int64)
            ids[self._history[rows, age * count + s]] = self._batch.track_id[rows]
            assigned.append(ids[1:])
        batch = self._batch[rows]
        return decision(self._scan - age, time, assigned, batch.track_id[batch.confirmed])

    def _delete_tracks(self, time: float) -> Array:
        before = np.unique(self._batch.track_id[self._batch.confirmed])
        gone = self._to_delete(self._batch, time)
        if gone.any():
            self._members = [rows[~gone[rows]] for rows in self._members]
            self._forget()
            self._merge()
        return np.setdiff1d(before, self._batch.track_id)

    def flush(self) -> tuple[Decision, ...]:
        """What the best hypothesis says of the scans that are not final yet, oldest first; for the end."""
        self._scan -= 1
        try:
            return tuple(self._decision(age) for age in reversed(range(len(self._window))))
        finally:
            self._scan += 1

    def _settings(self) -> dict[str, str]:
        own = {"depth": self.depth, "max_hypotheses": self.max_hypotheses, "hypothesis_drop": self.hypothesis_drop}
        return super()._settings() | {name: repr(value) for name, value in own.items()}

    def _arrays(self) -> dict[str, Array]:
        times = np.array([time for time, _ in self._window], dtype=np.float64)
        sizes = np.array([sizes for _, sizes in self._window], dtype=np.int64).reshape(-1, len(self.sensors))
        own: dict[str, Array] = {"history": self._history, "weight": self._weight, "line": self._line}
        own["members"] = np.concatenate(self._members)
        own["lengths"] = np.array([len(rows) for rows in self._members], dtype=np.int64)
        own |= {"window_times": times, "window_sizes": sizes}
        return super()._arrays() | own

    def _check(self, arrays: dict[str, Array]) -> None:
        super()._check(arrays)
        count = len(arrays[f"{PREFIX}track_id"])
        check_window(arrays, count, len(self.sensors), self.depth)
        members, lengths, weight, line = (arrays[name] for name in ("members", "lengths", "weight", "line"))
        require_field(1 <= len(lengths) <= self.max_hypotheses, "lengths", f"1 to {self.max_hypotheses} hypotheses")
        require_field((lengths >= 0).all() and (lengths <= count).all(), "lengths", "numbers of branches")
        require_field(int(lengths.sum()) == len(members), "members", "as many branches as the lengths say")
        require_field(((members >= 0) & (members < count)).all(), "members", "numbers of branches")
        weighed = weight.shape == lengths.shape and np.isfinite(weight).all()
        require_field(weighed, "weight", "a number for each hypothesis")
        require_field(line.shape == (len(lengths), self.depth), "line", f"the shape {(len(lengths), self.depth)}")
        require_field((line >= 0).all(), "line", "numbers of hypotheses")

    def _take(self, arrays: dict[str, Array]) -> None:
        super()._take(arrays)
        self._history, self._line = arrays["history"].astype(np.int32), arrays["line"]
        self._weight = arrays["weight"]
        self._members = np.split(arrays["members"], np.cumsum(arrays["lengths"])[:-1])
        self._window = [(float(t), n) for t, n in zip(arrays["window_times"], arrays["window_sizes"], strict=True)]
