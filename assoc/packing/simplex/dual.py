"""The dual simplex method: from feasible multipliers to optimal ones, with a rising bound.

The leaving variable is chosen by steepest edge. Its weights, the lengths of the inverse's rows, are cheap here, as they
result from the pass that updates the inverse. The entering variable is chosen by Harris' ratio test: of the variables
whose ratio is least to within a tolerance, the one with the largest pivot.

References
----------
J. J. Forrest and D. Goldfarb, "Steepest-edge simplex algorithms for linear programming", Mathematical Programming 57
(1992), 341-374.
P. M. J. Harris, "Pivot selection methods of the Devex LP code", Mathematical Programming 5 (1973), 1-28.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._system.clock import is_over
from assoc._system.compiled import inner_njit, lean_inner_njit, njit
from assoc._system.kernels.copying import copy_to
from assoc.packing.simplex.basis import (
    SMALL_PIVOT,
    Basis,
    begin_from_duals,
    coordinates,
    enter,
    exchange,
    refactor,
    residual,
)
from assoc.packing.simplex.pricing import Pricing, list_columns, price, sum_rows
from assoc.packing.simplex.program import Allowed, Program, make_feasible

# status of a program: optimal, cutoff reached, infeasible, or stopped before
OPTIMAL, CUT, INFEASIBLE, STOPPED = 0, 1, 2, 3

# values this far beyond their limits count as within them; smaller entries in a row of the tableau count as 0
_VALUE = 1e-9
_ENTRY = 1e-9
# reduced costs this far below 0, as a share of the largest weight, count as 0
_COST = 1e-12
# pivots between two checks of the residual and of the clock, and between two refactorisations: a basis may be used
# for thousands of short calls
_LOOK = 20
_FRESH = 400
_RESIDUAL = 1e-9
# most pivots for each row, many times the usual number: among costs of many magnitudes rounding can cause cycling
_A_ROW = 200


class Effort(NamedTuple):
    """When to stop: at a bound of ``cutoff``, after ``exchanges`` pivots, or at a deadline (clock.py)."""

    cutoff: float
    exchanges: int
    deadline: float


@njit
def most_exchanges(program: Program) -> int:
    """Pivots after which the search for the optimum is given up."""
    return _A_ROW * program.sides.size


@lean_inner_njit
def cost_tolerance(program: Program, allowed: Allowed) -> float:
    """Reduced costs this far below 0 count as 0."""
    scale = 0.0
    for j in allowed.active:
        scale = max(scale, abs(program.weights[j]))
    return _COST * max(scale, 1e-300)


@lean_inner_njit
def bound_of(program: Program, basis: Basis) -> float:
    """The bound of the multipliers, without a check of their feasibility."""
    sides, duals = program.sides, basis.duals
    bound = 0.0
    for r in range(sides.size):
        bound += sides[r] * duals[r]
    return bound


@lean_inner_njit
def note_free(program: Program, allowed: Allowed, basis: Basis) -> None:
    """Mark the positions whose variable may be above 0: allowed columns and slacks."""
    num, size = program.weights.size, program.sides.size
    variable, columns, slack = basis.variable, allowed.columns, allowed.slack
    for i in range(size):
        code = variable[i]
        basis.free[i] = columns[code] if code < num else code < num + size and slack[code - num]


@lean_inner_njit
def leaving(basis: Basis) -> int:
    """The position whose variable is farthest outside its limits, measured along the edge; -1 if none is."""
    values, norms, free, scores = basis.values, basis.norms, basis.free, basis.pricing.ratios
    for i in range(values.size):
        value = values[i]
        inside = value >= -_VALUE and (free[i] or value <= _VALUE)
        score = value * value / norms[i]
        # variables outside their limits must be found even if rounding has spoilt the norms
        score = score if score > 0.0 else np.inf
        scores[i] = 0.0 if inside else score
    return int(position_of_largest(basis.pricing.bits, values.size))


@lean_inner_njit
def _fill_entries(allowed: Allowed, basis: Basis, sign: float) -> int:
    """Fill ``entries`` with the tableau row and ``reduced`` with the slacks' reduced costs; return their number."""
    row, duals, in_basis, slack, pricing = basis.row, basis.duals, basis.slack_position, allowed.slack, basis.pricing
    entries, reduced, count = pricing.entries, pricing.reduced, pricing.listed[0]
    sum_rows(row, sign, pricing, entries)
    for r in range(row.size):
        entries[count + r] = sign * row[r]
        reduced[count + r] = -duals[r] if slack[r] and in_basis[r] < 0 else np.inf
    return int(count + row.size)


@lean_inner_njit
def _fill_ratios(pricing: Pricing, count: int, tolerance: float) -> None:
    """Fill ``ratios`` with the steps of the multipliers at which each reduced cost is below 0 by the tolerance."""
    entries, reduced, ratios = pricing.entries, pricing.reduced, pricing.ratios
    for a in range(count):
        room = reduced[a] + tolerance
        ratio = (0.0 if room < 0.0 else room) / entries[a]
        # NaN is not a ratio
        ratios[a] = ratio if entries[a] > _ENTRY and ratio >= 0.0 else np.inf


@lean_inner_njit
def _fill_pivots(pricing: Pricing, count: int, least: float) -> None:
    """Fill ``ratios`` with the entries of the variables whose reduced costs reach 0 by then, and 0 for all others."""
    entries, reduced, ratios = pricing.entries, pricing.reduced, pricing.ratios
    for a in range(count):
        # the product may overflow
        passed = reduced[a] <= least * entries[a] and reduced[a] < np.inf and entries[a] > _ENTRY
        ratios[a] = entries[a] if passed else 0.0


@lean_inner_njit
def entering(program: Program, allowed: Allowed, basis: Basis, sign: float, tolerance: float) -> tuple[int, float]:
    """The variable that first limits the step of the multipliers, and the step; -1 if none does.

    Fills ``entries`` with the row of the tableau, of the listed columns and the slacks.
    """
    pricing = basis.pricing
    listed = pricing.listed[0]
    count = _fill_entries(allowed, basis, sign)
    _fill_ratios(pricing, count, tolerance)
    first = position_of_smallest(pricing.bits, count)
    chosen, step = -1, 0.0
    if first < count and pricing.ratios[first] < np.inf:
        _fill_pivots(pricing, count, pricing.ratios[first])
        position = position_of_largest(pricing.bits, count)
        if position >= 0:
            step = max(pricing.reduced[position], 0.0) / pricing.entries[position]
            chosen = pricing.column[position] if position < listed else program.weights.size + position - listed
    return chosen, step


@lean_inner_njit
def step_along(program: Program, allowed: Allowed, basis: Basis, p: int, sign: float, step: float) -> None:
    """Move the multipliers along the row of position p, and update the reduced costs."""
    pricing, row, duals = basis.pricing, basis.row, basis.duals
    reduced, entries = pricing.reduced, pricing.entries
    for a in range(pricing.listed[0]):
        reduced[a] -= step * entries[a]
    for r in range(row.size):
        duals[r] += sign * step * row[r]
    code = basis.variable[p]
    if code < program.weights.size and allowed.columns[code]:
        reduced[pricing.position[code]] = -sign * step


@njit
def solve_dual(program: Program, allowed: Allowed, basis: Basis, effort: Effort) -> Any:
    """Make a basis optimal; return the status and the number of pivots.

    If its multipliers are not feasible for the allowed columns and slack, the search starts from others that are. At
    the end ``duals`` give the bound, whatever the status (program.py: ``certified``). If the program is infeasible they
    are moved until their bound reaches the cutoff.
    """
    num = program.weights.size
    tolerance = cost_tolerance(program, allowed)
    list_columns(program, allowed, basis.pricing)
    _make_fit(program, allowed, basis, 1e3 * tolerance)
    done = 0
    age, row = basis.age, basis.row
    # whether to refactor
    stale = False
    while True:
        if done % _LOOK == 0 and is_over(effort.deadline):
            return STOPPED, done
        stale = stale or age[0] >= _FRESH
        if stale or (age[0] > 0 and age[0] % _LOOK == 0 and not residual(program, basis) <= _RESIDUAL):
            refactor(program, allowed, basis)
            _make_fit(program, allowed, basis, 1e3 * tolerance)
            stale = False
        bound = bound_of(program, basis)
        if bound >= effort.cutoff:
            return CUT, done
        p = leaving(basis)
        if p < 0:
            if age[0] > 0 and not residual(program, basis) <= _RESIDUAL:
                stale = True
                continue
            return OPTIMAL, done
        if done >= effort.exchanges:
            return STOPPED, done
        sign = 1.0 if basis.values[p] > 0.0 else -1.0
        for r in range(row.size):
            row[r] = basis.inverse[r, p]
        chosen, step = entering(program, allowed, basis, sign, tolerance)
        if chosen < 0:
            if age[0] > 0:
                stale = True
                continue
            # the bound is unlimited; raise it to the cutoff
            step_along(program, allowed, basis, p, sign, max(effort.cutoff - bound, 0.0) / abs(basis.values[p]) * 1.001)
            return INFEASIBLE, done
        if chosen < num:
            coordinates(program, basis, chosen, basis.column)
        else:
            copy_to(basis.column, basis.inverse[chosen - num])
        if abs(basis.column[p]) < SMALL_PIVOT and age[0] > 0:
            stale = True
            continue
        step_along(program, allowed, basis, p, sign, step)
        if chosen < num:
            basis.pricing.reduced[basis.pricing.position[chosen]] = np.inf
        exchange(basis, p, basis.column)
        enter(program, basis, p, chosen)
        done += 1


@inner_njit
def _make_fit(program: Program, allowed: Allowed, basis: Basis, tolerance: float) -> None:
    """List the allowed columns and price them; if the multipliers are not feasible, start from others."""
    least = price(program, basis.duals, basis.position, basis.pricing)
    for r in range(basis.duals.size):
        if allowed.slack[r]:
            least = min(least, -basis.duals[r])
    if least < -tolerance:
        duals = basis.duals.copy()
        make_feasible(program, allowed, duals)
        begin_from_duals(program, allowed, duals, basis)
        price(program, basis.duals, basis.position, basis.pricing)
    note_free(program, allowed, basis)


# Non-negative floats have the same order as their bits read as integers. Compilers vectorise the minimum of integers
# without branches; for floats they may not, because of NaN.
@inner_njit
def position_of_smallest(bits: NDArray[np.int64], count: int) -> int:
    """Index of the smallest of the first ``count`` numbers, given as their bits; ``count`` if that is 0."""
    least = np.int64(2**63 - 1)
    for a in range(count):
        least = min(least, bits[a])
    index = count
    for a in range(count):
        index = min(index, a if bits[a] == least else count)
    return index


@inner_njit
def position_of_largest(bits: NDArray[np.int64], count: int) -> int:
    """Index of the largest of the first ``count`` numbers, given as their bits; -1 if all are 0."""
    most = np.int64(0)
    for a in range(count):
        most = max(most, bits[a])
    index = count
    for a in range(count):
        index = min(index, a if bits[a] == most else count)
    return index if most > 0 else -1
