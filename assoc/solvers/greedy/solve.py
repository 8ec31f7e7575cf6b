"""Greedy: take the cheapest tuple that still fits, again and again."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from assoc._parameters import Parameters
from assoc._system.kernels.sorting import ascending
from assoc.packing.bounds.dual_ascent import certified_bound, dual_bound
from assoc.packing.bounds.priced import TOLERANCE
from assoc.packing.cover import Cover
from assoc.packing.packing import Packing
from assoc.packing.run import Outcome, Run, infeasible

# temperatures and passes of a short ascent, a sixth of the time of the whole one; its bound is lower by a few
# thousandths, and an answer as near to it as that may be optimal
_LEVELS, _PASSES, _NEAR = 3, 7, 5e-3
# columns for which the whole ascent takes no longer than the rest of the call
_FEW = 100


def solve(packing: Packing, parameters: Parameters, run: Run) -> Outcome:
    """Choose columns in order of weight; one iteration is one column tried.

    Without dummies the greedy choice can run into a dead end; it is then completed by ejections or, if these fail, by
    a search. With many columns the bound is that of a short dual ascent, but where this leaves little: there the whole
    one may prove the answer.

    Raises
    ------
    InfeasibleError
        No complete choice was found.
    """
    columns: NDArray[np.integer] | None = greedy_choice(packing, run)
    if columns is None:
        columns = run.start
    if columns is None:
        raise infeasible(packing, run)
    weight = float(packing.weights[columns].sum())
    run.record(packing.num_columns, weight, -math.inf)
    if packing.num_columns > _FEW:
        duals = dual_bound(packing, levels=_LEVELS, passes=_PASSES, run=run)
        bound = certified_bound(packing, duals)
        if not TOLERANCE * max(1.0, abs(bound)) < weight - bound <= _NEAR * abs(bound):
            return Outcome(columns, packing.num_columns, bound, duals)
    return Outcome(columns, packing.num_columns)


def greedy_choice(packing: Packing, run: Run) -> NDArray[np.int32] | None:
    """Return the columns of the greedy choice; None at a dead end that is not resolved in time."""
    cover = Cover.empty(packing)
    cover.add_greedily(ascending(packing.weights))
    return cover.columns() if cover.complete(run) else None
