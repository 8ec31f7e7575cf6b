"""Track-oriented multiple hypothesis tracking: a tree of branches for each possible target.

Every measurement may start a tree; every branch grows by each measurement in its gate and by a miss. The best
global hypothesis takes at most one branch of each tree and each measurement of the window at most once: it is
an assignment problem over the trees and the sensors of the last N scans, which any solver can solve. Its decision
about the oldest scan of the window is then final (N-scan pruning). After each sensor the branches are pruned by their
losses (`assoc.tracking.mht.losses`), not by their scores: with close targets, the best branches of a tree may all use
measurements that other trees need more.

References
----------
T. Kurien, Issues in the design of practical multitarget tracking algorithms, in Y. Bar-Shalom (ed.),
Multitarget-Multisensor Tracking: Advanced Applications, 1990.
A. Poore, Multidimensional assignment formulation of data association problems arising from multitarget and
multisensor tracking, Computational Optimization and Applications 3, 1994.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from assoc._types import Array
from assoc.errors import LimitExceededError
from assoc.problem import AssignmentProblem
from assoc.tracking.file import Saved
from assoc.tracking.growth import Offers, growth_of
from assoc.tracking.mht.branches import Tables, count_scan, extend
from assoc.tracking.mht.pruning import decide, same_tree
from assoc.tracking.mht.window import DeferringMethod, Window
from assoc.tracking.progress import Association, Progress
from assoc.tracking.records.track import Decision, Step
from assoc.tracking.records.track_batch import STARTED, SURE, TrackBatch
from assoc.tracking.settings import TrackerSettings
from assoc.tracking.stages.coverage import new_targets_at
from assoc.tracking.stages.ending import to_delete
from assoc.tracking.state import TrackerState
from assoc.tracking.tracker import Tracker

_EFFORT = 0.05
"""Share of a tracker's usual limits for the solver: gaps of first scans of ghosts do not close within these either, and
later scans decide what is still open."""


class Trees(NamedTuple):
    """B branches without their scores and states."""

    window: Window
    born: Array
    """Scan in which each branch's tree began, int64 (B,)."""
    chosen: Array
    """Branches of the best global hypothesis, bool (B,)."""

    def of(self, rows: Array) -> Trees:
        """Select branches."""
        return Trees(self.window.of(rows), self.born[rows], self.chosen[rows])


@dataclass(frozen=True)
class TrackTrees(DeferringMethod):
    """The method of `TrackOrientedMHT`."""

    max_branches: int = 30
    branch_drop: float = 7.0

    def __post_init__(self) -> None:
        self._check("max_branches", "branch_drop")

    def begun(self, settings: TrackerSettings, tracks: TrackBatch) -> Trees:
        """Trees of one branch each, all of them in the best hypothesis."""
        count = len(tracks)
        window = Window.empty(count, self.depth, len(settings.sensors))
        return Trees(window, np.full(count, -1), np.ones(count, dtype=np.bool_))

    def current(self, state: TrackerState) -> TrackBatch:
        """The branches of the best hypothesis, by their ids."""
        rows = np.flatnonzero(state.method_state.chosen)
        return state.tracks[rows[np.argsort(state.tracks.track_id[rows], kind="stable")]]

    def associate(self, progress: Progress) -> Association:
        """Grow branches by the measurements in their gates and by misses, start trees, choose the best hypothesis."""
        growth, count = growth_of(progress), len(progress.settings.sensors)
        tables, chosen = _tables(progress.state, count), progress.state.method_state.chosen
        for s in growth.order:
            offers = growth.offers(s)
            kept, tables, chosen = self._extended(progress, tables, offers, s)
            growth.take(s, offers, kept)
        if progress.settings.angles_alone:
            crossed = growth.crossings(tables.history[chosen & (tables.counts[:, SURE] > 0), :count], by_place=True)
            if crossed is not None:
                kept, tables, chosen = self._extended(progress, tables, crossed, 0)
                growth.take(0, crossed, kept)
        grown = growth.finished()
        new = np.flatnonzero(growth.origin < 0)
        tables.numbers[new, STARTED] = grown.first[new]
        count_scan(tables.counts, tables.history, count, grown.covered)
        tracks = TrackBatch(grown.states, tables.numbers, tables.counts)
        if progress.settings.solver != "exact" or progress.settings.solver_parameters:
            other = _solved(progress, tracks.track_id, tracks.score, tables.history)
            if tracks.score[other].sum() >= tracks.score[chosen].sum():
                chosen = other
        window = progress.state.method_state.window.opened(progress.scan, tables.history)
        return Association(tracks, (), Trees(window, tables.born, chosen))

    def _extended(self, progress: Progress, tables: Tables, offers: Offers, s: int) -> tuple[Array, Tables, Array]:
        scan, most = progress.state.scan, progress.settings.max_tuples

        def solve(tree: Array, score: Array, history: Array) -> Array:
            return _solved(progress, tree, score, history)

        limits = self.max_branches, self.branch_drop
        kept, grown, chosen, gap = extend(tables, offers, s, scan, *limits, solve)
        if len(kept) > most:
            raise LimitExceededError(
                f"scan {scan}: {len(kept)} branches, more than max_tuples = {most}; "
                "lower gate_probability, depth or max_branches, or raise max_tuples"
            )
        progress.work.leave(gap)
        return kept, grown, chosen

    def life_cycle(self, progress: Progress, association: Association) -> Progress:
        """Confirm trees, decide the oldest scan of the window, delete branches that contradict it, and tracks."""
        tracks, trees, scan = association.tracks, association.method_state, progress.state.scan
        new = trees.chosen & ~tracks.confirmed
        new &= progress.settings.life_cycle.confirms(tracks.score, tracks.detections, new_targets_at(progress, tracks))
        if new.any():
            tracks = tracks.with_confirmed(tracks.confirmed | same_tree(tracks.track_id.copy(), new))
        now = trees.window.decision(0, scan, tracks, np.flatnonzero(trees.chosen))
        final: tuple[Decision, ...] = ()
        gone = to_delete(progress, tracks)
        # else the tree would go on by some branch that takes another target's measurement in time
        stay = ~(gone | same_tree(tracks.track_id.copy(), gone & trees.chosen & tracks.confirmed))
        if len(trees.window.times) == self.depth:
            kept, speakers = self._decided(tracks, trees, scan)
            final = (trees.window.decision(self.depth - 1, scan, tracks, speakers),)
            trees = trees._replace(window=trees.window.closed())
            stay &= kept
        ids, lost = tracks.track_id.copy(), np.zeros(0, dtype=np.int64)
        if not stay.all():
            lost = np.unique(ids[tracks.confirmed & ~same_tree(ids, stay)])
            tracks, trees = tracks[stay], trees.of(stay)
        step = Step(now.scan, now.time, now.assigned, now.confirmed, final=final, ended=lost)
        return progress.with_state(tracks=tracks, method_state=trees)._replace(step=step)

    def _decided(self, tracks: TrackBatch, trees: Trees, scan: int) -> tuple[Array, Array]:
        """Branches that agree with the decision about the oldest scan, and those that make it."""
        sizes = trees.window.sizes[-1]
        oldest = np.ascontiguousarray(trees.window.history[:, -sizes.size :])
        old = trees.born <= scan - self.depth + 1
        return decide(tracks.track_id.copy(), tracks.score.copy(), trees.chosen, old, oldest, sizes)

    @staticmethod
    def hand_over(state: TrackerState, age: int) -> tuple[TrackerState, TrackBatch]:
        """Hand over the confirmed tracks of the best hypothesis, so many scans after they began.

        Branches that contradict them are removed, too. Returns the state without these tracks; and the tracks, at the
        time of the last scan.
        """
        tracks, trees = state.tracks, state.method_state
        grown = trees.chosen & tracks.confirmed & (trees.born <= state.scan - age)
        stay = ~np.isin(tracks.track_id, tracks.track_id[grown])
        for row in trees.window.history[grown]:
            stay &= ~((trees.window.history == row) & (row > 0)).any(axis=1)
        return state._replace(tracks=tracks[stay], method_state=trees.of(stay)), tracks[grown]

    def renamed(self, state: TrackerState, ids: Array, names: Array) -> TrackerState:
        """The state with these names (K,) in place of ids (K,); trees that had these names end."""
        rows = np.flatnonzero(~np.isin(state.tracks.track_id, names))
        tracks = state.tracks[rows].renamed(ids, names)
        order = np.argsort(tracks.track_id, kind="stable")
        return state._replace(tracks=tracks[order], method_state=state.method_state.of(rows[order]))

    def open_decisions(self, state: TrackerState) -> tuple[Decision, ...]:
        """Decisions of the best hypothesis about the scans that are not final yet, oldest first."""
        return state.method_state.window.decisions(
            state.scan - 1, state.tracks, np.flatnonzero(state.method_state.chosen)
        )

    def arrays(self, trees: Trees) -> Mapping[str, Array]:
        """The trees for a file."""
        return {**trees.window.arrays(), "born": trees.born, "chosen": trees.chosen}

    def restored(self, settings: TrackerSettings, saved: Saved, state: TrackerState) -> Trees:
        """The trees that a file holds, checked."""
        ids, born, chosen = state.tracks.track_id, saved["born"], saved["chosen"]
        window = Window.restored(saved, len(ids), self.depth, len(settings.sensors))
        saved.require((np.diff(ids) >= 0).all(), "tracks.track_id", "the branches of one tree side by side")
        saved.require(born.shape == ids.shape and (born <= state.scan).all(), "born", "a scan for each branch")
        saved.require(chosen.shape == ids.shape, "chosen", "a mark for each branch")
        return Trees(window, born, chosen)


def _tables(state: TrackerState, sensors: int) -> Tables:
    """The branches, with empty columns for this scan in their histories."""
    before = state.method_state.window.history
    history = np.zeros_like(before)
    history[:, sensors:] = before[:, : before.shape[1] - sensors]
    return Tables(state.tracks.numbers, state.tracks.counts, history, state.method_state.born)


def _solved(progress: Progress, tree: Array, score: Array, history: Array) -> Array:
    """Branches of the best global hypothesis by the tracker's solver, as a mask."""
    chosen = np.zeros(len(score), dtype=np.bool_)
    # measurements of a branch without positive score are better explained as false alarms
    rows = np.flatnonzero(score > 0)
    if not len(rows):
        return chosen
    # each list of the problem is reduced to the entries that some branch uses
    tuples = np.empty((len(rows), 1 + history.shape[1]), dtype=np.int64)
    trees, numbers = np.unique(tree[rows], return_inverse=True)
    tuples[:, 0], sizes = numbers + 1, [len(trees)]
    for c, column in enumerate(history[rows].T):
        used = np.unique(column[column > 0])
        tuples[:, c + 1] = np.where(column > 0, np.searchsorted(used, column) + 1, 0)
        sizes.append(len(used))
    solution = progress.work.assign(AssignmentProblem(tuples, -score[rows], sizes), _EFFORT)
    chosen[rows[solution.indices[solution.indices < len(rows)]]] = True
    return chosen


class TrackOrientedMHT(Tracker):
    """Multiple hypothesis tracker with track trees.

    Parameters
    ----------
    sensors, filter, ...
        As for `Tracker`. The sensors of a scan are processed one after the other.
    depth : int
        Scans in the window, N: a measurement's track is final N - 1 scans later. 1 decides at once; at most 1000.
    max_branches : int
        The most branches of a tree (30); those with the least losses are kept.
    branch_drop : float
        A branch is cut if every global hypothesis that contains it scores this much less than the best one (7: less
        than a thousandth of its probability).
    **options
        As for `Tracker`.
    """

    name = "mht"
    method = TrackTrees
