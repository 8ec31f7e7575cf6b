"""Exact: bound, heuristic, reduced-cost fixing, then branch and bound on the rest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from assoc.packing.bounds.dual_ascent import dual_bound
from assoc.packing.branching.search import BranchAndBound
from assoc.packing.packing import Packing
from assoc.packing.run import Outcome, Run
from assoc.solution import OPTIMALITY_TOLERANCE
from assoc.solvers.exact.parameters import ExactParameters
from assoc.solvers.exact.search import search_to_the_end

# column visits of the search that closes the remaining gap where costs cancel
_VISITS = 20_000_000


def solve(packing: Packing, parameters: ExactParameters, run: Run) -> Outcome:
    """Find the optimum and prove it; at the time limit return the best solution and a valid bound.

    One iteration is one node of branch and bound.

    Raises
    ------
    InfeasibleError
        There is no solution (proved), or none was found in time.
    """
    outcome = search_to_the_end(packing, parameters.nodes, parameters.patience, run, parameters.gap)
    return outcome if run.stopped_by else _where_costs_cancel(packing, outcome, run)


def _where_costs_cancel(packing: Packing, outcome: Outcome, run: Run) -> Outcome:
    """Close a gap that is small relative to the weights but not to the cost, where offset and weights cancel.

    The components were solved to 1e-9 of their weights, and the incumbent is optimal to that precision. So a search
    with a smaller tolerance has little left to do.
    """
    last = run.trace[-1]
    wanted = 0.2 * OPTIMALITY_TOLERANCE * max(1.0, abs(last.cost))
    if last.cost - last.lower_bound <= 4.0 * wanted:
        return outcome
    chosen = packing.weights[outcome.columns]
    weight, size = float(chosen.sum()), float(np.abs(chosen).sum())
    wanted = max(wanted, 1e-14 * size)  # no search sees below the rounding error
    # gaps with another cause cannot be closed so, and those of rounding not at all
    if not 4.0 * wanted < weight - outcome.lower_bound < 1e-8 * size:
        return outcome
    search = BranchAndBound(packing, dual_bound(packing, run=run), weight, wanted, run.deadline, run.memory_allows)
    most = max(50, _VISITS // packing.num_columns)
    while not search.done and search.nodes < most and not run.should_stop():
        search.run(max(1, 20_000 // packing.num_columns))
    columns = outcome.columns if search.columns is None else search.columns
    bound = max(outcome.lower_bound, search.lower_bound)
    nodes = outcome.iterations + search.nodes
    return replace(outcome, columns=columns, iterations=nodes, lower_bound=bound, duals=None)
