"""The k best of problems with two sensors, by Murty's algorithm."""

from __future__ import annotations

import numpy as np

from assoc.packing.prepare import prepare
from assoc.packing.run import Run, infeasible
from assoc.problem import AssignmentProblem
from assoc.ranking.columns import AllColumns, distinct_columns, priced, slack_of
from assoc.ranking.iterative_deepening import Found
from assoc.ranking.murty.murty import Murty


def rank_two_sensors(problem: AssignmentProblem, k: int, run: Run) -> tuple[AllColumns, Found]:
    """Return the columns of a problem with two sensors and its k lightest solutions; InfeasibleError without any."""
    rows, weights, origin = distinct_columns(problem)
    slack = slack_of(problem)
    n, m = (int(size) for size in problem.sizes)
    # the rows are the sensor with fewer measurements: each node then has fewer children
    first, second = rows[:, 0], rows[:, 1] - np.int32(n)
    first_alone, second_alone = slack[:n], slack[n:]
    turned = n > m
    if turned:
        first, second, first_alone, second_alone = second, first, second_alone, first_alone
    murty = Murty(
        np.ascontiguousarray(first),
        np.ascontiguousarray(second),
        weights,
        np.ascontiguousarray(first_alone),
        np.ascontiguousarray(second_alone),
        k,
    )
    prepared = prepare(problem)
    if not murty.feasible:
        raise infeasible(prepared.packing)
    # shortest paths between two checks of the clock: some ten milliseconds
    turn = min(2000, max(1, 5_000_000 // max(weights.size, 1)))
    while not murty.done and not run.should_stop():
        murty.run(turn)
    u, v = murty.duals
    duals = np.concatenate([v, u] if turned else [u, v])
    columns = priced(rows, weights, origin, slack, duals, prepared.offset, prepared.single)
    return columns, Found([murty.edges(rank) for rank in range(murty.num_found)], murty.rest, murty.evaluations)
