"""Dual ascent, rounding and reduced-cost fixing in turn, on all components at once.

At each temperature of the dual ascent (dual_ascent.py) the columns of smallest reduced cost are rounded to a
cover. The gap of each component lies between its weight and the bound: columns with a larger reduced cost cannot
be in a better solution and are dropped, rows without columns go with them, and components whose gap is
closed are done. Most components of a gated scene need no more than this. The whole course is one kernel,
which returns regularly so that Python can check the time.
"""

from __future__ import annotations

import math
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._system.clock import is_over
from assoc._system.compiled import inner_njit, njit
from assoc._system.kernels.copying import copy_to
from assoc._types import Floats
from assoc.packing.bounds.dual_ascent import (
    COOLING,
    START,
    SmoothPoint,
    bounds_by_component,
    certified_bound,
    hard_sweeps,
    smooth_passes,
    spread,
)
from assoc.packing.bounds.priced import TOLERANCE
from assoc.packing.component import Component, split_components
from assoc.packing.cover import Cover, best_of_both
from assoc.packing.kernels.columns import first_row
from assoc.packing.neighbourhoods.insertion import add_greedily, insert_and_eject, penalised
from assoc.packing.packing import Packing, PackingArrays, assembled
from assoc.packing.run import Run

# passes at one temperature; the last temperatures get more, because few columns are left by then
_PASSES = np.array([7, 10, 10, 20, 30, 60, 60, 100, 200, 200, 200])
# visits of columns between two checks of the time: about ten milliseconds
_VISITS = 3_000_000
# classes of reduced cost into which columns are sorted before rounding
_CLASSES = 256
# elements up to which a call may be interpreted: a problem of the usual size and the state of the reduction
_SMALL = 8000


class _State(NamedTuple):
    """The open part: its packing, and the origin of its columns and rows."""

    packing: PackingArrays
    origin: NDArray[np.int32]
    """Indices of columns in the whole packing, (N,)."""
    rows: NDArray[np.int32]
    """The same of rows, (R,)."""
    smooth: Floats
    """Multipliers of the smoothed ascent, (R,)."""
    hard: Floats
    """The feasible ones of the best bounds, (R,)."""
    owner: NDArray[np.int32]
    """The best cover of each component that has one, (R,)."""
    weight: Floats
    """Weight of each component's best cover (``inf``: none), (C,)."""
    bound: Floats
    temperature: Floats


class _Closed(NamedTuple):
    """The closed part, filled step by step."""

    counts: NDArray[np.int64]
    """Temperatures done, closed columns, closed components."""
    columns: NDArray[np.int64]
    """Optimal columns, as indices in the whole packing."""
    values: Floats
    """Bound and weight of each closed component, (R, 2)."""
    proof: Floats
    """Multipliers of all rows of the whole packing, (R,)."""


class _Incumbent(NamedTuple):
    """Best bounds and covers: ``bound`` (C,), ``duals`` (R,), ``owner`` (R,), ``weight`` (C,)."""

    bound: Floats
    duals: Floats
    owner: NDArray[np.int32]
    weight: Floats


class Reduction:
    """The state of the reduction.

    ``closed_columns`` are the optimal columns of the closed components, of the packing given at the start,
    ``closed_bound`` and ``closed_weight`` the sums of their bounds and weights.
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
        """Multipliers of all rows that alone prove ``closed_bound``; None where the proof also needs dropped columns.

        Columns are dropped by the multipliers of that moment. Later multipliers, of the rows and columns that are
        left, may give a dropped column a negative reduced cost; passes over the whole problem repair that, mostly
        without loss on small problems.
        """
        duals = self._proof.copy()
        hard_sweeps(self._whole.arrays, duals, np.empty(self._whole.num_columns), 2)
        loss = self.closed_bound - certified_bound(self._whole, duals)
        return duals if loss <= TOLERANCE * max(1.0, abs(self.closed_bound)) else None

    def reduce(self) -> list[Component]:
        """Go through all temperatures; return the components that are still open."""
        num, granularity = self._whole.num_rows, self._whole.granularity
        counts = np.zeros(3, dtype=np.int64)
        closed = _Closed(counts, np.empty(num, dtype=np.int64), np.empty((num, 2)), self._proof)
        state = _state(_reduce(self._beginning(), closed, granularity, self._run.deadline()))
        while state and counts[0] < _PASSES.size and state.packing.weights.size and not self._run.should_stop():
            state = _state(_reduce(state, closed, granularity, self._run.deadline()))
        self.closed_columns.append(closed.columns[: counts[1]])
        self.closed_bound = math.fsum(closed.values[: counts[2], 0])
        self.closed_weight = math.fsum(closed.values[: counts[2], 1])
        return self._open_components(state) if state else []

    def _beginning(self) -> _State:
        """The whole packing with its incumbents; the kernel's first call fills in multipliers and temperatures."""
        num, rows, components = self._whole.num_columns, self._whole.num_rows, self._whole.num_components
        owner, weight = self._incumbents()
        return _State(
            packing=self._whole.arrays,
            origin=np.arange(num, dtype=np.int32),
            rows=np.arange(rows, dtype=np.int32),
            smooth=np.zeros(rows),
            hard=np.empty(rows),
            owner=owner,
            weight=weight,
            bound=np.full(components, -np.inf),
            temperature=np.empty(components),
        )

    def _incumbents(self) -> tuple[NDArray[np.int32], Floats]:
        """The known cover, for the components that it covers completely: the column of each row, and weights."""
        whole = self._whole
        if self._run.start is None:
            return np.full(whole.num_rows, -1, dtype=np.int32), np.full(whole.num_components, np.inf)
        cover = Cover.of(whole, self._run.start)
        uncovered = np.flatnonzero((cover.owner < 0) & ~whole.slack)
        component = np.searchsorted(whole.col_start, self._run.start, side="right") - 1
        weight = np.zeros(whole.num_components)
        np.add.at(weight, component, whole.weights[self._run.start])
        weight[np.searchsorted(whole.row_start, uncovered, side="right") - 1] = np.inf
        return cover.owner, weight

    def _open_components(self, state: _State) -> list[Component]:
        packing = Packing(*state.packing, state.origin, state.rows, self._whole.granularity)
        components = split_components(packing, state.hard, state.origin.astype(np.int64))
        for c, component in enumerate(components):
            if np.isfinite(state.weight[c]):
                own = state.owner[packing.row_start[c] : packing.row_start[c + 1]]
                component.best = np.where(own >= 0, own - packing.col_start[c], -1).astype(np.int32)
                component.weight = float(state.weight[c])
            component.bound = max(component.bound, float(state.bound[c]))
        self._proof[state.rows] = state.hard
        return components


def _state(arrays: Any) -> _State | None:
    """Make a state of the arrays that a kernel returns."""
    count = len(PackingArrays._fields)
    return None if arrays is None else _State(PackingArrays(*arrays[:count]), *arrays[count:])


@partial(njit, small=_SMALL)
def _reduce(state: _State, done: _Closed, granularity: float, deadline: float) -> Any:
    """Go through the temperatures, from the first or from where the last call stopped, until the visits are used up.

    Returns the arrays of the new state in order; None if nothing is open. They are a plain tuple: if Ctrl-C comes while
    a result is converted, numba calls a record's class before it has found it, and the process crashes.
    """
    packing, origin, rows, smooth, hard, owner, weight, bound, temperature = state
    counts, closed_columns, closed, proof = done
    if counts[0] == 0:
        hard_sweeps(packing, smooth, np.empty(packing.weights.size), 1)
        copy_to(hard, smooth)
        width = spread(packing)
        for c in range(width.size):
            temperature[c] = width[c] * START
    visits = 0
    while counts[0] < _PASSES.size and packing.weights.size > 0 and visits < _VISITS:
        num, num_rows = packing.weights.size, packing.slack.size
        updated, reduced = np.empty(num), np.empty(num)
        point = SmoothPoint(smooth, updated, np.empty(num), np.empty(num_rows))
        visits += smooth_passes(packing, point, temperature, _PASSES[counts[0]], deadline)
        # the first cover and the first bound are worth being late
        if counts[0] > 0 and is_over(deadline):
            break
        duals = smooth.copy()
        hard_sweeps(packing, duals, updated, 2)
        new_owner = _round(packing, updated, temperature, deadline)
        best = _Incumbent(bound, hard, owner, weight)
        new_bound = bounds_by_component(packing, duals, reduced)
        new = _Incumbent(new_bound, duals, new_owner, _cover_weights(packing, new_owner))
        keep, alive = _compare(packing, best, new, reduced, granularity)
        for c in range(temperature.size):
            temperature[c] *= COOLING
        counts[0] += 1
        kept = 0
        for j in range(keep.size):
            kept += keep[j]
        # rebuilding pays off when much is gone; until then closed components are closed again at every temperature
        if 3 * kept >= 2 * keep.size and counts[0] < _PASSES.size:
            continue
        row_start = packing.row_start
        for c in range(alive.size):
            if not alive[c]:
                closed[counts[2], 0], closed[counts[2], 1] = bound[c], weight[c]
                counts[2] += 1
                for r in range(row_start[c], row_start[c + 1]):
                    j = owner[r]
                    if j >= 0 and first_row(packing.cols, j) == r:
                        closed_columns[counts[1]] = origin[j]
                        counts[1] += 1
        # a dropped row's multiplier stays part of the proof: rows leave only with all their columns
        for r in range(rows.size):
            proof[rows[r]] = hard[r]
        packing, origin, rows, smooth, hard, owner, weight, temperature = _rest(
            _State(packing, origin, rows, smooth, hard, owner, weight, bound, temperature), keep, alive
        )
        bound = bounds_by_component(packing, hard, reduced)
    if packing.slack.size == 0:
        return None
    return (
        packing.cols, packing.weights, packing.slack, packing.col_start, packing.row_start, packing.row_ptr,
        packing.row_cols, origin, rows, smooth, hard, owner, weight, bound, temperature,
    )  # fmt: skip


@inner_njit
def _rest(state: _State, keep: NDArray[np.bool_], alive: NDArray[np.bool_]) -> Any:
    """The fields of the state, but for bounds, with the columns to keep and the components that are alive."""
    packing, temperature = state.packing, state.temperature
    num_sensors, row_start = packing.cols.shape[1], packing.row_start
    kept = 0
    for j in range(keep.size):
        kept += keep[j]
    # element by element here and below: numba compiles every ``values[places]`` anew
    chosen, index = np.empty(kept, np.int32), np.full(keep.size, -1, np.int32)
    cols_kept, weights_kept = np.empty((kept, num_sensors), np.int32), np.empty(kept)
    kept = 0
    for j in range(keep.size):
        if keep[j]:
            chosen[kept], weights_kept[kept] = j, packing.weights[j]
            for s in range(num_sensors):
                cols_kept[kept, s] = packing.cols[j, s]
            kept += 1
    # rows without slack in closed components have been covered: they leave as rows with slack do
    free = packing.slack.copy()
    parent = np.empty(packing.slack.size, np.int32)
    for c in range(alive.size):
        parent[row_start[c] : row_start[c + 1]] = c
        if not alive[c]:
            free[row_start[c] : row_start[c + 1]] = True
    cols, weights, slack, col_start, row_start, row_ptr, row_cols, column, row = assembled(
        cols_kept, weights_kept, free, chosen
    )
    packing = PackingArrays(cols, weights, slack, col_start, row_start, row_ptr, row_cols)
    origin = np.empty(column.size, np.int32)
    for j in range(column.size):
        index[column[j]] = j
        origin[j] = state.origin[column[j]]
    # the parts of a component start from the same cover and the same multipliers
    owner, rows = np.empty(row.size, np.int32), np.empty(row.size, np.int32)
    smooth, hard = np.empty(row.size), np.empty(row.size)
    for r in range(row.size):
        j = state.owner[row[r]]
        owner[r] = index[j] if j >= 0 else -1
        rows[r], smooth[r], hard[r] = state.rows[row[r]], state.smooth[row[r]], state.hard[row[r]]
    cooled = np.empty(col_start.size - 1)
    weight = _cover_weights(packing, owner)
    for c in range(cooled.size):
        before = parent[row[row_start[c]]]
        cooled[c] = temperature[before]
        if state.weight[before] == np.inf:
            weight[c] = np.inf
    return packing, origin, rows, smooth, hard, owner, weight, cooled


@inner_njit
def _round(packing: PackingArrays, reduced: Floats, temperature: Floats, deadline: float) -> NDArray[np.int32]:
    """Build a cover from the columns of small reduced cost, and improve it by insertion."""
    weights, slack, col_start = packing.weights, packing.slack, packing.col_start
    # counting sort: classes of 1/64 temperature are fine enough, and ties stay in order
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
    order = np.empty(start[_CLASSES], np.int32)
    for j in range(weights.size):
        if which[j] < _CLASSES:
            order[start[which[j]]] = j
            start[which[j]] += 1
    owner = np.full(slack.size, -1, np.int32)
    add_greedily(packing, order, owner)
    loose = np.empty(slack.size, np.int32)
    count = 0
    for r in range(slack.size):
        if owner[r] < 0:
            loose[count] = r
            count += 1
    if count > 0:
        axial = False
        for r in range(slack.size):
            if not slack[r]:
                axial = True
                break
        searched = PackingArrays(
            packing.cols,
            penalised(packing) if axial else weights,
            slack,
            col_start,
            packing.row_start,
            packing.row_ptr,
            packing.row_cols,
        )
        insert_and_eject(searched, owner, loose[:count], deadline)
    return owner


@inner_njit
def _cover_weights(packing: PackingArrays, owner: NDArray[np.int32]) -> Floats:
    """Weight of the chosen columns of each component."""
    cols, weights, row_start = packing.cols, packing.weights, packing.row_start
    result = np.zeros(row_start.size - 1)
    for c in range(result.size):
        for r in range(row_start[c], row_start[c + 1]):
            j = owner[r]
            if j >= 0 and first_row(cols, j) == r:
                result[c] += weights[j]
    return result


@inner_njit
def _compare(
    packing: PackingArrays, best: _Incumbent, new: _Incumbent, reduced: Floats, granularity: float
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Take over better bounds and covers; returns which columns to keep and which components are still open."""
    cols, weights, slack = packing.cols, packing.weights, packing.slack
    col_start, row_start = packing.col_start, packing.row_start
    bound, duals, owner, weight = best
    new_bound, new_duals, new_owner, new_weight = new
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
            weight[c] = best_of_both(cols, weights, top, end, owner, new_owner, parent, gain)
        elif complete:
            weight[c] = new_weight[c]
            copy_to(owner[top:end], new_owner[top:end])
        if new_bound[c] >= bound[c]:
            bound[c] = new_bound[c]
            copy_to(duals[top:end], new_duals[top:end])
        # where weights are whole numbers, a better solution is better by at least 1
        step = 0.999 * granularity
        gap = weight[c] - new_bound[c] - step
        # the saved bound and multipliers may be better than the new ones; either is a proof
        if weight[c] - bound[c] <= max(TOLERANCE * max(1.0, abs(bound[c])), step):
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
