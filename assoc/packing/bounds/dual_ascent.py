"""The dual bound: multipliers of the measurements from which every solver's certificate comes.

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
from typing import Any

import numpy as np

from assoc._system.clock import is_over
from assoc._system.compiled import njit
from assoc._types import Floats
from assoc.packing.packing import Packing
from assoc.packing.run import Run

# temperatures are this share of each component's spread of weights: likelihood costs spread over about 16
START = 0.06
COOLING = 0.5
LEVELS = 11
PASSES = 1000
# over-relaxation: the kernel takes total ** 1.5 as total * sqrt(total)
RELAXATION = 1.5
# columns of a reduced cost of more temperatures than this weigh less than 1e-5
NEAR = 12.0
# columns visited between two looks at the clock: about a millisecond in a kernel, and some fifty between kernels
_LOOK = 200_000
_VISITS = 10_000_000


def dual_bound(packing: Packing, *, levels: int = LEVELS, passes: int = PASSES, run: Run | None = None) -> Floats:
    """Return feasible multipliers of nearly the LP bound.

    Parameters
    ----------
    packing : Packing
        The problem.
    levels : int
        Temperatures, each half the one before.
    passes : int
        Passes over the rows at one temperature at the most.
    run : Run, optional
        Its time limit is kept: the multipliers are feasible whenever they are returned.

    Returns
    -------
    float array, shape (R,)
        Multipliers u; ``certified_bound(packing, u)`` is the bound.
    """
    duals = np.zeros(packing.num_rows)
    temperature = START * spread(packing)
    reduced, primal, slack_primal = work_arrays(packing)
    hard_pass(packing, duals, reduced, 1)
    size = packing.row_cols.size
    deadline = math.inf if run is None else run.deadline()
    for _ in range(levels):
        left = passes
        while left > 0 and (run is None or run.remaining() > 0.0):
            # under a time limit large problems come back for a look at the clock
            turn = left if run is None or run.time_limit is None else min(left, max(6, _VISITS // max(size, 1)))
            visits = smooth_pass(packing, duals, reduced, primal, slack_primal, temperature, turn, deadline)
            left = left - turn if visits == turn * size else 0
        temperature *= COOLING
    hard_pass(packing, duals, reduced, 2)
    return duals


def work_arrays(packing: Packing) -> tuple[Floats, Floats, Floats]:
    """Return room for reduced costs, smoothed primal values of the columns, and those of the rows' slack."""
    return np.empty(packing.num_columns), np.empty(packing.num_columns), np.empty(packing.num_rows)


def spread(packing: Packing) -> Floats:
    """Return for each component the spread of its weights (with 0, where rows have slack); never 0."""
    return _spread(packing.weights, packing.slack, packing.col_start, packing.row_start)


def hard_pass(packing: Packing, duals: Floats, reduced: Floats, sweeps: int) -> None:
    """Fill ``reduced`` from ``duals``, then raise ``duals`` by passes with the hard minimum (eq. above, T -> 0)."""
    _reduced_costs(packing.cols, packing.weights, duals, reduced)
    _hard_sweeps(packing.slack, packing.row_ptr, packing.row_cols, duals, reduced, sweeps)


def smooth_pass(
    packing: Packing,
    duals: Floats,
    reduced: Floats,
    primal: Floats,
    slack_primal: Floats,
    temperature: Floats,
    passes: int,
    deadline: float = math.inf,
) -> int:
    """Move ``duals`` by smoothed passes at one temperature per component; return the column visits made."""
    return int(
        _smooth_passes(
            packing.cols,
            packing.weights,
            packing.slack,
            packing.row_start,
            packing.col_start,
            packing.row_ptr,
            packing.row_cols,
            duals,
            reduced,
            primal,
            slack_primal,
            temperature,
            passes,
            deadline,
        )
    )


def reduced_costs(packing: Packing, duals: Floats) -> Floats:
    """Return the weight of each column less the multipliers of its rows, shape (N,)."""
    reduced = np.empty(packing.num_columns)
    _reduced_costs(packing.cols, packing.weights, duals, reduced)
    return reduced


def component_bounds(packing: Packing, duals: Floats) -> Floats:
    """Return a valid lower bound for each component, shape (C,), from any multipliers.

    Positive multipliers of rows with slack are taken as 0. A negative reduced cost (rounding) is charged
    for as many columns as a solution can have, so that the bound holds whatever ``duals`` are.
    ``inf`` means that a row without slack has no column: there is no solution.
    """
    return _component_bounds(
        packing.cols,
        packing.weights,
        packing.slack,
        packing.col_start,
        packing.row_start,
        packing.row_ptr,
        duals,
    )


def certified_bound(packing: Packing, duals: Floats) -> float:
    """Return a valid lower bound on the packing's weight; see ``component_bounds``."""
    return math.fsum(component_bounds(packing, duals)) if packing.num_components else 0.0


@njit
def _spread(weights: Floats, slack: Any, col_start: Any, row_start: Any) -> Floats:
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
def _reduced_costs(cols: Any, weights: Floats, duals: Floats, reduced: Floats) -> None:
    num, num_sensors = cols.shape
    for j in range(num):
        value = weights[j]
        for s in range(num_sensors):
            r = cols[j, s]
            if r >= 0:
                value -= duals[r]
        reduced[j] = value


@njit
def _hard_sweeps(slack: Any, row_ptr: Any, row_cols: Any, duals: Floats, reduced: Floats, sweeps: int) -> None:
    for _ in range(sweeps):
        for r in range(slack.size):
            least = -duals[r] if slack[r] else np.inf
            for k in range(row_ptr[r], row_ptr[r + 1]):
                least = min(least, reduced[row_cols[k]])
            if least != 0.0 and least < np.inf:
                duals[r] += least
                for k in range(row_ptr[r], row_ptr[r + 1]):
                    reduced[row_cols[k]] -= least


@njit
def _gathered_sum(values: Floats, places: Any, first: int, end: int) -> float:
    """Sum of ``values[places[first:end]]`` in four strands, which do not wait for each other."""
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


@njit
def _smooth_passes(
    cols: Any,
    weights: Floats,
    slack: Any,
    row_start: Any,
    col_start: Any,
    row_ptr: Any,
    row_cols: Any,
    duals: Floats,
    reduced: Floats,
    primal: Floats,
    slack_primal: Floats,
    temperature: Floats,
    passes: int,
    deadline: float,
) -> int:
    scale = np.empty(slack.size)
    near_ptr = np.empty(slack.size + 1, np.int64)
    near_cols = np.empty(row_cols.size, np.int32)
    place = np.empty(weights.size, np.int32)
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
            # columns far above the minimum weigh nothing: they are left out and looked at again now and then
            _near(
                cols, weights, row_ptr, row_cols, duals, reduced, top, end, col_start[c], col_start[c + 1],
                NEAR * t, place, near_ptr, near_cols,
            )  # fmt: skip
            for j in range(col_start[c], col_start[c + 1]):
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
                    # total ** -1.5, where over-relaxed; the logarithm is left to the end of the passes
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


@njit
def _near(
    cols: Any, weights: Floats, row_ptr: Any, row_cols: Any, duals: Floats, reduced: Floats, top: int, end: int,
    first: int, last: int, limit: float, place: Any, near_ptr: Any, near_cols: Any,
) -> None:  # fmt: skip
    """Number the columns of a component whose reduced cost is at most ``limit``, and list them by row."""
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
            # written whether near or not: no branch to predict
            near_cols[position] = place[row_cols[k]]
            position += place[row_cols[k]] >= 0
    near_ptr[end] = position


@njit
def _component_bounds(
    cols: Any, weights: Floats, slack: Any, col_start: Any, row_start: Any, row_ptr: Any, duals: Floats
) -> Floats:
    num_sensors = cols.shape[1]
    bounds = np.zeros(col_start.size - 1)
    for c in range(bounds.size):
        total = 0.0
        size = 0.0
        for r in range(row_start[c], row_start[c + 1]):
            u = min(duals[r], 0.0) if slack[r] else duals[r]
            total += u
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
            least = min(least, value)
        # what summing can have lost, and the columns that a solution can have
        bounds[c] = total + least * (row_start[c + 1] - row_start[c]) - 1e-15 * size
    return bounds
