"""Dual ascent, rounding and reduced-cost fixing in turn, on all components at once.

At each temperature of the dual ascent (bounds.py) the columns of smallest reduced cost are rounded to a
cover. Between its weight and the bound lies each component's gap: columns with a larger reduced cost cannot
be in a better solution and are dropped, rows without columns go with them, and components whose gap is
closed are done. Most components of a gated scene never need more than this.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assoc._compiled import njit
from assoc.solvers import bounds
from assoc.solvers.local_search import _add_greedily, _improve, penalised
from assoc.solvers.metaheuristic import TOLERANCE, Part, split_components
from assoc.solvers.packing import Packing, assemble
from assoc.solvers.run import Run

Floats = NDArray[np.float64]

# passes at one temperature; the last temperatures get more, because by then few columns are left
_PASSES = (10, 10, 10, 20, 30, 60, 60, 100, 200, 200, 200)


class Reduction:
    """The state of the reduction.

    Attributes
    ----------
    closed_columns : list of int arrays
        Optimal columns of the components that are done, as columns of the packing given at the start.
    closed_bound, closed_weight : float
        Sum of their bounds and of their weights.
    packing : Packing
        What is left.
    origin : int array
        Its columns' places in the packing given at the start.
    """

    def __init__(self, packing: Packing, run: Run) -> None:
        self.packing = packing
        self.origin = np.arange(packing.num_columns)
        self.rows = np.arange(packing.num_rows)
        self.closed_columns: list[NDArray[np.int64]] = []
        self.closed_bound = 0.0
        self.closed_weight = 0.0
        self.passes = 0
        self._run = run
        self._size = packing.num_rows
        self._whole = packing
        self._proof = np.zeros(packing.num_rows)
        self._smooth = np.zeros(packing.num_rows)
        self._hard = np.zeros(packing.num_rows)
        self._owner = np.full(packing.num_rows, -1, dtype=np.int32)
        self._weight = np.full(packing.num_components, np.inf)
        self._bound = np.full(packing.num_components, -np.inf)

    @property
    def proof(self) -> Floats | None:
        """Multipliers of all rows that alone prove ``closed_bound``; None where dropping columns was part of it.

        Columns are dropped by the multipliers of the moment. Those found later, for the rows and columns that
        are left, may give a dropped column a negative reduced cost; passes over the whole problem mend that,
        on small problems mostly without loss.
        """
        duals = self._proof.copy()
        bounds.hard_pass(self._whole, duals, np.empty(self._whole.num_columns), 2)
        loss = self.closed_bound - bounds.certified_bound(self._whole, duals)
        return duals if loss <= TOLERANCE * max(1.0, abs(self.closed_bound)) else None

    def reduce(self) -> list[Part]:
        """Run through all temperatures; return the parts that are still open."""
        packing = self.packing
        temperature = bounds.START * bounds.spread(packing)
        bounds.hard_pass(packing, self._smooth, np.empty(packing.num_columns), 1)
        for passes in _PASSES:
            if self.packing.num_columns == 0 or self._run.should_stop():
                break
            temperature = self._step(temperature, passes) * bounds.COOLING
        return self._open_parts()

    def _step(self, temperature: Floats, passes: int) -> Floats:
        packing = self.packing
        reduced, primal, slack_primal = bounds.work_arrays(packing)
        bounds.smooth_pass(packing, self._smooth, reduced, primal, slack_primal, temperature, passes)
        self.passes += passes
        duals = self._smooth.copy()
        bounds.hard_pass(packing, duals, reduced, 2)
        owner = self._round(packing, reduced, temperature)
        keep, alive = _compare(
            packing.cols,
            packing.weights,
            packing.slack,
            packing.col_start,
            packing.row_start,
            bounds.component_bounds(packing, duals),
            duals,
            owner,
            reduced,
            self._bound,
            self._hard,
            self._owner,
            self._weight,
            TOLERANCE,
        )
        if not alive.all():
            self._close(~alive)
        if 3 * np.count_nonzero(keep) < 2 * keep.size or not alive.all():
            temperature = self._shrink(keep, alive, temperature)
        return temperature

    def _round(self, packing: Packing, reduced: Floats, temperature: Floats) -> NDArray[np.int32]:
        """A cover from the columns of small reduced cost, improved by insertion."""
        column_temperature = np.repeat(temperature, np.diff(packing.col_start))
        candidates = np.flatnonzero(reduced <= 4.0 * column_temperature)
        order = candidates[np.argsort(reduced[candidates], kind="stable")]
        owner = np.full(packing.num_rows, -1, dtype=np.int32)
        _add_greedily(packing.cols, packing.weights, packing.slack, order, owner)
        weights = penalised(packing) if packing.is_axial else packing.weights
        loose = np.flatnonzero(owner < 0).astype(np.int32)
        if loose.size:
            _improve(packing.cols, weights, packing.row_ptr, packing.row_cols, owner, loose)
        return owner

    def _close(self, done: NDArray[np.bool_]) -> None:
        packing = self.packing
        in_done = np.repeat(done, np.diff(packing.row_start))
        owner = self._owner[in_done]
        self.closed_columns.append(self.origin[np.unique(owner[owner >= 0])])
        self.closed_bound += math.fsum(self._bound[done])
        self.closed_weight += math.fsum(self._weight[done])
        self._proof[self.rows[in_done]] = self._hard[in_done]

    def _shrink(self, keep: NDArray[np.bool_], alive: NDArray[np.bool_], temperature: Floats) -> Floats:
        packing = self.packing
        # a dropped row's multiplier stays part of the proof: rows can only leave with all their columns
        self._proof[self.rows] = self._hard
        # rows without slack of components that are done have been covered: they leave as rows with slack do
        slack = packing.slack | np.repeat(~alive, np.diff(packing.row_start))
        chosen = np.flatnonzero(keep).astype(np.int32)
        smaller = assemble(packing.cols[chosen], packing.weights[chosen], slack, chosen)
        place = np.full(packing.num_columns, -1, dtype=np.int32)
        place[smaller.origin] = np.arange(smaller.num_columns, dtype=np.int32)
        parent = np.repeat(np.arange(packing.num_components), np.diff(packing.row_start))[smaller.row_origin]
        first = smaller.row_start[:-1]
        owner = self._owner[smaller.row_origin]
        self._owner = np.where(owner >= 0, place[owner], -1).astype(np.int32)
        self._smooth = self._smooth[smaller.row_origin]
        self._hard = self._hard[smaller.row_origin]
        self.origin = self.origin[smaller.origin]
        self.rows = self.rows[smaller.row_origin]
        self.packing = smaller
        # the parts of a component start from the same cover and the same multipliers
        known = np.isfinite(self._weight)[parent[first]] if first.size else np.zeros(0, dtype=bool)
        self._weight = np.where(
            known, _cover_weights(smaller.weights, smaller.cols, smaller.row_start, self._owner), np.inf
        )
        self._bound = bounds.component_bounds(smaller, self._hard)
        return temperature[parent[first]]

    def _open_parts(self) -> list[Part]:
        packing = self.packing
        parts = split_components(packing, self._hard, self.origin)
        for c, part in enumerate(parts):
            if np.isfinite(self._weight[c]):
                own = self._owner[packing.row_start[c] : packing.row_start[c + 1]]
                part.best = np.where(own >= 0, own - packing.col_start[c], -1).astype(np.int32)
                part.weight = float(self._weight[c])
            part.bound = max(part.bound, float(self._bound[c]))
        self._proof[self.rows] = self._hard
        return parts


@njit
def _cover_weights(weights: Floats, cols: Any, row_start: Any, owner: Any) -> Floats:
    """Weight of the chosen columns of each component."""
    result = np.zeros(row_start.size - 1)
    for c in range(result.size):
        for r in range(row_start[c], row_start[c + 1]):
            j = owner[r]
            if j >= 0:
                for s in range(cols.shape[1]):
                    if cols[j, s] >= 0:
                        if cols[j, s] == r:
                            result[c] += weights[j]
                        break
    return result


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
) -> Any:
    """Take over better bounds and covers; the columns worth keeping and the components still open."""
    new_weight = _cover_weights(weights, cols, row_start, new_owner)
    keep = np.zeros(weights.size, np.bool_)
    alive = np.ones(bound.size, np.bool_)
    for c in range(bound.size):
        top, end = row_start[c], row_start[c + 1]
        complete = True
        for r in range(top, end):
            if not slack[r] and new_owner[r] < 0:
                complete = False
                break
        if complete and new_weight[c] < weight[c]:
            weight[c] = new_weight[c]
            owner[top:end] = new_owner[top:end]
        if new_bound[c] >= bound[c]:
            bound[c] = new_bound[c]
            duals[top:end] = new_duals[top:end]
        gap = weight[c] - new_bound[c]
        # the saved bound and multipliers may be better than these; either is a proof
        if weight[c] - bound[c] <= tolerance * max(1.0, abs(bound[c])):
            alive[c] = False
            continue
        for j in range(col_start[c], col_start[c + 1]):
            keep[j] = reduced[j] <= gap
        for r in range(top, end):
            if owner[r] >= 0 and weight[c] < np.inf:
                keep[owner[r]] = True
    return keep, alive
