"""Greedy: take the cheapest tuple that still fits, again and again."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from assoc._parameters import Parameters
from assoc._system.sorting import ascending
from assoc.packing.cover import Cover
from assoc.packing.packing import Packing
from assoc.packing.run import Outcome, Run, infeasible


def solve(packing: Packing, parameters: Parameters, run: Run) -> Outcome:
    """Choose columns in order of weight; one iteration is one column tried.

    Without dummies the greedy choice can run into a dead end; it is then completed by ejections or, if these fail, by
    a search.

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
    run.record(packing.num_columns, float(packing.weights[columns].sum()), -math.inf)
    return Outcome(columns, packing.num_columns)


def greedy_choice(packing: Packing, run: Run) -> NDArray[np.int32] | None:
    """Return the columns of the greedy choice; None at a dead end that is not resolved in time."""
    cover = Cover.empty(packing)
    cover.add_greedily(ascending(packing.weights))
    return cover.columns() if cover.complete(run) else None
