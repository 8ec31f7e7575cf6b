"""Track-oriented multiple hypothesis tracking: a tree of branches for each possible target.

Every measurement may start a tree; every branch grows by each measurement in its gate and by a miss. The best
global hypothesis takes at most one branch of each tree and each measurement of the window at most once: it is
an assignment problem over the trees and the sensors of the last N scans, which any solver answers. What it says
of the oldest scan of the window is then final (N-scan pruning). After each sensor the branches are cut by what
they cost the best global hypothesis (`assoc.tracking.mht.losses`), not by their tree's own scores: of close targets
the best branches of one tree may all want measurements that the others need more.

References
----------
T. Kurien, Issues in the design of practical multitarget tracking algorithms, in Y. Bar-Shalom (ed.),
Multitarget-Multisensor Tracking: Advanced Applications, 1990.
A. Poore, Multidimensional assignment formulation of data association problems arising from multitarget and
multisensor tracking, Computational Optimization and Applications 3, 1994.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from assoc._system.door import doors
from assoc._types import Array
from assoc.costs.tracks.own_times import score_costs
from assoc.costs.tracks.tuples import gate_of, require_states, track_pairs
from assoc.errors import InvalidInputError, LimitExceededError
from assoc.filters.batches import concatenate
from assoc.problem import AssignmentProblem
from assoc.scene.scan import Scan
from assoc.tracking.checkpoint import PREFIX, check_window, require_field
from assoc.tracking.mht.branches import Hits, Roots, Tables, count_scan, extend
from assoc.tracking.mht.pruning import MOST_SCANS, decide, same_tree
from assoc.tracking.track import Decision, Step
from assoc.tracking.track_batch import STARTED, SURE, TrackBatch
from assoc.tracking.tracker import Tracker

_MOST_CROSSINGS = 100
"""The most trees that begin in a scan where several sensors together tell a position."""


@doors
class TrackOrientedMHT(Tracker):
    """Multiple hypothesis tracker with track trees.

    Parameters
    ----------
    sensors, filter, ...
        As for `Tracker`. Sensors of a scan are taken in one after the other.
    depth : int
        Scans in the window, N: a measurement's track is final N - 1 scans later. 1 decides at once.
    max_branches : int
        The most branches of a tree.
    branch_drop : float
        A branch is cut if every global hypothesis that contains it scores this much less than the best one: 7 is a
        thousandth of its probability. Of more than `max_branches` those stay that cost the best hypothesis least.
    **options
        As for `Tracker`.
    """

    name = "mht"

    def __init__(
        self, *arguments: Any, depth: int = 3, max_branches: int = 30, branch_drop: float = 7.0, **options: Any
    ) -> None:
        super().__init__(*arguments, **options)
        for value, what in ((depth, "depth"), (max_branches, "max_branches")):
            if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < 1:
                raise InvalidInputError(f"{what} must be a whole number above 0, got {value!r}")
        if depth > MOST_SCANS:
            raise InvalidInputError(f"depth must be at most {MOST_SCANS} scans, got {depth}")
        if not isinstance(branch_drop, (int, float)) or not branch_drop > 0:
            raise InvalidInputError(f"branch_drop must be a number above 0, got {branch_drop!r}")
        self.depth, self.max_branches, self.branch_drop = int(depth), int(max_branches), float(branch_drop)
        self._history = np.zeros((0, self.depth * len(self.sensors)), dtype=np.int32)
        """Measurements of each branch (1-based, 0 missed): the sensors of this scan, of the last, ..."""
        self._born = np.zeros(0, dtype=np.int64)
        """Scan in which each branch's tree began."""
        self._chosen = np.zeros(0, dtype=np.bool_)
        """Branches of the best global hypothesis."""
        self._window: list[tuple[float, Array]] = []
        """Times and sizes of the scans that are not yet final, the last one first."""

    def _current(self) -> TrackBatch:
        rows = np.flatnonzero(self._chosen)
        return self._batch[rows[np.argsort(self._batch.track_id[rows], kind="stable")]]

    def _adopt(self, batch: TrackBatch) -> None:
        super()._adopt(batch)
        self._history = np.zeros((len(batch), self._history.shape[1]), dtype=np.int32)
        self._born, self._chosen = np.full(len(batch), -1), np.ones(len(batch), dtype=np.bool_)

    def _step(self, scan: Scan) -> Step:
        time, measurements = scan.time, scan.measurements
        if scan.at_once:
            self._grow(scan)
        else:
            self._grow_in_order(scan)
        self._window.insert(0, (time, np.array([len(z) for z in measurements], dtype=np.int64)))
        if self.solver != "exact" or self.solver_parameters:
            self._chosen = self._better(self._solved(self._batch.track_id, self._batch.score, self._history))
        self._confirm()
        now = self._decision(0, self._chosen)
        final, kept = self._prune() if len(self._window) == self.depth else ((), None)
        ended = self._delete_tracks(time, kept)
        return Step(now.scan, now.time, now.assigned, now.confirmed, final=final, ended=ended)

    def _grow(self, scan: Scan) -> None:
        """Grow branches by the measurements in their gates and by misses, start trees, choose the best hypothesis."""
        time, count = scan.time, len(self.sensors)
        batch = self._predicted(self._batch, self._elapsed(time))
        states, tables = batch.states, self._tables()
        for s, (z, sensor) in enumerate(zip(scan.measurements, self.sensors, strict=True)):
            pairs = track_pairs(self.filter, states, z, sensor, gate_of(sensor, self.gate_probability))
            gain = pairs.log_likelihood + self.terms.detection[s]
            begun, roots = self._roots(s, z, time)
            missed = np.full(len(states), self.terms.miss[s])
            when = np.full(len(gain), time)
            hits = Hits(pairs.track, pairs.measurement, gain, when)
            kept, tables, chosen = self._extended(tables, missed, hits, roots, s)
            require_states(states, len(kept))
            states = concatenate([states, pairs.states, begun])[kept]
        crossed = self._crossed_roots(scan, tables.history[chosen & (tables.counts[:, SURE] > 0), :count])
        if crossed is not None:
            nothing = Hits(*np.zeros((2, 0), dtype=np.int64), *np.zeros((2, 0)))
            kept, tables, chosen = self._extended(tables, np.zeros(len(states)), nothing, crossed[1], 0)
            states = concatenate([states, crossed[0]])[kept]
        count_scan(tables.counts, tables.history, count, np.ones(len(states), dtype=np.bool_))
        self._batch = TrackBatch(states, tables.numbers, tables.counts)
        self._history, self._born, self._chosen = tables.history, tables.born, chosen

    def _grow_in_order(self, scan: Scan) -> None:
        """`_grow` where measurements have times of their own: each branch is filtered in their order."""
        count, timed = len(self.sensors), self._timed(scan)
        looked = timed.looked()
        # the sensors that have been taken in: only they can have missed a branch
        past = np.zeros_like(looked)
        tables, gained = self._tables(), np.zeros(len(self._batch))
        anchor = parent_row = np.arange(len(self._batch))
        done: list[int] = []
        for s in timed.order:
            past[:, s] = looked[:, s]
            grown = timed.grown(s, done, anchor, parent_row, tables.history[:, :count])
            total = -score_costs(timed, grown.followed, grown.rows, self.terms, past[anchor[grown.parent]])
            missed = looked[anchor, s] * self.terms.miss[s]
            own = np.flatnonzero(timed.places.fit[s])
            own_anchor, since = timed.offsets[s] + own, timed.times[s][own]
            score = timed.places.births[s][own] + past[own_anchor] @ self.terms.miss - self.terms.miss[s]
            ids = np.empty(len(own), dtype=np.int64)
            ids[np.lexsort((*timed.places.positions[s][own].T, since))] = self._new_ids(len(own))
            hits = Hits(grown.parent, grown.measurement, total - gained[grown.parent], grown.followed.when)
            single = np.zeros((len(own), count), dtype=np.int32)
            single[:, s] = own + 1
            roots = Roots(ids, single, since, score)
            kept, tables, chosen = self._extended(tables, missed, hits, roots, s)
            gained = np.concatenate([gained + missed, total, score])[kept]
            anchor = np.concatenate([anchor, anchor[grown.parent], own_anchor])[kept]
            parent_row = np.concatenate([parent_row, parent_row[grown.parent], np.full(len(own), -1)])[kept]
            done.append(s)
        rows = tables.history[:, :count]
        followed = timed.follow(parent_row, rows)
        states = timed.at_end(followed, parent_row)
        new = np.flatnonzero(parent_row < 0)
        tables.numbers[new, STARTED] = followed.first[new]
        count_scan(tables.counts, tables.history, count, looked[anchor].any(axis=1))
        self._batch = TrackBatch(states, tables.numbers, tables.counts)
        self._history, self._born, self._chosen = tables.history, tables.born, chosen

    def _tables(self) -> Tables:
        """The branches, with room for this scan in their histories."""
        count, history = len(self.sensors), np.zeros_like(self._history)
        history[:, count:] = self._history[:, : history.shape[1] - count]
        return Tables(self._batch.numbers, self._batch.counts, history, self._born)

    def _extended(self, tables: Tables, missed: Array, hits: Hits, roots: Roots, s: int) -> tuple[Array, Tables, Array]:
        most, drop = self.max_branches, self.branch_drop
        done = extend(tables, missed, hits, roots, s, self._scan, most, drop, self._solved)
        if len(done[0]) > self.max_tuples:
            raise LimitExceededError(
                f"scan {self._scan}: {len(done[0])} branches, more than max_tuples = {self.max_tuples}; "
                "lower gate_probability, depth or max_branches, or raise max_tuples"
            )
        return done

    def _roots(self, s: int, z: Array, time: float) -> tuple[Any, Roots]:
        """New trees, one for each measurement that tells a position, and their states."""
        states, fit, positions, score = self._new_tracks.singles(s, z)
        numbers = np.flatnonzero(fit)
        # numbered by place, so that the order of the measurements does not matter
        ids = np.empty(len(numbers), dtype=np.int64)
        ids[np.lexsort(positions.T)] = self._new_ids(len(numbers))
        rows = np.zeros((len(numbers), len(self.sensors)), dtype=np.int32)
        rows[:, s] = numbers + 1
        return states, Roots(ids, rows, np.full(len(numbers), time), score)

    def _crossed_roots(self, scan: Scan, taken: Array) -> tuple[Any, Roots] | None:
        """New trees of what confirmed tracks (their measurements: (T, S)) leave of sensors that start none alone."""
        free = []
        for s, size in enumerate(scan.sizes.tolist()):
            own = np.ones(size + 1, dtype=np.bool_)
            own[taken[:, s]] = False
            free.append(own[1:])
        found = self._crossings(scan, free)
        if found is None:
            return None
        several, scores = found
        # by far the most are ghosts
        best = np.argsort(-scores, kind="stable")[:_MOST_CROSSINGS]
        best = best[np.lexsort(several.positions[best].T)]
        states = self.initiation.start(self.filter, several.positions[best], several.covariances[best])
        when = np.full(len(best), scan.time)
        return states, Roots(self._new_ids(len(best)), several.rows[best], when, scores[best])

    def _better(self, other: Array) -> Array:
        """The better of the hypothesis that was found growing and another, as masks of branches."""
        score = self._batch.score
        return other if score[other].sum() >= score[self._chosen].sum() else self._chosen

    def _solved(self, tree: Array, score: Array, history: Array) -> Array:
        """Branches of the best global hypothesis by the tracker's solver, as a mask."""
        chosen = np.zeros(len(score), dtype=np.bool_)
        # a branch of no positive score is better left to false alarms
        rows = np.flatnonzero(score > 0)
        if not len(rows):
            return chosen
        tuples = np.empty((len(rows), 1 + history.shape[1]), dtype=np.int64)
        sizes = np.zeros(tuples.shape[1], dtype=np.int64)
        trees, tuples[:, 0] = np.unique(tree[rows], return_inverse=True)
        tuples[:, 0] += 1
        sizes[0] = len(trees)
        for c in range(history.shape[1]):
            # only measurements that some branch uses take part
            column = history[rows, c]
            used = np.zeros(int(column.max()) + 1, dtype=np.int64)
            used[column] = 1
            used[0] = 0
            sizes[c + 1] = used.sum()
            number = np.cumsum(used) * used
            tuples[:, c + 1] = number[column]
        solution = self._assign(AssignmentProblem(tuples, -score[rows], sizes))
        picked = solution.indices[solution.indices < len(rows)]
        chosen[rows[picked]] = True
        return chosen

    def _confirm(self) -> None:
        batch = self._batch
        before = batch.confirmed
        new = self._chosen & ~before
        new &= self.life_cycle.confirms(batch.score, batch.detections)
        if new.any():
            self._batch = batch.with_confirmed(before | same_tree(batch.track_id.copy(), new))

    def _decision(self, age: int, rows: Array) -> Decision:
        """Which tracks the measurements of the scan `age` scans ago went to, by these branches."""
        count = len(self.sensors)
        time, sizes = self._window[age]
        if rows.dtype == np.bool_:
            rows = np.flatnonzero(rows)
        ids, sure = self._batch.track_id[rows], self._batch.confirmed[rows]
        history = self._history[rows]
        assigned, confirmed = [], []
        for s in range(count):
            owner, known = np.zeros(int(sizes[s]) + 1, dtype=np.int64), np.zeros(int(sizes[s]) + 1, dtype=np.bool_)
            column = history[:, age * count + s]
            owner[column], known[column] = ids, sure
            assigned.append(owner[1:])
            confirmed.append(known[1:])
        return Decision(self._scan - age, time, tuple(assigned), tuple(confirmed))

    def _prune(self) -> tuple[tuple[Decision, ...], Array]:
        """Decide the oldest scan of the window; the branches that do not contradict it."""
        count = len(self.sensors)
        oldest = np.ascontiguousarray(self._history[:, -count:])
        kept, speakers = decide(
            self._batch.track_id.copy(),
            self._batch.score.copy(),
            self._chosen,
            self._born <= self._scan - self.depth + 1,
            oldest,
            self._window[-1][1],
        )
        final = self._decision(self.depth - 1, speakers)
        self._window.pop()
        return (final,), kept

    def _delete_tracks(self, time: float, kept: Array | None) -> Array:
        """Cut all branches but these and delete tracks; the ids of confirmed ones that are gone."""
        stay = ~self._to_delete(self._batch, time)
        if kept is not None:
            stay &= kept
        if stay.all():
            return np.zeros(0, dtype=np.int64)
        ids = self._batch.track_id.copy()
        lost = ids[self._batch.confirmed & ~same_tree(ids, stay)]
        self._batch, self._history = self._batch[stay], self._history[stay]
        self._born, self._chosen = self._born[stay], self._chosen[stay]
        return np.unique(lost) if len(lost) else lost

    def hand_over(self, age: int) -> TrackBatch:
        """Give away confirmed tracks, as the best hypothesis knows them; branches that contradict them go, too.

        Parameters
        ----------
        age : int
            Scans since a track began after which it is given away.

        Returns
        -------
        TrackBatch
            The tracks, at the time of the last scan; this tracker knows them no more.
        """
        grown = self._chosen & self._batch.confirmed & (self._born <= self._scan - age)
        given, taken = self._batch[grown], self._history[grown]
        stay = ~np.isin(self._batch.track_id, given.track_id)
        for row in taken:
            stay &= ~((self._history == row) & (row > 0)).any(axis=1)
        self._batch, self._history = self._batch[stay], self._history[stay]
        self._born, self._chosen = self._born[stay], self._chosen[stay]
        return given

    def flush(self) -> tuple[Decision, ...]:
        """What the best hypothesis says of the scans that are not final yet, oldest first; for the end."""
        self._scan -= 1
        try:
            return tuple(self._decision(age, self._chosen) for age in reversed(range(len(self._window))))
        finally:
            self._scan += 1

    def _settings(self) -> dict[str, str]:
        own = {"depth": str(self.depth), "max_branches": str(self.max_branches), "branch_drop": repr(self.branch_drop)}
        return super()._settings() | own

    def _arrays(self) -> dict[str, Array]:
        times = np.array([time for time, _ in self._window], dtype=np.float64)
        sizes = np.array([sizes for _, sizes in self._window], dtype=np.int64).reshape(-1, len(self.sensors))
        own: dict[str, Array] = {"history": self._history, "born": self._born, "chosen": self._chosen}
        own |= {"window_times": times, "window_sizes": sizes}
        return super()._arrays() | own

    def _check(self, arrays: dict[str, Array]) -> None:
        super()._check(arrays)
        ids = arrays[f"{PREFIX}track_id"]
        check_window(arrays, len(ids), len(self.sensors), self.depth)
        require_field((np.diff(ids) >= 0).all(), f"{PREFIX}track_id", "the branches of one tree side by side")
        born = arrays["born"]
        require_field(born.shape == ids.shape and (born <= int(arrays["scan"])).all(), "born", "a scan for each branch")
        require_field(arrays["chosen"].shape == ids.shape, "chosen", "a mark for each branch")

    def _take(self, arrays: dict[str, Array]) -> None:
        super()._take(arrays)
        self._history = arrays["history"].astype(np.int32)
        self._born, self._chosen = arrays["born"], arrays["chosen"]
        self._window = [(float(t), n) for t, n in zip(arrays["window_times"], arrays["window_sizes"], strict=True)]
