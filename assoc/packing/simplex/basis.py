"""A basis of the linear program with the inverse of its matrix, and the operations that change them.

The inverse is dense and stored by columns, so that all operations are sums of contiguous columns; it takes memory for
rows^2 numbers. A column of the program has a handful of ones, so that its coordinates in the basis are the sum of a
handful of these columns.

A row without a column in the basis has its slack there, or an *anchor*: a variable that is 0 in every solution, at any
cost. Anchors of cost u make any multipliers u those of a basis, the unit matrix: this is how a search starts from the
multipliers of the dual ascent. Anchors that have left the basis do not return.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import inner_njit, lean_inner_njit, njit
from assoc._system.kernels.copying import copy_to
from assoc._system.kernels.sorting import order_of
from assoc._types import Floats
from assoc.packing.simplex.pricing import Pricing, new_pricing
from assoc.packing.simplex.program import Allowed, Program

# smaller pivots are rejected
SMALL_PIVOT = 1e-7
# squared lengths of the inverse's rows above this are recomputed
_LONG = 1e10


class Basis(NamedTuple):
    """A basis and the values derived from it; changed in place. Each of its ``m`` positions has one variable."""

    variable: NDArray[np.int32]
    """Variable at each position: column j as j, the slack of row r as n + r, its anchor as n + m + r, (m,)."""
    free: NDArray[np.bool_]
    """Whether the variable at each position may be above 0 (dual.py: `note_free`), (m,)."""
    position: NDArray[np.int32]
    """Position of each column, (n,); -1 if not in the basis."""
    slack_position: NDArray[np.int32]
    """The same of each slack, (m,)."""
    inverse: NDArray[np.float64]
    """The inverse, transposed: row r has the coordinates of the r-th unit vector, by position, (m, m)."""
    norms: Floats
    """Squared length of each row of the inverse (a column of this array): weights of the steepest edge, (m,)."""
    values: Floats
    """Values of the variables in the basis, (m,)."""
    duals: Floats
    anchors: Floats
    """Costs of the anchors, (m,)."""
    row: Floats
    """Buffers, (m,), for a row and a column of the tableau, and for sums over all positions."""
    column: Floats
    sums: Floats
    pricing: Pricing
    """The allowed columns, and their reduced costs."""
    age: NDArray[np.int64]
    """Pivots since the last refactorisation, (1,)."""


def new_basis(program: Program) -> Basis:
    """Allocate a basis."""
    return basis_without(program, program.sides.size)


def basis_without(program: Program, columns: int) -> Basis:
    """Allocate a basis with only ``columns`` columns of the inverse."""
    num, size = program.weights.size, program.sides.size
    return Basis(
        np.zeros(size, np.int32), np.zeros(size, np.bool_), np.full(num, -1, np.int32), np.full(size, -1, np.int32),
        np.zeros((columns, size)),
        np.empty(size), np.empty(size), np.empty(size), np.zeros(size),
        np.empty(size), np.empty(size), np.empty(size), new_pricing(program), np.zeros(1, np.int64),
    )  # fmt: skip


def copy_basis(source: Basis, target: Basis) -> None:
    """Make ``target`` the same basis as ``source``."""
    for name in ("variable", "position", "slack_position", "inverse", "norms", "values", "duals", "anchors", "age"):
        getattr(target, name)[:] = getattr(source, name)


@lean_inner_njit
def copy_without_inverse(source: Basis, target: Basis) -> None:
    """Copy the variables of ``source``, their values, the edge weights and the multipliers to ``target``."""
    copy_to(target.variable, source.variable)
    copy_to(target.position, source.position)
    copy_to(target.slack_position, source.slack_position)
    copy_to(target.norms, source.norms)
    copy_to(target.values, source.values)
    copy_to(target.duals, source.duals)


@njit
def begin_from_duals(program: Program, allowed: Allowed, duals: Floats, basis: Basis) -> None:
    """Make ``basis`` the one of slacks and anchors with these multipliers."""
    num, size = program.weights.size, program.sides.size
    basis.position[:] = -1
    basis.slack_position[:] = -1
    basis.inverse[:] = 0.0
    for r in range(size):
        basis.inverse[r, r] = 1.0
        basis.anchors[r] = duals[r]
        if allowed.slack[r] and duals[r] == 0.0:
            basis.variable[r] = num + r
            basis.slack_position[r] = r
        else:
            basis.variable[r] = num + size + r
    basis.age[:] = 0
    basis.norms[:] = 1.0
    copy_to(basis.values, program.sides)
    copy_to(basis.duals, duals)


@lean_inner_njit
def coordinates(program: Program, basis: Basis, j: int, column: Floats) -> None:
    """Coordinates of column j in the basis."""
    inverse, rows = basis.inverse, program.rows
    column[:] = 0.0
    for k in range(program.start[j], program.start[j + 1]):
        r = rows[k]
        for i in range(column.size):
            column[i] += inverse[r, i]


@lean_inner_njit
def exchange(basis: Basis, p: int, column: Floats) -> None:
    """Pivot: the variable of these coordinates enters at position p. Updates the inverse, the norms, the values."""
    inverse, row, sums, norms, values = basis.inverse, basis.row, basis.sums, basis.norms, basis.values
    size = column.size
    pivot = column[p]
    sums[:] = 0.0
    for r in range(size):
        f = row[r]
        if f != 0.0:
            change = f / pivot
            for i in range(size):
                entry = inverse[r, i]
                sums[i] += f * entry
                inverse[r, i] = entry - change * column[i]
            inverse[r, p] = change
    leaving_norm = norms[p]
    step = values[p] / pivot
    for i in range(size):
        if column[i] != 0.0:
            ratio = column[i] / pivot
            # rounding must not make it less than the part that is added
            least = 1e-4 + 1e-3 * ratio * ratio * leaving_norm
            norm = norms[i] - 2.0 * ratio * sums[i] + ratio * ratio * leaving_norm
            norms[i] = norm if norm > least else least
            if not norms[i] < _LONG:
                # rounding spoils updates of norms this large; and a variable with a NaN norm would never leave
                norms[i] = 0.0
                for r in range(size):
                    norms[i] += inverse[r, i] * inverse[r, i]
            values[i] -= step * column[i]
    norms[p] = max(leaving_norm / (pivot * pivot), 1e-4)
    values[p] = step
    basis.age[0] += 1


@lean_inner_njit
def enter(program: Program, basis: Basis, p: int, variable: int) -> None:
    """Record that a variable has entered at position p."""
    num, size = program.weights.size, program.sides.size
    old = basis.variable[p]
    if old < num:
        basis.position[old] = -1
    elif old < num + size:
        basis.slack_position[old - num] = -1
    basis.variable[p] = variable
    basis.free[p] = True
    if variable < num:
        basis.position[variable] = p
    elif variable < num + size:
        basis.slack_position[variable - num] = p


@njit
def refactor(program: Program, allowed: Allowed, basis: Basis) -> None:
    """Refactor: recompute everything from ``variable``; positions of dependent variables get anchors.

    The multipliers are then those of the basis, except for the rows of new anchors, which keep theirs.
    """
    num, size = program.weights.size, program.sides.size
    inverse, row, column = basis.inverse, basis.row, basis.column
    members = basis.variable.copy()
    old = basis.duals.copy()
    basis.position[:] = -1
    basis.slack_position[:] = -1
    inverse[:] = 0.0
    taken = np.zeros(size, np.bool_)
    # rows without a unit vector in the basis get a column
    for r in range(size):
        inverse[r, r] = 1.0
        basis.variable[r] = num + size + r
    for code in members:
        if code >= num:
            r = (code - num) % size
            taken[r] = True
            basis.variable[r] = code
            if code < num + size:
                basis.slack_position[r] = r
    # columns of few open rows first: they leave the inverse sparse
    count = 0
    order = np.empty(size, np.int32)
    for code in members:
        if code < num:
            order[count] = code
            count += 1
    open_rows = np.empty(count)
    for i in range(count):
        open_rows[i] = 0.0
        for k in range(program.start[order[i]], program.start[order[i] + 1]):
            if not taken[program.rows[k]]:
                open_rows[i] += 1.0
    for i in order_of(open_rows):
        j = order[i]
        coordinates(program, basis, j, column)
        p = -1
        largest = SMALL_PIVOT
        for r in range(size):
            if not taken[r] and abs(column[r]) > largest:
                largest = abs(column[r])
                p = r
        if p < 0:
            continue
        taken[p] = True
        basis.variable[p] = j
        basis.position[j] = p
        for r in range(size):
            row[r] = inverse[r, p]
        for r in range(size):
            f = row[r]
            if f != 0.0:
                f /= column[p]
                for k in range(size):
                    inverse[r, k] -= f * column[k]
                inverse[r, p] = f
    for r in range(size):
        if not taken[r]:
            basis.anchors[r] = old[r]
    _recompute(program, basis)


@inner_njit
def _recompute(program: Program, basis: Basis) -> None:
    """What follows from the variables and the inverse: norms, values and multipliers."""
    num, size, inverse = program.weights.size, program.sides.size, basis.inverse
    costs = np.zeros(size)
    for i in range(size):
        code = basis.variable[i]
        if code < num:
            costs[i] = program.weights[code]
        elif code >= num + size:
            costs[i] = basis.anchors[code - num - size]
    basis.age[:] = 0
    basis.norms[:] = 0.0
    basis.values[:] = 0.0
    for r in range(size):
        total = 0.0
        for i in range(size):
            entry = inverse[r, i]
            basis.norms[i] += entry * entry
            basis.values[i] += program.sides[r] * entry
            total += costs[i] * entry
        basis.duals[r] = total


def basis_of(program: Program, allowed: Allowed, variable: NDArray[np.int32], duals: Floats) -> Basis:
    """The basis of these variables, with anchors of these costs."""
    basis = new_basis(program)
    basis.variable[:] = variable
    basis.duals[:] = duals
    basis.anchors[:] = duals
    refactor(program, allowed, basis)
    return basis


@lean_inner_njit
def residual(program: Program, basis: Basis) -> float:
    """Largest violation of a row by the values of the basis."""
    num, size = program.weights.size, program.sides.size
    left = basis.sums
    copy_to(left, program.sides)
    for i in range(size):
        code = basis.variable[i]
        value = basis.values[i]
        if code >= num:
            left[(code - num) % size] -= value
        elif value != 0.0:
            for k in range(program.start[code], program.start[code + 1]):
                left[program.rows[k]] -= value
    largest = 0.0
    for r in range(size):
        # a NaN must not pass for a small residual
        if not abs(left[r]) <= largest:
            largest = abs(left[r])
    return largest


def primal_values(program: Program, basis: Basis, primal: Floats) -> None:
    """Value of every column."""
    columns = basis.variable < program.weights.size
    primal[:] = 0.0
    primal[basis.variable[columns]] = np.maximum(basis.values[columns], 0.0)
