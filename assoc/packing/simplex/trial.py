"""Some steps of the dual simplex method from an unchanged basis, to estimate the gain of a branch.

The inverse is not changed. The pivots are kept as *etas* (the product form of the inverse): after k pivots a row or a
column of the tableau takes k more sums, which for a few dozen pivots is far less than updating the inverse each time.
Leaving variables are chosen by Devex weights, as those of the steepest edge would need the whole inverse.

References
----------
G. B. Dantzig, W. Orchard-Hays, "The product form for the inverse in the simplex method", Mathematical Tables and Other
Aids to Computation 8 (1954), 64-67.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import lean_inner_njit
from assoc._system.kernels.copying import copy_to
from assoc._types import Floats
from assoc.packing.simplex.basis import SMALL_PIVOT, Basis, basis_without, coordinates, copy_without_inverse, enter
from assoc.packing.simplex.dual import (
    CUT,
    INFEASIBLE,
    OPTIMAL,
    STOPPED,
    Effort,
    bound_of,
    cost_tolerance,
    entering,
    leaving,
    note_free,
    step_along,
)
from assoc.packing.simplex.pricing import list_columns, price
from assoc.packing.simplex.program import Allowed, Program

# the least weight of a leaving variable
_LEAST = 1e-4


class Trial(NamedTuple):
    """A basis, without inverse, up to ``K`` pivots from another one."""

    basis: Basis
    reduced: Floats
    """Reduced costs at the other basis, by position, (n,)."""
    rows: NDArray[np.float64]
    """The other basis's inverse by rows, (m, m); that basis stores it by columns."""
    etas: NDArray[np.float64]
    """Of each pivot minus the entering column over the pivot element, and at its position 1 over it, (K, m)."""
    pivots: NDArray[np.int32]
    """The position of each pivot, (K,)."""
    factors: Floats
    """Buffer: factors (else 0) of the other inverse's rows that combine to one of this basis, (m,)."""
    shares: NDArray[np.int32]
    """Buffer: which rows these are, (K + 1,)."""


def new_trial(program: Program, exchanges: int) -> Trial:
    """Allocate a trial of up to ``exchanges`` pivots."""
    size = program.sides.size
    return Trial(
        basis_without(program, 0), np.empty(program.weights.size), np.empty((size, size)),
        np.zeros((exchanges, size)), np.zeros(exchanges, np.int32), np.zeros(size), np.zeros(exchanges + 1, np.int32),
    )  # fmt: skip


@lean_inner_njit
def begin_trials(program: Program, allowed: Allowed, base: Basis, trial: Trial) -> None:
    """Record the basis from which trials start, and what it allows."""
    pricing = trial.basis.pricing
    list_columns(program, allowed, pricing)
    price(program, base.duals, base.position, pricing)
    for a in range(allowed.active.size):
        trial.reduced[a] = pricing.reduced[a]
    for i in range(trial.rows.shape[0]):
        for r in range(trial.rows.shape[1]):
            trial.rows[i, r] = base.inverse[r, i]


@lean_inner_njit
def _tableau_row(trial: Trial, done: int, p: int) -> None:
    """Fill ``row`` with the inverse's row of position p, after the pivots done."""
    factors, shares, row = trial.factors, trial.shares, trial.basis.row
    etas, rows, pivots = trial.etas, trial.rows, trial.pivots
    factors[p] = 1.0
    shares[0] = p
    count = 1
    for k in range(done - 1, -1, -1):
        total = 0.0
        for i in range(count):
            total += factors[shares[i]] * etas[k, shares[i]]
        position = pivots[k]
        factors[position] = total
        known = False
        for i in range(count):
            known = known or shares[i] == position
        if not known:
            shares[count] = position
            count += 1
    row[:] = 0.0
    for i in range(count):
        position, share = shares[i], factors[shares[i]]
        for r in range(row.size):
            row[r] += share * rows[position, r]
        factors[position] = 0.0


@lean_inner_njit
def _tableau_column(program: Program, base: Basis, trial: Trial, done: int, variable: int) -> None:
    """Fill ``column`` with the coordinates of a variable in the basis, after the pivots done."""
    num, column, etas, pivots = program.weights.size, trial.basis.column, trial.etas, trial.pivots
    if variable < num:
        coordinates(program, base, variable, column)
    else:
        copy_to(column, base.inverse[variable - num])
    for k in range(done):
        position = pivots[k]
        share = column[position]
        if share != 0.0:
            column[position] = 0.0
            for i in range(column.size):
                column[i] += share * etas[k, i]


@lean_inner_njit
def _exchange(trial: Trial, done: int, p: int) -> None:
    """Pivot: the variable of ``column`` enters at position p. Updates the eta, the weights, the values."""
    basis, etas = trial.basis, trial.etas
    column, values, norms = basis.column, basis.values, basis.norms
    pivot = column[p]
    leaving_norm = norms[p]
    step = values[p] / pivot
    for i in range(column.size):
        ratio = column[i] / pivot
        etas[done, i] = -ratio
        values[i] -= step * column[i]
        norms[i] = max(norms[i], ratio * ratio * leaving_norm)
    etas[done, p] = 1.0 / pivot
    trial.pivots[done] = p
    values[p] = step
    norms[p] = max(leaving_norm / (pivot * pivot), _LEAST)


@lean_inner_njit
def try_dual(program: Program, allowed: Allowed, base: Basis, trial: Trial, effort: Effort) -> int:
    """Take some steps from the recorded optimal basis, after ``allowed`` has been restricted; return the status.

    Steps are limited by the trial's capacity and by ``effort``. At the end the multipliers give the bound reached. They
    may be infeasible by rounding, so make them feasible before using it.
    """
    basis, num = trial.basis, program.weights.size
    copy_without_inverse(base, basis)
    note_free(program, allowed, basis)
    pricing, columns, at_first = basis.pricing, allowed.columns, trial.reduced
    reduced, column = pricing.reduced, pricing.column
    for a in range(pricing.listed[0]):
        reduced[a] = at_first[a] if columns[column[a]] else np.inf
    tolerance = cost_tolerance(program, allowed)
    done = 0
    while True:
        bound = bound_of(program, basis)
        if bound >= effort.cutoff:
            return CUT
        p = leaving(basis)
        if p < 0:
            return OPTIMAL
        if done >= min(effort.exchanges, trial.pivots.size):
            return STOPPED
        sign = 1.0 if basis.values[p] > 0.0 else -1.0
        _tableau_row(trial, done, p)
        chosen, step = entering(program, allowed, basis, sign, tolerance)
        if chosen < 0:
            # the bound is unlimited; raise it to the cutoff
            step_along(program, allowed, basis, p, sign, max(effort.cutoff - bound, 0.0) / abs(basis.values[p]) * 1.001)
            return INFEASIBLE
        _tableau_column(program, base, trial, done, chosen)
        if abs(basis.column[p]) < SMALL_PIVOT:
            return STOPPED
        step_along(program, allowed, basis, p, sign, step)
        if chosen < num:
            reduced[pricing.position[chosen]] = np.inf
        _exchange(trial, done, p)
        enter(program, basis, p, chosen)
        done += 1
