"""A packing's linear program in the form of the simplex kernels, and bounds that are valid whatever the kernels did.

    min  sum_j w_j x_j     so that     sum_{j in r} a_rj x_j + s_r = b_r  for every row r,     x >= 0, s >= 0

A column is the list of its rows; a row that is listed twice has the coefficient 2. Rows of measurements have b = 1;
rows of cuts may have more. The slack s_r is 0 for rows that must be covered.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import lean_inner_njit, njit
from assoc._types import Floats
from assoc.packing.kernels.rounding import margin
from assoc.packing.packing import PackingArrays


class Program(NamedTuple):
    """A linear program; n columns, m rows."""

    weights: Floats
    """Cost of each column, (n,)."""
    start: NDArray[np.int64]
    """Column j has the rows ``rows[start[j]:start[j + 1]]``."""
    rows: NDArray[np.int32]
    sides: Floats
    """Right-hand sides b, whole numbers, (m,)."""
    width: int
    """Most rows of measurements that a column has; they come first, then those of cuts."""


class Allowed(NamedTuple):
    """The columns and slacks that a solution may use."""

    active: NDArray[np.int32]
    """Columns that may be used, ascending."""
    columns: NDArray[np.bool_]
    """Mask of the same columns, (n,)."""
    slack: NDArray[np.bool_]
    """Rows that may stay uncovered, (m,)."""


def program_of(packing: PackingArrays) -> Program:
    """The linear program of a packing."""
    used = packing.cols >= 0
    num, num_sensors = used.shape
    start = np.zeros(num + 1, np.int64)
    np.cumsum(np.count_nonzero(used, axis=1), out=start[1:])
    return Program(packing.weights, start, packing.cols[used], np.ones(packing.slack.size), num_sensors)


@lean_inner_njit
def reduced_cost(program: Program, duals: Floats, j: int) -> float:
    """Weight of column j less the multipliers of its rows."""
    start, rows = program.start, program.rows
    value = program.weights[j]
    for k in range(start[j], start[j + 1]):
        value -= duals[rows[k]]
    return value


@njit
def all_reduced_costs(program: Program, duals: Floats) -> Floats:
    """Reduced costs of all columns, allowed or not."""
    reduced = np.empty(program.weights.size)
    for j in range(reduced.size):
        reduced[j] = reduced_cost(program, duals, j)
    return reduced


@njit
def least_reduced(program: Program, allowed: Allowed, duals: Floats) -> float:
    """The least reduced cost of the allowed columns and slack; 0 if none is negative."""
    least = 0.0
    for j in allowed.active:
        least = min(least, reduced_cost(program, duals, j))
    for r in range(duals.size):
        if allowed.slack[r]:
            least = min(least, -duals[r])
    return least


@njit
def make_feasible(program: Program, allowed: Allowed, duals: Floats) -> None:
    """Lower multipliers until no allowed column has a negative reduced cost."""
    slack, start, rows = allowed.slack, program.start, program.rows
    for r in range(duals.size):
        if slack[r] and duals[r] > 0.0:
            duals[r] = 0.0
    for j in allowed.active:
        lack = reduced_cost(program, duals, j)
        if lack < 0.0:
            duals[rows[start[j]]] += lack


@njit
def certified(program: Program, allowed: Allowed, duals: Floats) -> float:
    """A lower bound on all whole-numbered solutions that is valid for any multipliers.

    The most negative reduced cost is charged for as many columns as a solution can have, and a margin for rounding is
    subtracted.
    """
    sides, slack, weights, start, rows = program.sides, allowed.slack, program.weights, program.start, program.rows
    total = 0.0
    lost = 0.0
    size = 0.0
    most = 0.0
    for r in range(duals.size):
        u = min(duals[r], 0.0) if slack[r] else duals[r]
        # compensated summation: the error of a plain sum of many terms exceeds the margin
        term = sides[r] * u
        new = total + term
        part = new - total
        lost += (total - (new - part)) + (term - part)
        total = new
        size += sides[r] * abs(u)
        most += sides[r]
    least = 0.0
    # not a literal 0: numba would compile the functions that take it a second time, for the literal
    longest = np.int64(0)
    for j in allowed.active:
        longest = max(longest, start[j + 1] - start[j])
        value = weights[j]
        for k in range(start[j], start[j + 1]):
            r = rows[k]
            value -= min(duals[r], 0.0) if slack[r] else duals[r]
        least = min(least, value)
    return total + lost + least * most - margin(size, longest)


def weight_limit(program: Program) -> float:
    """An upper bound on any solution's weight: a lower bound above it shows that there is no solution."""
    most = float(np.abs(program.weights).max(initial=0.0))
    return 1.0 + 2.0 * most * program.sides.size


def all_allowed(program: Program, slack: NDArray[np.bool_]) -> Allowed:
    """Allow every column, and the slack of the rows that have one."""
    num = program.weights.size
    return Allowed(np.arange(num, dtype=np.int32), np.ones(num, np.bool_), slack.copy())
