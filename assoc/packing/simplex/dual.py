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
from assoc._system.compiled import inner_njit, njit
from assoc.packing.kernels.copying import copy_to
from assoc.packing.kernels.extremes import place_of_largest, place_of_smallest
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


@inner_njit
def cost_tolerance(program: Program, allowed: Allowed) -> float:
    """Reduced costs this far below 0 are 0."""
    scale = 0.0
    for j in allowed.active:
        scale = max(scale, abs(program.weights[j]))
    return _COST * max(scale, 1e-300)


@inner_njit
def bound_of(program: Program, basis: Basis) -> float:
    """The bound of the multipliers, as they are."""
    sides, duals = program.sides, basis.duals
    bound = 0.0
    for r in range(sides.size):
        bound += sides[r] * duals[r]
    return bound


@inner_njit
def note_free(program: Program, allowed: Allowed, basis: Basis) -> None:
    """Note which places have a variable that may be above 0: columns and slacks that are allowed."""
    num, size = program.weights.size, program.sides.size
    variable, columns, slack = basis.variable, allowed.columns, allowed.slack
    for i in range(size):
        code = variable[i]
        basis.free[i] = columns[code] if code < num else code < num + size and slack[code - num]


@inner_njit
def leaving(basis: Basis) -> int:
    """The place whose variable is farthest outside its limits, measured along the edge; -1: none is."""
    values, norms, free, scores = basis.values, basis.norms, basis.free, basis.pricing.ratios
    for i in range(values.size):
        value = values[i]
        inside = value >= -_VALUE and (free[i] or value <= _VALUE)
        score = value * value / norms[i]
        # whatever rounding made of the norms, what is outside its limits must be found
        score = score if score > 0.0 else np.inf
        scores[i] = 0.0 if inside else score
    return int(place_of_largest(basis.pricing.bits, values.size))


@inner_njit
def _fill_entries(allowed: Allowed, basis: Basis, sign: float) -> int:
    """Fill ``entries`` with the row of the tableau and ``reduced`` with what slacks cost; how many there are."""
    row, duals, in_basis, slack, pricing = basis.row, basis.duals, basis.slack_place, allowed.slack, basis.pricing
    entries, reduced, count = pricing.entries, pricing.reduced, pricing.listed[0]
    sum_rows(row, sign, pricing, entries)
    for r in range(row.size):
        entries[count + r] = sign * row[r]
        reduced[count + r] = -duals[r] if slack[r] and in_basis[r] < 0 else np.inf
    return int(count + row.size)


@inner_njit
def _fill_ratios(pricing: Pricing, count: int, tolerance: float) -> None:
    """Fill ``ratios`` with how far the multipliers can move until each reduced cost is below 0 by the tolerance."""
    entries, reduced, ratios = pricing.entries, pricing.reduced, pricing.ratios
    for a in range(count):
        room = reduced[a] + tolerance
        ratio = (0.0 if room < 0.0 else room) / entries[a]
        # what is no number is no ratio
        ratios[a] = ratio if entries[a] > _ENTRY and ratio >= 0.0 else np.inf


@inner_njit
def _fill_pivots(pricing: Pricing, count: int, least: float) -> None:
    """Fill ``ratios`` with the entries of those whose reduced costs reach 0 by then, and 0 for all others."""
    entries, reduced, ratios = pricing.entries, pricing.reduced, pricing.ratios
    for a in range(count):
        # a product may be too large for a number
        passed = reduced[a] <= least * entries[a] and reduced[a] < np.inf and entries[a] > _ENTRY
        ratios[a] = entries[a] if passed else 0.0


@inner_njit
def entering(program: Program, allowed: Allowed, basis: Basis, sign: float, tolerance: float) -> Any:
    """The variable that first limits the step of the multipliers, and the step; -1: none does.

    Fills ``entries`` with the row of the tableau, of the listed columns and the slacks.
    """
    pricing = basis.pricing
    listed = pricing.listed[0]
    count = _fill_entries(allowed, basis, sign)
    _fill_ratios(pricing, count, tolerance)
    first = place_of_smallest(pricing.bits, count)
    chosen, step = -1, 0.0
    if first < count and pricing.ratios[first] < np.inf:
        _fill_pivots(pricing, count, pricing.ratios[first])
        place = place_of_largest(pricing.bits, count)
        if place >= 0:
            step = max(pricing.reduced[place], 0.0) / pricing.entries[place]
            chosen = pricing.column[place] if place < listed else program.weights.size + place - listed
    return chosen, step


@inner_njit
def step_along(program: Program, allowed: Allowed, basis: Basis, p: int, sign: float, step: float) -> None:
    """Move the multipliers along the row of place p, and the reduced costs with them."""
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
    """Make a basis optimal; how it ended, and the exchanges made.

    Its multipliers should be feasible for what is allowed now; where they are not, the search begins from others that
    are. At the end ``duals`` give the bound, whatever the end (program.py: ``certified``). Without a solution they are
    moved until their bound is the cutoff.
    """
    num = program.weights.size
    tolerance = cost_tolerance(program, allowed)
    list_columns(program, allowed, basis.pricing)
    _make_fit(program, allowed, basis, 1e3 * tolerance)
    done = 0
    age, row = basis.age, basis.row
    # whether everything is to be computed anew
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
            # the multipliers can rise for ever; as far as they are asked for is enough
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
    """Compute what depends on what is allowed; where the multipliers are not feasible, begin from others."""
    least = price(program, basis.duals, basis.place, basis.pricing)
    for r in range(basis.duals.size):
        if allowed.slack[r]:
            least = min(least, -basis.duals[r])
    if least < -tolerance:
        duals = basis.duals.copy()
        make_feasible(program, allowed, duals)
        begin_from_duals(program, allowed, duals, basis)
        price(program, basis.duals, basis.place, basis.pricing)
    note_free(program, allowed, basis)
