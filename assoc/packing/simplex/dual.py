"""The dual simplex method: from multipliers that are feasible to those that are optimal, uphill all the way.

The variable that leaves is chosen by the steepest edge. Its weights, the lengths of the inverse's rows, cost next to
nothing here, as the pass over the inverse that changes it yields them. The one that enters is chosen by the ratio test
of Harris: among those that come first to within a tolerance, the one with the largest pivot.

References
----------
J. J. Forrest and D. Goldfarb, "Steepest-edge simplex algorithms for linear programming", Mathematical Programming 57
(1992), 341-374.
P. M. J. Harris, "Pivot selection methods of the Devex LP code", Mathematical Programming 5 (1973), 1-28.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from assoc._system.clock import is_over
from assoc._system.compiled import njit
from assoc.packing.simplex.basis import (
    SMALL_PIVOT,
    Basis,
    begin_from_duals,
    coordinates,
    enter,
    exchange,
    price,
    refactor,
    residual,
)
from assoc.packing.simplex.program import Allowed, Program, make_feasible

# how a search ends: at the optimum, at the cutoff, without any solution, or before
OPTIMAL, CUT, INFEASIBLE, STOPPED = 0, 1, 2, 3

# values this far beyond their limits are within them; entries below this in a row of the tableau are 0
_VALUE = 1e-9
_ENTRY = 1e-9
# reduced costs, as a share of the largest weight: this far below 0 they are 0
_COST = 1e-12
# exchanges between two looks at the residual and at the clock, and after which everything is computed anew: a basis
# may be at work for thousands of short calls
_LOOK = 20
_FRESH = 400
_RESIDUAL = 1e-9
# exchanges for each row, many times what it takes: among costs of many magnitudes rounding can lead round in circles
_A_ROW = 200


class Effort(NamedTuple):
    """Where a search stops: at a bound of ``cutoff``, after so many exchanges, at a deadline (clock.py)."""

    cutoff: float
    exchanges: int
    deadline: float


@njit
def most_exchanges(program: Program) -> int:
    """Exchanges after which an optimum that has not been found is given up."""
    return _A_ROW * program.sides.size


@njit
def _leaving(program: Program, allowed: Allowed, basis: Basis) -> int:
    """The place whose variable is farthest outside its limits, measured along the edge; -1: none is."""
    num, size = program.weights.size, program.sides.size
    best = -1.0
    place = -1
    for i in range(size):
        value = basis.values[i]
        if -_VALUE <= value <= _VALUE:
            continue
        if value > 0.0:
            code = basis.variable[i]
            if code < num:
                if allowed.columns[code]:
                    continue
            elif code < num + size and allowed.slack[code - num]:
                continue
        score = value * value / basis.norms[i]
        # whatever rounding made of the norms, what is outside its limits must be found
        if not score <= best:
            best = score
            place = i
    return place


@njit
def _entering(program: Program, allowed: Allowed, basis: Basis, sign: float, tolerance: float) -> Any:
    """The variable that first limits the step of the multipliers, and the step; -1: none does.

    Fills ``steps`` with the row of the tableau, by the allowed columns.
    """
    row, steps, reduced, place = basis.row, basis.steps, basis.reduced, basis.place
    start, rows, active = program.start, program.rows, allowed.active
    least = np.inf
    for a in range(active.size):
        j = active[a]
        value = 0.0
        for k in range(start[j], start[j + 1]):
            value += row[rows[k]]
        value *= sign
        steps[a] = value
        if value > _ENTRY and place[j] < 0 and reduced[j] + tolerance < least * value:
            least = max(reduced[j] + tolerance, 0.0) / value
    for r in range(row.size):
        value = sign * row[r]
        if value > _ENTRY and allowed.slack[r] and basis.slack_place[r] < 0:
            least = min(least, max(tolerance - basis.duals[r], 0.0) / value)
    chosen = -1
    if least == np.inf:
        return chosen, 0.0
    largest = 0.0
    step = 0.0
    for a in range(active.size):
        value = steps[a]
        if value > largest and value > _ENTRY:
            j = active[a]
            if place[j] < 0 and reduced[j] <= least * value:
                largest = value
                chosen = j
                step = max(reduced[j], 0.0) / value
    for r in range(row.size):
        value = sign * row[r]
        if value > largest and value > _ENTRY and allowed.slack[r] and basis.slack_place[r] < 0:
            if -basis.duals[r] <= least * value:
                largest = value
                chosen = program.weights.size + r
                step = max(-basis.duals[r], 0.0) / value
    return chosen, step


@njit
def _step(program: Program, allowed: Allowed, basis: Basis, p: int, sign: float, step: float) -> None:
    """Move the multipliers along the row of place p, and the reduced costs with them."""
    for a in range(allowed.active.size):
        basis.reduced[allowed.active[a]] -= step * basis.steps[a]
    for r in range(basis.row.size):
        basis.duals[r] += sign * step * basis.row[r]
    code = basis.variable[p]
    if code < program.weights.size:
        basis.reduced[code] = -sign * step


@njit
def solve_dual(program: Program, allowed: Allowed, basis: Basis, effort: Effort) -> Any:
    """Make a basis optimal whose multipliers are feasible; how it ended, and the exchanges made.

    At the end ``duals`` give the bound, whatever the end (program.py: ``certified``). Without a solution they are moved
    until their bound is the cutoff.
    """
    num = program.weights.size
    scale = 0.0
    for j in allowed.active:
        scale = max(scale, abs(program.weights[j]))
    tolerance = _COST * max(scale, 1e-300)
    done = 0
    age = basis.age
    while True:
        if done % _LOOK == 0 and is_over(effort.deadline):
            return STOPPED, done
        if age[0] >= _FRESH or (age[0] > 0 and age[0] % _LOOK == 0 and not residual(program, basis) <= _RESIDUAL):
            _renew(program, allowed, basis, tolerance)
        bound = 0.0
        for r in range(program.sides.size):
            bound += program.sides[r] * basis.duals[r]
        if bound >= effort.cutoff:
            return CUT, done
        p = _leaving(program, allowed, basis)
        if p < 0:
            if age[0] > 0 and not residual(program, basis) <= _RESIDUAL:
                _renew(program, allowed, basis, tolerance)
                continue
            return OPTIMAL, done
        if done >= effort.exchanges:
            return STOPPED, done
        sign = 1.0 if basis.values[p] > 0.0 else -1.0
        for r in range(basis.row.size):
            basis.row[r] = basis.inverse[r, p]
        chosen, step = _entering(program, allowed, basis, sign, tolerance)
        if chosen < 0:
            if age[0] > 0:
                _renew(program, allowed, basis, tolerance)
                continue
            # the multipliers can rise for ever; as far as they are asked for is enough
            _step(program, allowed, basis, p, sign, max(effort.cutoff - bound, 0.0) / abs(basis.values[p]) * 1.001)
            return INFEASIBLE, done
        if chosen < num:
            coordinates(program, basis, chosen, basis.column)
        else:
            basis.column[:] = basis.inverse[chosen - num]
        if abs(basis.column[p]) < SMALL_PIVOT and age[0] > 0:
            _renew(program, allowed, basis, tolerance)
            continue
        _step(program, allowed, basis, p, sign, step)
        if chosen < num:
            basis.reduced[chosen] = 0.0
        exchange(basis, p, basis.column)
        enter(program, basis, p, chosen)
        done += 1


@njit
def _renew(program: Program, allowed: Allowed, basis: Basis, tolerance: float) -> None:
    """Compute everything anew; where the multipliers are then not feasible, begin from feasible ones."""
    refactor(program, allowed, basis)
    if price(program, allowed, basis) < -1e3 * tolerance:
        duals = basis.duals.copy()
        make_feasible(program, allowed, duals)
        begin_from_duals(program, allowed, duals, basis)


@njit
def restart(program: Program, allowed: Allowed, basis: Basis) -> None:
    """Make a basis fit for `solve_dual` after ``allowed`` has changed: its multipliers must be feasible."""
    scale = 0.0
    for j in allowed.active:
        scale = max(scale, abs(program.weights[j]))
    if price(program, allowed, basis) < -1e-9 * max(scale, 1e-300):
        duals = basis.duals.copy()
        make_feasible(program, allowed, duals)
        begin_from_duals(program, allowed, duals, basis)
