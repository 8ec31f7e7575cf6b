"""The dual bound: multipliers of the measurements, the basis of every solver's certificate.

For multipliers u (u <= 0 on rows with slack) the reduced cost of a column is its weight less the u of its
rows. When no reduced cost is negative, sum(u) bounds every solution from below: this is linear programming
duality, and the maximum over u is the LP bound. Here u is found by coordinate ascent, row by row. With the
hard minimum ascent stalls early; with the entropy-smoothed minimum at temperature T it does not,

    u_r <- u_r - T ln( sum_{j in r} exp(-rc_j / T) + exp(u_r / T) )          (second term: rows with slack)

and x_j = exp(-rc_j / T) approaches the LP's primal solution. A step multiplies the x of one row by one
factor, so that a pass costs no exponentials but one per row. T is cooled geometrically, steps are
over-relaxed, and one pass with the hard minimum makes the result feasible.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from assoc._system.clock import is_over
from assoc._system.compiled import inner_njit, lean_inner_njit, njit
from assoc._types import Floats, Ints
from assoc.packing.kernels.rounding import margin
from assoc.packing.packing import Packing, PackingArrays
from assoc.packing.run import Run

# temperatures are this share of each component's spread of weights: likelihood costs spread over about 16
START = 0.06
COOLING = 0.5
LEVELS = 11
PASSES = 1000
# over-relaxation: the kernel takes total ** 1.5 as total * sqrt(total)
RELAXATION = 1.5
# columns whose reduced cost is more than this many temperatures weigh less than 1e-5
NEAR = 12.0
# columns visited between two checks of the clock: about a millisecond within a kernel, some fifty between kernels
_LOOK = 200_000
_VISITS = 10_000_000


class SmoothPoint(NamedTuple):
    """The state of the smoothed ascent, changed in place: multipliers (R,), and of the columns reduced costs (N,)."""

    duals: Floats
    reduced: Floats
    primal: Floats
    """Smoothed primal values of the columns, (N,)."""
    slack_primal: Floats
    """Those of the rows' slack, (R,)."""


def dual_bound(packing: Packing, *, levels: int = LEVELS, passes: int = PASSES, run: Run | None = None) -> Floats:
    """Return feasible multipliers u, (R,), whose bound, ``certified_bound(packing, u)``, is nearly the LP bound.

    There are ``levels`` temperatures, each half the one before, with ``passes`` over the rows at the most. The time
    limit is that of ``run``; the multipliers are feasible even if time runs out.
    """
    arrays = packing.arrays
    duals = np.zeros(packing.num_rows)
    point = SmoothPoint(duals, *(np.empty(n) for n in (packing.num_columns, packing.num_columns, packing.num_rows)))
    temperature = START * spread(arrays)
    done = -1
    while done < levels:
        # an own check for systems where kernels cannot read the clock
        late = run is not None and done >= 0 and run.remaining() <= 0.0
        deadline = -math.inf if late else math.inf if run is None else run.deadline()
        done = _ascend(arrays, point, temperature, done, (levels, passes), deadline)
    return duals


@njit
def _ascend(
    packing: PackingArrays,
    point: SmoothPoint,
    temperature: Floats,
    done: int,
    course: tuple[int, int],
    deadline: float,
) -> int:
    """Cool through levels until all are done or the visits are used up; return the number done (-1: not begun)."""
    levels, passes = course
    begun = done >= 0
    if not begun:
        hard_sweeps(packing, point.duals, point.reduced, 1)
        done = 0
    total = 0
    while done < levels and total < _VISITS:
        if not is_over(deadline):
            # all passes of a level in one call: each call begins with plain passes
            total += smooth_passes(packing, point, temperature, passes, deadline)
        temperature *= COOLING
        done += 1
    # if time was over at the beginning, the first pass is enough: another would find the same
    if done == levels and (begun or total > 0):
        hard_sweeps(packing, point.duals, point.reduced, 2)
    return done


def hard_pass(packing: Packing, duals: Floats) -> None:
    """Raise ``duals`` by one pass with the hard minimum (eq. above, T -> 0)."""
    hard_sweeps(packing.arrays, duals, np.empty(packing.num_columns), 1)


def reduced_costs(packing: Packing, duals: Floats) -> Floats:
    """Return the weight of each column less the multipliers of its rows, shape (N,)."""
    reduced = np.empty(packing.num_columns)
    fill_reduced(packing.arrays, duals, reduced)
    return reduced


def component_bounds(packing: Packing, duals: Floats) -> Floats:
    """Return a valid lower bound for each component, shape (C,), from any multipliers.

    Positive multipliers of rows with slack count as 0. A negative reduced cost (rounding) is charged
    for as many columns as a solution can have, so that the bound is valid for any ``duals``.
    ``inf`` means that a row without slack has no column: there is no solution.
    """
    return bounds_by_component(packing.arrays, duals, np.empty(packing.num_columns))


def certified_bound(packing: Packing, duals: Floats) -> float:
    """Return a valid lower bound on the packing's weight; see ``component_bounds``."""
    return math.fsum(component_bounds(packing, duals)) if packing.num_components else 0.0


@njit
def spread(packing: PackingArrays) -> Floats:
    """Spread of the weights of each component (including 0 if rows have slack), shape (C,); never 0."""
    weights, slack, col_start, row_start = packing.weights, packing.slack, packing.col_start, packing.row_start
    result = np.ones(col_start.size - 1)
    for c in range(result.size):
        low, high = np.inf, -np.inf
        for j in range(col_start[c], col_start[c + 1]):
            low = min(low, weights[j])
            high = max(high, weights[j])
        for r in range(row_start[c], row_start[c + 1]):
            if slack[r]:
                low = min(low, 0.0)
                high = max(high, 0.0)
                break
        if high > low:
            result[c] = high - low
    return result


@njit
def fill_reduced(packing: PackingArrays, duals: Floats, reduced: Floats) -> None:
    """Fill ``reduced`` with the weight of each column less the multipliers of its rows."""
    cols, weights = packing.cols, packing.weights
    num, num_sensors = cols.shape
    for j in range(num):
        value = weights[j]
        for s in range(num_sensors):
            r = cols[j, s]
            if r >= 0:
                value -= duals[r]
        reduced[j] = value


@njit
def hard_sweeps(packing: PackingArrays, duals: Floats, updated: Floats, sweeps: int) -> None:
    """Passes with the hard minimum: each row takes the least reduced cost of its columns.

    ``updated`` receives the updated reduced costs. Rounding makes them inexact where weights are large, so that
    decisions need the exact ones: see `bounds_by_component`.
    """
    fill_reduced(packing, duals, updated)
    slack, row_ptr, row_cols = packing.slack, packing.row_ptr, packing.row_cols
    for _ in range(sweeps):
        for r in range(slack.size):
            least = -duals[r] if slack[r] else np.inf
            for k in range(row_ptr[r], row_ptr[r + 1]):
                least = min(least, updated[row_cols[k]])
            if least != 0.0 and least < np.inf:
                duals[r] += least
                for k in range(row_ptr[r], row_ptr[r + 1]):
                    updated[row_cols[k]] -= least


@lean_inner_njit
def _gathered_sum(values: Floats, places: Ints, first: int, end: int) -> float:
    """Sum of ``values[places[first:end]]`` in four independent partial sums, which processors overlap."""
    a = b = c = d = 0.0
    k = first
    while k + 4 <= end:
        a += values[places[k]]
        b += values[places[k + 1]]
        c += values[places[k + 2]]
        d += values[places[k + 3]]
        k += 4
    while k < end:
        a += values[places[k]]
        k += 1
    return (a + b) + (c + d)


@inner_njit
def smooth_passes(packing: PackingArrays, point: SmoothPoint, temperature: Floats, passes: int, deadline: float) -> int:
    """Move ``point`` by smoothed passes at one temperature per component; return the column visits."""
    slack, row_start, row_ptr = packing.slack, packing.row_start, packing.row_ptr
    duals, reduced, primal, slack_primal = point
    scale = np.empty(slack.size)
    # the columns of small reduced cost: numbered (-1: not near), and listed by row
    place = np.empty(reduced.size, np.int32)
    near_ptr, near_cols = np.empty(slack.size + 1, np.int64), np.empty(packing.row_cols.size, np.int32)
    visits = 0
    unseen = 0
    over = False
    for c in range(row_start.size - 1):
        if over:
            break
        t = temperature[c]
        top, end = row_start[c], row_start[c + 1]
        done = 0
        worst = 1.0
        while done < passes and worst >= 0.01 and not over:
            # columns far above the minimum weigh nothing: they are left out and checked again now and then
            _list_near(packing, duals, reduced, c, NEAR * t, (place, near_ptr, near_cols))
            for j in range(packing.col_start[c], packing.col_start[c + 1]):
                if place[j] >= 0:
                    primal[place[j]] = math.exp(min(-reduced[j] / t, 500.0))
            for r in range(top, end):
                slack_primal[r] = math.exp(min(duals[r] / t, 500.0)) if slack[r] else 0.0
            scale[top:end] = 1.0
            stop = min(passes, max(10, 2 * done))
            while done < stop and worst >= 0.01 and not over:
                # the first passes at a new temperature are plain: over-relaxing far from the fixed point can diverge
                plain = done < 5
                worst = 0.0
                for r in range(top, end):
                    first, last = near_ptr[r], near_ptr[r + 1]
                    total = slack_primal[r] + _gathered_sum(primal, near_cols, first, last)
                    if not 1e-200 < total < 1e200:
                        continue
                    worst = max(worst, abs(total - 1.0))
                    # total ** -1.5, where over-relaxed; logarithms are taken after the passes
                    factor = 1.0 / total if plain else 1.0 / (total * math.sqrt(total))
                    if 1e-3 < total < 1e3 and 1e-200 < scale[r] < 1e200:
                        scale[r] *= factor
                    else:
                        duals[r] -= t * math.log(total) * (1.0 if plain else RELAXATION)
                    slack_primal[r] *= factor
                    for k in range(first, last):
                        primal[near_cols[k]] *= factor
                visits += near_ptr[end] - near_ptr[top]
                unseen += near_ptr[end] - near_ptr[top]
                done += 1
                if unseen > _LOOK:
                    unseen = 0
                    over = is_over(deadline)
            visits += row_ptr[end] - row_ptr[top]
            unseen += row_ptr[end] - row_ptr[top]
            for r in range(top, end):
                if scale[r] != 1.0:
                    duals[r] += t * math.log(scale[r])
    return visits


@lean_inner_njit
def _list_near(
    packing: PackingArrays, duals: Floats, reduced: Floats, c: int, limit: float, near: tuple[Ints, Ints, Ints]
) -> None:
    """Number the columns of component c whose reduced cost is at most ``limit``, and list them by row."""
    cols, weights, row_ptr, row_cols = packing.cols, packing.weights, packing.row_ptr, packing.row_cols
    place, near_ptr, near_cols = near
    top, end = packing.row_start[c], packing.row_start[c + 1]
    first, last = packing.col_start[c], packing.col_start[c + 1]
    count = 0
    for j in range(first, last):
        value = weights[j]
        for s in range(cols.shape[1]):
            r = cols[j, s]
            if r >= 0:
                value -= duals[r]
        reduced[j] = value
        place[j] = -1
        if value <= limit:
            place[j] = first + count
            count += 1
    position = row_ptr[top]
    for r in range(top, end):
        near_ptr[r] = position
        for k in range(row_ptr[r], row_ptr[r + 1]):
            # written whether near or not: no branch to mispredict
            near_cols[position] = place[row_cols[k]]
            position += place[row_cols[k]] >= 0
    near_ptr[end] = position


@njit
def bounds_by_component(packing: PackingArrays, duals: Floats, reduced: Floats) -> Floats:
    """The kernel of ``component_bounds``; fills in the reduced costs of the bounds.

    A solution with column j weighs at least its component's bound plus ``reduced[j]``: the test for dropping columns.
    """
    cols, weights, slack, row_ptr = packing.cols, packing.weights, packing.slack, packing.row_ptr
    row_start, col_start = packing.row_start, packing.col_start
    num_sensors = cols.shape[1]
    bounds = np.zeros(col_start.size - 1)
    for c in range(bounds.size):
        total = 0.0
        lost = 0.0
        size = 0.0
        for r in range(row_start[c], row_start[c + 1]):
            u = min(duals[r], 0.0) if slack[r] else duals[r]
            # compensated summation: the error of a plain sum of many terms exceeds the margin
            new = total + u
            part = new - total
            lost += (total - (new - part)) + (u - part)
            total = new
            size += abs(u)
            if not slack[r] and row_ptr[r] == row_ptr[r + 1]:
                total = np.inf
                break
        least = 0.0
        for j in range(col_start[c], col_start[c + 1]):
            value = weights[j]
            for s in range(num_sensors):
                r = cols[j, s]
                if r >= 0:
                    value -= min(duals[r], 0.0) if slack[r] else duals[r]
            reduced[j] = value
            least = min(least, value)
        # the most negative reduced cost, for as many columns as a solution can have, and a margin for rounding
        bounds[c] = total + lost + least * (row_start[c + 1] - row_start[c]) - margin(size, num_sensors)
    return bounds
