"""A basis of the linear program with the inverse of its matrix, and what changes both.

The inverse is dense and kept by columns, so that all that is done with it are sums of contiguous columns: memory for
rows^2 numbers, and no more. A column of the program has a handful of ones, so that its coordinates in the basis are the
sum of a handful of these columns.

What a row has in the basis where no column of the program stands for it is its slack, or an *anchor*: a variable that
is 0 in every solution, whose cost can be what we like. With anchors of cost u, any multipliers u are those of a basis
(the unit matrix): so a search starts from the multipliers of the dual ascent, and anchors that left do not return.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import inner_njit, njit
from assoc._types import Floats
from assoc.packing.kernels.copying import copy_to
from assoc.packing.kernels.sorting import order_of
from assoc.packing.simplex.pricing import Pricing, new_pricing
from assoc.packing.simplex.program import Allowed, Program

# a pivot smaller than this is none
SMALL_PIVOT = 1e-7
# squared lengths of the inverse's rows that are computed anew
_LONG = 1e10


class Basis(NamedTuple):
    """A basis and what follows from it; changed in place. Of its ``m`` places each has one variable.

    Attributes
    ----------
    variable : int32 array, shape (m,)
        What is in each place: column j as j, the slack of row r as n + r, the anchor of row r as n + m + r.
    free : bool array, shape (m,)
        Whether what is in each place may be above 0 (dual.py: `note_free`).
    place, slack_place : int32 arrays, shapes (n,) and (m,)
        Where each column and each slack is, -1: not in the basis.
    inverse : float array, shape (m, m)
        Row r: the coordinates of the r-th unit vector, place by place (the inverse transposed).
    norms : float array, shape (m,)
        Squared length of each row of the inverse (of each column here): weights of the steepest edge.
    values : float array, shape (m,)
        Values of the variables in the basis.
    duals : float array, shape (m,)
        Multipliers.
    anchors : float array, shape (m,)
        Costs of the anchors.
    row, column, sums : float arrays, shape (m,)
        Room for a row and a column of the tableau, and for sums over all places.
    pricing : Pricing
        The columns that are allowed, and their reduced costs.
    age : int64 array, shape (1,)
        Exchanges since everything was computed anew.
    """

    variable: NDArray[np.int32]
    free: NDArray[np.bool_]
    place: NDArray[np.int32]
    slack_place: NDArray[np.int32]
    inverse: NDArray[np.float64]
    norms: Floats
    values: Floats
    duals: Floats
    anchors: Floats
    row: Floats
    column: Floats
    sums: Floats
    pricing: Pricing
    age: NDArray[np.int64]


def new_basis(program: Program) -> Basis:
    """Room for a basis."""
    return basis_without(program, program.sides.size)


def basis_without(program: Program, columns: int) -> Basis:
    """Room for a basis of whose inverse there are so many columns alone."""
    num, size = program.weights.size, program.sides.size
    return Basis(
        np.zeros(size, np.int32), np.zeros(size, np.bool_), np.full(num, -1, np.int32), np.full(size, -1, np.int32),
        np.zeros((columns, size)),
        np.empty(size), np.empty(size), np.empty(size), np.zeros(size),
        np.empty(size), np.empty(size), np.empty(size), new_pricing(program), np.zeros(1, np.int64),
    )  # fmt: skip


def copy_basis(source: Basis, target: Basis) -> None:
    """Make ``target`` the same basis as ``source``."""
    for name in ("variable", "place", "slack_place", "inverse", "norms", "values", "duals", "anchors", "age"):
        getattr(target, name)[:] = getattr(source, name)


@inner_njit
def copy_without_inverse(source: Basis, target: Basis) -> None:
    """Give ``target`` the variables of ``source``, their values, the weights of the edges, and the multipliers."""
    copy_to(target.variable, source.variable)
    copy_to(target.place, source.place)
    copy_to(target.slack_place, source.slack_place)
    copy_to(target.norms, source.norms)
    copy_to(target.values, source.values)
    copy_to(target.duals, source.duals)


@njit
def begin_from_duals(program: Program, allowed: Allowed, duals: Floats, basis: Basis) -> None:
    """The basis of slacks and anchors whose multipliers these are."""
    num, size = program.weights.size, program.sides.size
    basis.place[:] = -1
    basis.slack_place[:] = -1
    basis.inverse[:] = 0.0
    for r in range(size):
        basis.inverse[r, r] = 1.0
        basis.anchors[r] = duals[r]
        if allowed.slack[r] and duals[r] == 0.0:
            basis.variable[r] = num + r
            basis.slack_place[r] = r
        else:
            basis.variable[r] = num + size + r
    basis.age[:] = 0
    basis.norms[:] = 1.0
    copy_to(basis.values, program.sides)
    copy_to(basis.duals, duals)


@inner_njit
def coordinates(program: Program, basis: Basis, j: int, column: Floats) -> None:
    """Coordinates of column j in the basis."""
    inverse, rows = basis.inverse, program.rows
    column[:] = 0.0
    for k in range(program.start[j], program.start[j + 1]):
        r = rows[k]
        for i in range(column.size):
            column[i] += inverse[r, i]


@inner_njit
def exchange(basis: Basis, p: int, column: Floats) -> None:
    """Let the variable of these coordinates take place p: the inverse, the norms, the values."""
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
    own = norms[p]
    step = values[p] / pivot
    for i in range(size):
        if column[i] != 0.0:
            ratio = column[i] / pivot
            # rounding may not make it less than the part that is added
            least = 1e-4 + 1e-3 * ratio * ratio * own
            norm = norms[i] - 2.0 * ratio * sums[i] + ratio * ratio * own
            norms[i] = norm if norm > least else least
            if not norms[i] < _LONG:
                # what rounding leaves of such numbers is no length; and one that is no number would never leave
                norms[i] = 0.0
                for r in range(size):
                    norms[i] += inverse[r, i] * inverse[r, i]
            values[i] -= step * column[i]
    norms[p] = max(own / (pivot * pivot), 1e-4)
    values[p] = step
    basis.age[0] += 1


@inner_njit
def enter(program: Program, basis: Basis, p: int, variable: int) -> None:
    """Note that a variable has taken place p."""
    num, size = program.weights.size, program.sides.size
    old = basis.variable[p]
    if old < num:
        basis.place[old] = -1
    elif old < num + size:
        basis.slack_place[old - num] = -1
    basis.variable[p] = variable
    basis.free[p] = True
    if variable < num:
        basis.place[variable] = p
    elif variable < num + size:
        basis.slack_place[variable - num] = p


@njit
def refactor(program: Program, allowed: Allowed, basis: Basis) -> None:
    """Compute everything anew from ``variable``; places that have become dependent get anchors.

    The multipliers are then those of the basis, but for the rows of new anchors, which keep theirs.
    """
    num, size = program.weights.size, program.sides.size
    inverse, row, column = basis.inverse, basis.row, basis.column
    members = basis.variable.copy()
    old = basis.duals.copy()
    basis.place[:] = -1
    basis.slack_place[:] = -1
    inverse[:] = 0.0
    taken = np.zeros(size, np.bool_)
    # every row that has no unit vector of its own is filled by a column
    for r in range(size):
        inverse[r, r] = 1.0
        basis.variable[r] = num + size + r
    for code in members:
        if code >= num:
            r = (code - num) % size
            taken[r] = True
            basis.variable[r] = code
            if code < num + size:
                basis.slack_place[r] = r
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
        basis.place[j] = p
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
    # what follows from the inverse
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
    """The basis of these variables, its anchors with these costs."""
    basis = new_basis(program)
    basis.variable[:] = variable
    basis.duals[:] = duals
    basis.anchors[:] = duals
    refactor(program, allowed, basis)
    return basis


@inner_njit
def residual(program: Program, basis: Basis) -> float:
    """How far the values in the basis are from satisfying the rows."""
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
        # what is no number is no residual that is small
        if not abs(left[r]) <= largest:
            largest = abs(left[r])
    return largest


def primal_values(program: Program, basis: Basis, primal: Floats) -> None:
    """Value of every column."""
    columns = basis.variable < program.weights.size
    primal[:] = 0.0
    primal[basis.variable[columns]] = np.maximum(basis.values[columns], 0.0)
