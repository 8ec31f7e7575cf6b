"""The root of a branch and bound: its linear program, tightened by cuts before branching."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._system.clock import is_over
from assoc._types import Floats
from assoc.packing.packing import Packing
from assoc.packing.simplex.basis import Basis, basis_of, begin_from_duals, new_basis
from assoc.packing.simplex.cuts import odd_sets, with_cuts
from assoc.packing.simplex.dual import OPTIMAL, Effort, most_exchanges, solve_dual
from assoc.packing.simplex.program import Program, all_allowed, make_feasible, program_of, weight_limit

# most rounds of cuts; most in a row that gain less than this share of the gap; cuts for each row
_ROUNDS, _IN_VAIN, _GAIN = 30, 3, 0.01
_CUTS = 0.5
MOST_ROWS = 1.0 + _CUTS
"""Rows of a program with cuts, as a multiple of those without."""
# most by which a solution's whole-numbered weights are lowered, as a share of their least difference
_LOWERED = 5e-4


class Root(NamedTuple):
    """A linear program and the start of its search."""

    program: Program
    """Rows of measurements, then cuts."""
    slack: NDArray[np.bool_]
    """Whether a row of the program may stay uncovered; true for all cuts."""
    variable: NDArray[np.int32]
    """A basis, and its multipliers (``duals``)."""
    duals: Floats
    sets: NDArray[np.bool_]
    """The odd sets of rows that define the cuts, (cuts, R)."""


def plain_root(packing: Packing, duals: Floats) -> Root:
    """The root without cuts, from these multipliers."""
    rows = packing.num_rows
    anchors = (packing.num_columns + rows + np.arange(rows)).astype(np.int32)
    program = program_of(packing.arrays)
    if packing.granularity:
        program = program._replace(weights=_lowered(packing))
    return Root(program, packing.slack, anchors, duals, np.zeros((0, rows), dtype=np.bool_))


def _lowered(packing: Packing) -> Floats:
    """Perturb whole-numbered weights: each is lowered by a little.

    With equal weights the simplex method is degenerate. Bounds stay valid, and a search for solutions better by a whole
    number still finds them, as a solution's weight is lowered by less than that.
    """
    number = np.arange(packing.num_columns, dtype=np.uint64)
    share = (number * np.uint64(2654435761) % np.uint64(2**32)) / 2.0**32
    # a packing without anything to cover has no rows
    return packing.weights - _LOWERED * packing.granularity / max(packing.num_rows, 1) * share


def root_with_cuts(
    packing: Packing, duals: Floats, cutoff: float, deadline: float, sets: NDArray[np.bool_] | None = None
) -> Root:
    """The root of a component with cuts, added while they raise its bound; cuts that are not tight are removed.

    Multipliers (R + K,) to start from, of rows and known odd sets (K, R); only solutions that weigh less than the
    cutoff are searched for.
    """
    rows = packing.num_rows
    root = plain_root(packing, duals[:rows])
    if sets is None:
        sets = root.sets
    program = with_cuts(packing.arrays.cols, root.program.weights, rows, sets) if len(sets) else root.program
    effort = Effort(min(cutoff, float(weight_limit(program))), most_exchanges(program), deadline)
    basis = new_basis(program)
    allowed = all_allowed(program, np.concatenate([root.slack, np.ones(len(sets), dtype=np.bool_)]))
    begin = duals.copy()
    make_feasible(program, allowed, begin)
    begin_from_duals(program, allowed, begin, basis)
    status, _ = solve_dual(program, allowed, basis, effort)
    bound = _bound(program, basis)
    in_vain = 0
    for _ in range(_ROUNDS):
        if status != OPTIMAL or is_over(deadline):
            break
        tight = basis.slack_position[rows:] < 0
        new = odd_sets(packing.arrays.cols, basis, rows)[: max(int(_CUTS * rows) - int(tight.sum()), 0)]
        if not len(new) or in_vain >= _IN_VAIN:
            break
        variable = _renumbered(basis.variable, packing.num_columns, rows, tight, len(new))
        sets = np.concatenate([sets[tight], new])
        program = with_cuts(packing.arrays.cols, root.program.weights, rows, sets)
        allowed = all_allowed(program, np.concatenate([packing.slack, np.ones(len(sets), dtype=np.bool_)]))
        duals = np.concatenate([basis.duals[:rows], basis.duals[rows:][tight], np.zeros(len(new))])
        basis = basis_of(program, allowed, variable, duals)
        status, _ = solve_dual(program, allowed, basis, effort)
        before, bound = bound, _bound(program, basis)
        in_vain = in_vain + 1 if bound - before < _GAIN * (cutoff - bound) else 0
    return Root(program, allowed.slack, basis.variable, basis.duals, sets)


def _renumbered(
    variable: NDArray[np.int32], num: int, rows: int, tight: NDArray[np.bool_], new: int
) -> NDArray[np.int32]:
    """The basis without the removed cuts, and with the slacks of the new ones."""
    kept = np.concatenate([np.arange(rows), np.where(tight, rows + np.cumsum(tight) - 1, -1)])
    is_column = variable < num
    kind, row = np.divmod(np.where(is_column, 0, variable - num), kept.size)
    size = rows + int(tight.sum()) + new
    code = np.where(is_column, variable, num + kind * size + kept[row])
    code = code[is_column | (kept[row] >= 0)]
    return np.concatenate([code, num + size - new + np.arange(new)]).astype(np.int32)


def _bound(program: Program, basis: Basis) -> float:
    return float(program.sides @ basis.duals)
