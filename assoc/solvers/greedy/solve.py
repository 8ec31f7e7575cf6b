"""Greedy: take the tuple of least cost that is still free, again and again."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from assoc._parameters import Parameters
from assoc.packing.run import Outcome, Run
from assoc.solvers.greedy.parameters import GreedyParameters

if TYPE_CHECKING:
    from assoc.packing.packing import Packing


def solve(packing: Packing, parameters: Parameters, run: Run) -> Outcome:
    """Choose columns in order of weight; one iteration is one column looked at.

    Without dummies the greedy choice can run into a dead end; it is then completed by ejections
    (``local_search.complete``).

    Raises
    ------
    InfeasibleError
        No complete choice was found.
    """
    from assoc.packing.branching.feasibility import infeasible
    from assoc.packing.kernels.sorting import ascending
    from assoc.packing.neighbourhoods.cover import Cover

    cover = Cover.empty(packing)
    cover.add_greedily(ascending(packing.weights))
    if not cover.complete(run):
        raise infeasible(packing, run)
    run.record(packing.num_columns, cover.weight, -math.inf)
    return Outcome(cover.columns(), packing.num_columns)


parameters = GreedyParameters
