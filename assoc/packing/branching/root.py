"""The root of a branch and bound: its linear program, made tighter by cuts before any branching."""

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

# rounds of cuts at the most; of them in a row that may gain less than this share of the gap; cuts for each row
_ROUNDS, _IN_VAIN, _GAIN = 30, 3, 0.01
_CUTS = 0.5
MOST_ROWS = 1.0 + _CUTS
"""Rows of a program with cuts, as a multiple of those without."""
# what whole-numbered weights of a solution are lowered by at the most, as a share of the least difference
_LOWERED = 5e-4


class Root(NamedTuple):
    """A linear program and where its search begins.

    Attributes
    ----------
    program : Program
        Rows of measurements, then cuts.
    slack : bool array, shape (rows of the program,)
        Whether a row may stay uncovered; all cuts may.
    variable : int32 array, duals : float array, shape (rows of the program,)
        A basis and its multipliers.
    sets : bool array, shape (cuts, R)
        The odd sets of rows of which the cuts are made.
    """

    program: Program
    slack: NDArray[np.bool_]
    variable: NDArray[np.int32]
    duals: Floats
    sets: NDArray[np.bool_]


def plain_root(packing: Packing, duals: Floats) -> Root:
    """The root without cuts, from these multipliers."""
    rows = packing.num_rows
    anchors = (packing.num_columns + rows + np.arange(rows)).astype(np.int32)
    program = program_of(packing.arrays)
    if packing.granularity:
        program = program._replace(weights=_lowered(packing))
    return Root(program, packing.slack, anchors, duals, np.zeros((0, rows), dtype=np.bool_))


def _lowered(packing: Packing) -> Floats:
    """Whole-numbered weights made different, each lowered by a little.

    Among equal weights the simplex method stands still for long. No bound becomes invalid, and the search for
    something better by a whole number does not miss what a solution weighs less.
    """
    number = np.arange(packing.num_columns, dtype=np.uint64)
    share = (number * np.uint64(2654435761) % np.uint64(2**32)) / 2.0**32
    # a packing in which nothing is left to cover has no rows
    return packing.weights - _LOWERED * packing.granularity / max(packing.num_rows, 1) * share


def root_with_cuts(packing: Packing, duals: Floats, cutoff: float, deadline: float) -> Root:
    """The root with cuts, as long as these raise its bound; purged of those that no longer do.

    Parameters
    ----------
    packing : Packing
        One component.
    duals : float array, shape (R,)
        Multipliers to start from.
    cutoff : float
        Nothing that weighs as much is looked for.
    deadline : float
        When time is over (clock.py).
    """
    rows = packing.num_rows
    root = plain_root(packing, duals)
    program = root.program
    effort = Effort(min(cutoff, float(weight_limit(program))), most_exchanges(program), deadline)
    sets = np.zeros((0, rows), dtype=np.bool_)
    basis = new_basis(program)
    allowed = all_allowed(program, root.slack)
    begin = duals.copy()
    make_feasible(program, allowed, begin)
    begin_from_duals(program, allowed, begin, basis)
    status, _ = solve_dual(program, allowed, basis, effort)
    bound = _bound(program, basis)
    in_vain = 0
    for _ in range(_ROUNDS):
        if status != OPTIMAL or is_over(deadline):
            break
        tight = basis.slack_place[rows:] < 0
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
    """A basis without the cuts that are not tight, and with the slack of so many new ones."""
    kept = np.concatenate([np.arange(rows), np.where(tight, rows + np.cumsum(tight) - 1, -1)])
    is_column = variable < num
    kind, row = np.divmod(np.where(is_column, 0, variable - num), kept.size)
    size = rows + int(tight.sum()) + new
    code = np.where(is_column, variable, num + kind * size + kept[row])
    code = code[is_column | (kept[row] >= 0)]
    return np.concatenate([code, num + size - new + np.arange(new)]).astype(np.int32)


def _bound(program: Program, basis: Basis) -> float:
    return float(program.sides @ basis.duals)
