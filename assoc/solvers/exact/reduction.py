"""Dual ascent, rounding and reduced-cost fixing in turn, on all components at once.

At each temperature of the dual ascent (dual_ascent.py) the columns of smallest reduced cost are rounded to a
cover. Between its weight and the bound lies each component's gap: columns with a larger reduced cost cannot
be in a better solution and are dropped, rows without columns go with them, and components whose gap is
closed are done. Most components of a gated scene never need more than this. The whole course is one kernel,
which comes back now and then for a look at the clock.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assoc._system.clock import is_over
from assoc._system.compiled import njit
from assoc._types import Floats
from assoc.packing.bounds import dual_ascent
from assoc.packing.bounds.dual_ascent import _component_bounds, _hard_sweeps, _reduced_costs, _smooth_passes, _spread
from assoc.packing.components.component import TOLERANCE, Part
from assoc.packing.components.splitting import split_components
from assoc.packing.neighbourhoods.insertion import _add_greedily, _improve, penalised_weights
from assoc.packing.packing import Packing, _assemble, _find
from assoc.packing.run import Run

# passes at one temperature; the last temperatures get more, because by then few columns are left
_PASSES = np.array([10, 10, 10, 20, 30, 60, 60, 100, 200, 200, 200])
# visits of columns between two looks at the clock: about ten milliseconds
_VISITS = 3_000_000
# classes of reduced cost, by which columns are sorted before rounding
_CLASSES = 256


class Reduction:
    """The state of the reduction.

    Attributes
    ----------
    closed_columns : list of int arrays
        Optimal columns of the components that are done, as columns of the packing given at the start.
    closed_bound, closed_weight : float
        Sum of their bounds and of their weights.
    """

    def __init__(self, packing: Packing, run: Run) -> None:
        self.closed_columns: list[NDArray[np.int64]] = []
        self.closed_bound = 0.0
        self.closed_weight = 0.0
        self._run = run
        self._whole = packing
        self._proof = np.zeros(packing.num_rows)

    @property
    def proof(self) -> Floats | None:
        """Multipliers of all rows that alone prove ``closed_bound``; None where dropping columns was part of it.

        Columns are dropped by the multipliers of the moment. Those found later, for the rows and columns that
        are left, may give a dropped column a negative reduced cost; passes over the whole problem mend that,
        on small problems mostly without loss.
        """
        duals = self._proof.copy()
        dual_ascent.hard_pass(self._whole, duals, np.empty(self._whole.num_columns), 2)
        loss = self.closed_bound - dual_ascent.certified_bound(self._whole, duals)
        return duals if loss <= TOLERANCE * max(1.0, abs(self.closed_bound)) else None

    def reduce(self) -> list[Part]:
        """Run through all temperatures; return the parts that are still open."""
        whole = self._whole
        num = whole.num_rows
        columns, closed = np.empty(num, dtype=np.int64), np.empty((num, 2))
        counts = np.zeros(3, dtype=np.int64)
        state: Any = _start(
            whole.cols, whole.weights, whole.slack, whole.col_start, whole.row_start, whole.row_ptr, whole.row_cols
        )
        while counts[0] < _PASSES.size and state[1].size and not self._run.should_stop():
            state = _reduce(
                *state, _PASSES, counts, columns, closed, self._proof, TOLERANCE, whole.granularity, _VISITS,
                self._run.deadline(),
            )  # fmt: skip
        self.closed_columns.append(columns[: counts[1]])
        self.closed_bound = math.fsum(closed[: counts[2], 0])
        self.closed_weight = math.fsum(closed[: counts[2], 1])
        return self._open_parts(*state) if state[2].size else []

    def _open_parts(
        self, cols: Any, weights: Any, slack: Any, col_start: Any, row_start: Any, row_ptr: Any, row_cols: Any,
        origin: Any, rows: Any, smooth: Any, hard: Any, owner: Any, weight: Any, bound: Any, temperature: Any,
    ) -> list[Part]:  # fmt: skip
        packing = Packing(
            cols, weights, slack, col_start, row_start, row_ptr, row_cols, origin, rows, self._whole.granularity
        )
        parts = split_components(packing, hard, origin.astype(np.int64))
        for c, part in enumerate(parts):
            if np.isfinite(weight[c]):
                own = owner[row_start[c] : row_start[c + 1]]
                part.best = np.where(own >= 0, own - col_start[c], -1).astype(np.int32)
                part.weight = float(weight[c])
            part.bound = max(part.bound, float(bound[c]))
        self._proof[rows] = hard
        return parts


@njit
def _start(cols: Any, weights: Floats, slack: Any, col_start: Any, row_start: Any, row_ptr: Any, row_cols: Any) -> Any:
    """The state of the reduction at its start."""
    num, num_rows, parts = weights.size, slack.size, col_start.size - 1
    smooth = np.zeros(num_rows)
    reduced = np.empty(num)
    _reduced_costs(cols, weights, smooth, reduced)
    _hard_sweeps(slack, row_ptr, row_cols, smooth, reduced, 1)
    temperature = _spread(weights, slack, col_start, row_start) * dual_ascent.START
    return (
        cols, weights, slack, col_start, row_start, row_ptr, row_cols,
        np.arange(num).astype(np.int32), np.arange(num_rows).astype(np.int32), smooth, smooth.copy(),
        np.full(num_rows, -1, np.int32), np.full(parts, np.inf), np.full(parts, -np.inf), temperature,
    )  # fmt: skip


@njit
def _reduce(
    cols: Any, weights: Floats, slack: Any, col_start: Any, row_start: Any, row_ptr: Any, row_cols: Any,
    origin: Any, rows: Any, smooth: Floats, hard: Floats, owner: Any, weight: Floats, bound: Floats,
    temperature: Floats, passes: Any, counts: Any, closed_columns: Any, closed: Floats, proof: Floats,
    tolerance: float, granularity: float, most_visits: int, deadline: float,
) -> Any:  # fmt: skip
    """Go through temperatures until none is left, nothing is open or the visits are used up; the new state.

    ``counts`` holds the temperatures done, the number of closed columns and that of closed components.
    """
    visits = 0
    while counts[0] < passes.size and weights.size > 0 and visits < most_visits:
        reduced, primal, slack_primal = np.empty(weights.size), np.empty(weights.size), np.empty(slack.size)
        visits += _smooth_passes(
            cols, weights, slack, row_start, col_start, row_ptr, row_cols, smooth, reduced, primal, slack_primal,
            temperature, passes[counts[0]], deadline,
        )  # fmt: skip
        # the first cover and the first bound are worth being late for
        if counts[0] > 0 and is_over(deadline):
            break
        duals = smooth.copy()
        _reduced_costs(cols, weights, duals, reduced)
        _hard_sweeps(slack, row_ptr, row_cols, duals, reduced, 2)
        new_owner = _round(cols, weights, slack, col_start, row_ptr, row_cols, reduced, temperature, deadline)
        keep, alive = _compare(
            cols, weights, slack, col_start, row_start,
            _component_bounds(cols, weights, slack, col_start, row_start, row_ptr, duals), duals, new_owner,
            reduced, bound, hard, owner, weight, tolerance, granularity,
        )  # fmt: skip
        temperature = temperature * dual_ascent.COOLING
        counts[0] += 1
        kept = 0
        for j in range(keep.size):
            kept += keep[j]
        # assembling anew pays when much is gone; till then what is closed is closed again at every temperature
        if 3 * kept >= 2 * keep.size and counts[0] < passes.size:
            continue
        for c in range(alive.size):
            if not alive[c]:
                closed[counts[2]] = bound[c], weight[c]
                counts[2] += 1
                for r in range(row_start[c], row_start[c + 1]):
                    j = owner[r]
                    if j >= 0 and _first_row(cols, j) == r:
                        closed_columns[counts[1]] = origin[j]
                        counts[1] += 1
        # a dropped row's multiplier stays part of the proof: rows can only leave with all their columns
        for r in range(rows.size):
            proof[rows[r]] = hard[r]
        chosen = np.empty(kept, np.int32)
        place = np.full(keep.size, -1, np.int32)
        kept = 0
        for j in range(keep.size):
            if keep[j]:
                chosen[kept] = j
                kept += 1
        # rows without slack of components that are done have been covered: they leave as rows with slack do
        free = slack.copy()
        parent = np.empty(slack.size, np.int32)
        for c in range(alive.size):
            parent[row_start[c] : row_start[c + 1]] = c
            if not alive[c]:
                free[row_start[c] : row_start[c + 1]] = True
        (cols, weights, slack, col_start, row_start, row_ptr, row_cols, column, row) = _assemble(
            cols[chosen], weights[chosen], free, chosen
        )
        for j in range(column.size):
            place[column[j]] = j
        new_owner = np.empty(row.size, np.int32)
        for r in range(row.size):
            j = owner[row[r]]
            new_owner[r] = place[j] if j >= 0 else -1
        owner, smooth, hard, origin, rows = new_owner, smooth[row], hard[row], origin[column], rows[row]
        # the parts of a component start from the same cover and the same multipliers
        first = parent[row[row_start[:-1]]]
        temperature = temperature[first]
        new_weight = _cover_weights(weights, cols, row_start, owner)
        for c in range(new_weight.size):
            if weight[first[c]] == np.inf:
                new_weight[c] = np.inf
        weight = new_weight
        bound = _component_bounds(cols, weights, slack, col_start, row_start, row_ptr, hard)
    return (
        cols, weights, slack, col_start, row_start, row_ptr, row_cols, origin, rows, smooth, hard, owner, weight,
        bound, temperature,
    )  # fmt: skip


@njit
def _round(
    cols: Any, weights: Floats, slack: Any, col_start: Any, row_ptr: Any, row_cols: Any, reduced: Floats,
    temperature: Floats, deadline: float,
) -> Any:  # fmt: skip
    """A cover from the columns of small reduced cost, improved by insertion."""
    # sorted by counting: classes of 1/64 temperature are fine enough, and ties stay in their order
    which = np.full(weights.size, _CLASSES, np.int32)
    start = np.zeros(_CLASSES + 1, np.int64)
    for c in range(temperature.size):
        scale = _CLASSES / (4.0 * temperature[c])
        for j in range(col_start[c], col_start[c + 1]):
            position = max(reduced[j], 0.0) * scale
            if position < _CLASSES:
                which[j] = int(position)
                start[which[j] + 1] += 1
    for k in range(_CLASSES):
        start[k + 1] += start[k]
    order = np.empty(start[_CLASSES], np.int64)
    for j in range(weights.size):
        if which[j] < _CLASSES:
            order[start[which[j]]] = j
            start[which[j]] += 1
    owner = np.full(slack.size, -1, np.int32)
    _add_greedily(cols, weights, slack, order, owner)
    loose = np.flatnonzero(owner < 0).astype(np.int32)
    if loose.size > 0:
        axial = False
        for r in range(slack.size):
            if not slack[r]:
                axial = True
                break
        priced = penalised_weights(cols, weights, slack) if axial else weights
        _improve(cols, priced, row_ptr, row_cols, owner, loose, deadline)
    return owner


@njit
def _first_row(cols: Any, j: int) -> int:
    for s in range(cols.shape[1]):
        if cols[j, s] >= 0:
            return int(cols[j, s])
    return -1


@njit
def _cover_weights(weights: Floats, cols: Any, row_start: Any, owner: Any) -> Floats:
    """Weight of the chosen columns of each component."""
    result = np.zeros(row_start.size - 1)
    for c in range(result.size):
        for r in range(row_start[c], row_start[c + 1]):
            j = owner[r]
            if j >= 0 and _first_row(cols, j) == r:
                result[c] += weights[j]
    return result


@njit
def _best_of_both(
    cols: Any, weights: Floats, top: int, end: int, owner: Any, other: Any, parent: Any, gain: Floats
) -> float:  # fmt: skip
    """Take over from another complete cover of a component what is lighter there; the weight then.

    Where two covers differ, the columns of both fall into groups that share no row: each can be exchanged alone.
    """
    for r in range(top, end):
        parent[r] = r
        gain[r] = 0.0
    for r in range(top, end):
        for j in (owner[r], other[r]):
            if j >= 0:
                one, two = _find(parent, r), _find(parent, _first_row(cols, j))
                parent[max(one, two)] = min(one, two)
    for r in range(top, end):
        root = _find(parent, r)
        if owner[r] >= 0 and _first_row(cols, owner[r]) == r:
            gain[root] += weights[owner[r]]
        if other[r] >= 0 and _first_row(cols, other[r]) == r:
            gain[root] -= weights[other[r]]
    total = 0.0
    for r in range(top, end):
        root = _find(parent, r)
        if gain[root] > 0.0:
            owner[r] = other[r]
        if owner[r] >= 0 and _first_row(cols, owner[r]) == r:
            total += weights[owner[r]]
    return total


@njit
def _compare(
    cols: Any,
    weights: Floats,
    slack: Any,
    col_start: Any,
    row_start: Any,
    new_bound: Floats,
    new_duals: Floats,
    new_owner: Any,
    reduced: Floats,
    bound: Floats,
    duals: Floats,
    owner: Any,
    weight: Floats,
    tolerance: float,
    granularity: float,
) -> Any:
    """Take over better bounds and covers; the columns worth keeping and the components still open."""
    new_weight = _cover_weights(weights, cols, row_start, new_owner)
    keep = np.zeros(weights.size, np.bool_)
    alive = np.ones(bound.size, np.bool_)
    parent, gain = np.empty(slack.size, np.int32), np.empty(slack.size)
    for c in range(bound.size):
        top, end = row_start[c], row_start[c + 1]
        complete = True
        for r in range(top, end):
            if not slack[r] and new_owner[r] < 0:
                complete = False
                break
        if complete and weight[c] < np.inf:
            weight[c] = _best_of_both(cols, weights, top, end, owner, new_owner, parent, gain)
        elif complete:
            weight[c] = new_weight[c]
            owner[top:end] = new_owner[top:end]
        if new_bound[c] >= bound[c]:
            bound[c] = new_bound[c]
            duals[top:end] = new_duals[top:end]
        # whole-numbered weights: what is not better by nearly 1 is not better
        step = 0.999 * granularity
        gap = weight[c] - new_bound[c] - step
        # the saved bound and multipliers may be better than these; either is a proof
        if weight[c] - bound[c] <= max(tolerance * max(1.0, abs(bound[c])), step):
            alive[c] = False
            if granularity > 0.0:
                bound[c] = max(bound[c], weight[c])
            continue
        for j in range(col_start[c], col_start[c + 1]):
            keep[j] = reduced[j] <= gap
        for r in range(top, end):
            if owner[r] >= 0 and weight[c] < np.inf:
                keep[owner[r]] = True
    return keep, alive
