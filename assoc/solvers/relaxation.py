"""Successive Lagrangian relaxation of the S-D assignment to two dimensions, and recovery upward.

The constraints of the measurements of sensors 3..S are relaxed with multipliers u_r,

    L(u) = sum_{s >= 3} u_r + min { sum_j (w_j - sum_{r in j, s >= 3} u_r) x_j : sensors 1 and 2 hold }

u_r <= 0 where the measurement may stay uncovered, free where it must be covered: with the wrong sign the
bound would be wrong on rectangular problems. For each pair of measurements of sensors 1 and 2 only its
cheapest tuple counts, and the minimum is one sparse two-dimensional assignment. Where its tuples use a
measurement r of the other sensors n_r times, 1 - n_r is a subgradient.

Recovery keeps the pairs and assigns them to sensor 3 by another two-dimensional assignment, the triples to
sensor 4, and so on: each step charges the multipliers of the sensors that are still to come.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assoc.errors import InfeasibleError
from assoc.solvers import dimensionwise
from assoc.solvers.assignment2d import match
from assoc.solvers.bounds import certified_bound, dual_bound, hard_pass, reduced_costs
from assoc.solvers.local_search import Cover
from assoc.solvers.metaheuristic import Part, bound_of_part, complete, split_components, weight_of
from assoc.solvers.packing import Packing
from assoc.solvers.run import Outcome, Run

if TYPE_CHECKING:
    from assoc.solvers.lagrangian import LagrangianParameters

Floats = NDArray[np.float64]

# columns below which a component is not worth a part of its own
_SMALL = 300


def relax(packing: Packing, parameters: LagrangianParameters, run: Run) -> Outcome:
    """Solve every component by successive relaxation."""
    if parameters.warm_start:
        duals = dual_bound(packing, levels=8, passes=25, run=run)
    else:
        duals = np.zeros(packing.num_rows)
        hard_pass(packing, duals, np.empty(packing.num_columns), 1)
    parts = _parts(packing, duals)
    bound = sum(part.bound for part in parts)
    proof = duals.copy()
    columns: list[NDArray[np.int64]] = []
    weight = 0.0
    total = 0.0
    steps = 0
    for c, (part, place) in enumerate(zip(parts, _rows_of(packing, parts), strict=True)):
        bound -= part.bound
        steps += _Relaxation(part, parameters).run(run)
        if part.best is None:
            complete(part, run)
        assert part.best is not None
        columns.append(part.origin[np.unique(part.best[part.best >= 0])])
        weight += part.weight
        proof[place] = part.duals
        total += part.bound if parameters.gap > 0 else bound_of_part(part, run)
        run.record(steps, weight if c == len(parts) - 1 else np.inf, total + bound)
    chosen = np.concatenate(columns) if columns else np.zeros(0, dtype=np.int64)
    return Outcome(chosen, steps, total, proof if total <= certified_bound(packing, proof) else None)


def _parts(packing: Packing, duals: Floats) -> list[Part]:
    """The large components, each on its own, and all small ones as one part: they are cheap only together."""
    parts = split_components(packing, duals, np.arange(packing.num_columns))
    small = np.diff(packing.col_start) < _SMALL
    if np.count_nonzero(small) < 2 or packing.is_axial:
        return parts
    together = packing.restrict(np.repeat(small, np.diff(packing.col_start)))
    own = duals[together.row_origin]
    merged = Part(
        together,
        own,
        reduced_costs(together, own),
        certified_bound(together, own),
        together.origin.astype(np.int64),
    )
    return [merged, *(part for part, is_small in zip(parts, small, strict=True) if not is_small)]


def _rows_of(packing: Packing, parts: list[Part]) -> list[NDArray[np.int64]]:
    """Rows of each part, in the part's own order."""
    component_of_row = np.repeat(np.arange(packing.num_components), np.diff(packing.row_start))
    component_of_column = np.repeat(np.arange(packing.num_components), np.diff(packing.col_start))
    return [
        np.flatnonzero(np.isin(component_of_row, component_of_column[part.origin])).astype(np.int64) for part in parts
    ]


class _Relaxation:
    """One component: its groups of columns, its multipliers, its best bound and cover."""

    def __init__(self, part: Part, parameters: LagrangianParameters) -> None:
        self.part = part
        self.parameters = parameters
        packing = part.packing
        cols = packing.cols
        # columns in lexicographic order: those that agree in sensors 1..s stand together for every s
        self.order = np.lexsort(cols.T[::-1])
        self.cols = cols[self.order]
        self.weights = packing.weights[self.order]
        self.sensors = cols.shape[1]
        new = np.ones(self.cols.shape, dtype=bool)
        new[1:] = np.logical_or.accumulate(self.cols[1:] != self.cols[:-1], axis=1)
        # prefix[s, j]: number of the group of columns that agree with column j in sensors 0..s
        self.prefix = (np.cumsum(new, axis=0) - 1).T.copy()

    def run(self, run: Run) -> int:
        """Take subgradient steps until the gap is closed, progress ends, or time is over."""
        part, parameters = self.part, self.parameters
        duals = part.duals.copy()
        factor = parameters.step
        stalled = 0
        step = 0
        relaxed_rows = self._rows_of_later_sensors()
        while step < parameters.iterations:
            step += 1
            before = part.bound, part.weight
            try:
                value, chosen, proof = self._relaxed(duals)
            except InfeasibleError:
                part.best = None
                break
            self._raise_bound(proof)
            self._recover(chosen, duals)
            if part.closed or part.weight - part.bound <= parameters.gap * max(1.0, abs(part.weight)):
                break
            better = part.bound > before[0] + part.tolerance or part.weight < before[1]
            stalled = 0 if better else stalled + 1
            if stalled >= parameters.patience or run.should_stop() or relaxed_rows.size == 0:
                break
            if stalled and stalled % 5 == 0:
                factor *= 0.7
            subgradient = 1.0 - self._uses(chosen)
            subgradient[(duals >= 0.0) & part.packing.slack & (subgradient > 0)] = 0.0
            size = float((subgradient[relaxed_rows] ** 2).sum())
            if size == 0.0:
                break
            target = part.weight if part.weight < np.inf else value + 0.05 * abs(value) + 1.0
            duals[relaxed_rows] += factor * max(target - value, part.tolerance) / size * subgradient[relaxed_rows]
            np.minimum(duals, 0.0, out=duals, where=part.packing.slack)
        return step

    def _rows_of_later_sensors(self) -> NDArray[np.int32]:
        rows = self.cols[:, 2:]
        return np.unique(rows[rows >= 0])

    def _uses(self, chosen: NDArray[np.int64]) -> Floats:
        rows = self.cols[chosen]
        return np.bincount(rows[rows >= 0], minlength=self.part.packing.num_rows).astype(float)

    def _relaxed(self, duals: Floats) -> tuple[float, NDArray[np.int64], Floats]:
        """The relaxed problem: L(u), its columns (in sorted order), and multipliers of all rows that prove it."""
        slack = self.part.packing.slack
        later = self.cols[:, 2:]
        priced = self.weights - np.where(later >= 0, duals[later], 0.0).sum(axis=1)
        best = self._cheapest(1 if self.sensors > 1 else 0, priced)
        first = self.cols[best, 0]
        second = self.cols[best, 1] if self.sensors > 1 else np.full(best.size, -1)
        chosen, row_duals = _match_rows(first, second, priced[best], slack)
        proof = duals.copy()
        proof[row_duals[0]] = row_duals[1]
        # tuples without sensors 1 and 2: at most one for each measurement of their first sensor
        rest = np.flatnonzero((first < 0) & (second < 0) & (priced[best] < 0.0))
        picked = best[chosen]
        value = float(priced[picked].sum()) + float(duals[self._rows_of_later_sensors()].sum())
        if rest.size:
            loose = np.flatnonzero((self.cols[:, 0] < 0) & (self.cols[:, 1] < 0) & (priced < 0.0))
            head = self.cols[loose, (self.cols[loose] >= 0).argmax(axis=1)]
            order = np.lexsort((priced[loose], head))
            lead = order[np.flatnonzero(np.diff(head[order], prepend=-1))]
            picked = np.concatenate([picked, loose[lead]])
            value += float(priced[loose[lead]].sum())
        return value, picked, proof

    def _cheapest(self, last: int, priced: Floats) -> NDArray[np.int64]:
        """Cheapest column of each group that agrees in sensors 0..last."""
        group = self.prefix[last]
        order = np.lexsort((priced, group))
        lead = np.ones(order.size, dtype=bool)
        lead[1:] = group[order][1:] != group[order][:-1]
        return order[lead]

    def _raise_bound(self, proof: Floats) -> None:
        part = self.part
        reduced = np.empty(part.packing.num_columns)
        feasible = np.where(part.packing.slack, np.minimum(proof, 0.0), proof)
        hard_pass(part.packing, feasible, reduced, 1)
        bound = certified_bound(part.packing, feasible)
        if bound > part.bound:
            part.bound, part.duals, part.reduced = bound, feasible, reduced

    def _recover(self, chosen: NDArray[np.int64], duals: Floats) -> None:
        """Turn the relaxed choice into a cover: assign what is kept to sensor 3, then to 4, up to S."""
        part = self.part
        kept = np.zeros(0, dtype=np.int64)
        group = self.prefix[min(1, self.sensors - 1)]
        kept = np.unique(group[chosen])
        for s in range(2, self.sensors):
            empty = (self.cols[:, :s] < 0).all(axis=1)
            eligible = np.flatnonzero(np.isin(self.prefix[s - 1], kept) | empty)
            later = self.cols[:, s + 1 :]
            priced = self.weights - np.where(later >= 0, duals[later], 0.0).sum(axis=1)
            left = np.where(empty[eligible], -1, self.prefix[s - 1][eligible])
            # cheapest continuation of each (kept group, measurement of sensor s)
            by_group = np.lexsort((priced[eligible], self.prefix[s][eligible]))
            lead = np.ones(by_group.size, dtype=bool)
            lead[1:] = self.prefix[s][eligible][by_group][1:] != self.prefix[s][eligible][by_group][:-1]
            best = by_group[lead]
            columns = eligible[best]
            names, place = np.unique(left[best], return_inverse=True)
            place = np.where(left[best] < 0, -1, place)
            try:
                picked = _match_groups(
                    place, names.size, self.cols[columns, s], priced[columns], part.packing.slack, part.packing.is_axial
                )
            except InfeasibleError:
                return
            kept = np.unique(self.prefix[s][columns[picked]])
        last = self.prefix[self.sensors - 1]
        final = np.flatnonzero(np.isin(last, kept))
        # of columns listed twice the cheaper one
        final = final[np.lexsort((self.weights[final], last[final]))]
        lead = np.ones(final.size, dtype=bool)
        lead[1:] = last[final][1:] != last[final][:-1]
        cover = Cover.empty(part.packing)
        cover.add_greedily(self.order[final[lead]])
        if self.parameters.polish:
            if cover.complete_already:
                part.offer(cover.owner, weight_of(part, cover.owner))
                dimensionwise.improve(part.packing, cover.owner)
            cover.improve()
        part.offer(cover.owner, weight_of(part, cover.owner))


def _match_rows(
    first: NDArray[np.int32], second: NDArray[np.int32], costs: Floats, slack: NDArray[np.bool_]
) -> tuple[NDArray[np.int64], tuple[NDArray[np.int64], Floats]]:
    """Match the rows of sensor 1 to those of sensor 2; chosen entries, and (rows, multipliers)."""
    left_rows, left = np.unique(first[first >= 0], return_inverse=True)
    right_rows, right = np.unique(second[second >= 0], return_inverse=True)
    place_left = np.full(first.size, -1)
    place_left[first >= 0] = left
    place_right = np.full(second.size, -1)
    place_right[second >= 0] = right
    picked, u, v = _match(place_left, place_right, costs, slack[left_rows], slack[right_rows])
    return picked, (np.concatenate([left_rows, right_rows]), np.concatenate([u, v]))


def _match_groups(
    group: NDArray[np.int64],
    num_groups: int,
    row: NDArray[np.int32],
    costs: Floats,
    slack: NDArray[np.bool_],
    axial: bool,
) -> NDArray[np.int64]:
    """Match kept groups to the rows of one sensor; chosen entries."""
    rows, place = np.unique(row[row >= 0], return_inverse=True)
    place_row = np.full(row.size, -1)
    place_row[row >= 0] = place
    # a kept group may be given up where its measurements may stay uncovered
    names = np.unique(group[group >= 0])
    place_group = np.where(group >= 0, np.searchsorted(names, group), -1)
    return _match(place_group, place_row, costs, np.full(names.size, not axial), slack[rows])[0]


def _match(
    left: NDArray[np.int64],
    right: NDArray[np.int64],
    costs: Floats,
    left_slack: NDArray[np.bool_],
    right_slack: NDArray[np.bool_],
) -> tuple[NDArray[np.int64], Floats, Floats]:
    """Sparse 2-D assignment in which -1 stands for nobody; chosen entries and the duals of both sides."""
    alone_left, entry_left = _alone(left, right, costs, left_slack)
    alone_right, entry_right = _alone(right, left, costs, right_slack)
    edges = np.flatnonzero((left >= 0) & (right >= 0))
    edges = edges[np.argsort(left[edges], kind="stable")]
    pointer = np.zeros(left_slack.size + 1, dtype=np.int64)
    np.cumsum(np.bincount(left[edges], minlength=left_slack.size), out=pointer[1:])
    matching = match(pointer, right[edges], costs[edges], alone_left, alone_right)
    matched = matching.row_edge >= 0
    picked = edges[matching.row_edge[matched]]
    lonely = np.ones(right_slack.size, dtype=bool)
    lonely[right[picked]] = False
    chosen = np.concatenate([picked, entry_left[~matched], entry_right[lonely]])
    return chosen[chosen >= 0], matching.row_duals, matching.column_duals


def _alone(
    side: NDArray[np.int64], opposite: NDArray[np.int64], costs: Floats, slack: NDArray[np.bool_]
) -> tuple[Floats, NDArray[np.int64]]:
    """Cost of staying alone for each member of a side, and the entry that says so (-1: uncovered)."""
    cost = np.where(slack, 0.0, np.inf)
    entry = np.full(slack.size, -1, dtype=np.int64)
    lonely = np.flatnonzero((side >= 0) & (opposite < 0))
    lonely = lonely[costs[lonely] < cost[side[lonely]]]
    lonely = lonely[np.argsort(-costs[lonely], kind="stable")]
    cost[side[lonely]] = costs[lonely]
    entry[side[lonely]] = lonely
    return cost, entry
