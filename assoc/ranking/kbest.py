"""The true k best solutions of an assignment problem.

Two sensors: Murty's algorithm (murty/murty.py). More sensors: the excess of a solution over the dual bound is the sum
of its reduced costs. Solutions of excess at most D use only columns of reduced cost <= D. D grows until it admits k
solutions. For each D the remaining columns split into components, each component's solutions are ranked
(component_ranking.py), and the ranked lists are merged (iterative_deepening.py). Nothing is sampled or guessed: every
solution that is not listed is excluded by a bound.
"""

from __future__ import annotations

import contextlib
import math
import sys
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assoc._parameters import checked_time_limit
from assoc._system import memory
from assoc._system.interrupts import interruptible
from assoc._system.wrong_types import explains_wrong_types
from assoc.errors import InfeasibleError, InvalidInputError
from assoc.packing.prepare import Prepared, prepare, with_capped_costs
from assoc.packing.run import Outcome, Run, infeasible
from assoc.problem import AssignmentProblem, taken_problem
from assoc.ranking.columns import AllColumns, distinct_columns, price_all_columns, priced, slack_of
from assoc.ranking.component_ranking import FIRST_BUDGET
from assoc.ranking.head_start import HeadStart
from assoc.ranking.iterative_deepening import Deepening, Found
from assoc.ranking.murty.murty import Murty
from assoc.solution import Solution
from assoc.solvers.certificate import certify
from assoc.solvers.greedy.fallback import prepare_fallback
from assoc.solvers.greedy.parameters import GreedyParameters
from assoc.solvers.greedy.solve import greedy_choice
from assoc.solvers.methods import EXACT_METHODS

# bytes of a solution and of each measurement in it: in the search's stores while they grow, and as an answer
_SOLUTION, _MEASUREMENT = 2_000, 130


@explains_wrong_types
def kbest(problem: AssignmentProblem | ArrayLike, k: int, *, time_limit: float | None = None) -> list[Solution]:
    """Return the k best solutions, truly ranked.

    Parameters
    ----------
    problem : AssignmentProblem or array_like
        What to solve; any number of sensors, with or without dummies. An array of costs is taken as by `assign`.
    k : int
        Number of solutions; if the problem has fewer, all of them are returned. Where memory suffices only for fewer
        (about 2 kB each, and 150 bytes for each measurement of the problem), fewer are returned, and ``stopped_by`` is
        "memory_limit".
    time_limit : float, optional
        Seconds, after which the list is cut behind the last rank that is proved. If not even the best is proved, only
        the best known solution is returned; its ``status`` is then "feasible".

    Returns
    -------
    list of Solution
        Sorted by cost, equal costs by their tuples. Solutions differ when their sets of tuples do: a tuple
        that is listed twice counts once, at its smaller cost. The ``lower_bound`` of the i-th solution holds
        for all solutions except the i - 1 before it.

    Raises
    ------
    InfeasibleError
        There is no solution, or none was found in the time.
    InvalidInputError
        ``k`` is not a whole number >= 1, or the time limit is not positive.

    Notes
    -----
    Costs that differ only by rounding (relative 1e-12) count as equal; which of the solutions that tie for
    the last rank are returned is not defined. Where large costs cancel so that rounding hides the order, the ``status``
    of ranks is "feasible": they may cost more than the true ones, by at most their gap.

    References
    ----------
    K. G. Murty, "An algorithm for ranking all the assignments in order of increasing cost", Operations
    Research 16, 682-687 (1968).
    """
    problem = taken_problem(problem)
    k, clock = checked_k(k), Run(0, time_limit=checked_time_limit(time_limit), methods=EXACT_METHODS)
    known: list[Solution] = []
    with interruptible():
        for version in with_capped_costs(problem):
            run = clock.part(0, clock.time_limit)
            found = [version.restored(problem, solution) for solution in rank(version.problem, k, run)]
            listed = {solution.tuples.tobytes() for solution in known}
            new = [solution for solution in found if solution.tuples.tobytes() not in listed]
            # up to the first with a lowered cost; when time is over, that one is better than nothing
            sure = next((i for i, solution in enumerate(new) if version.alters(solution)), len(new))
            count = max(sure, 1) if run.stopped_by and not known else sure
            known += [_at_rank(solution, number) for number, solution in enumerate(new[:count], len(known) + 1)]
            if sure == len(new) or run.stopped_by or len(known) >= k:
                break
    return known[:k]


def _at_rank(solution: Solution, number: int) -> Solution:
    """The solution with its rank in the list."""
    parameters = {**solution.parameters, "rank": number}
    return solution if parameters == solution.parameters else replace(solution, parameters=parameters)


def rank(problem: AssignmentProblem, k: int, run: Run, budget: int = FIRST_BUDGET) -> list[Solution]:
    """The k best solutions of a problem without costs that are far too large, see `kbest`.

    A component is branched on after ``budget`` decisions of enumeration beyond one for each row.
    """
    each = _SOLUTION + (_MEASUREMENT + 4 * problem.num_sensors) * int(problem.sizes.sum())
    most = memory.at_most(k, each)
    prepared = prepare(problem)
    packing = prepared.packing
    ahead = HeadStart(packing, run)
    if problem.num_sensors == 2:
        columns, found = rank_two_sensors(problem, most, run)
    else:
        # the fallback comes first: the ascent might leave no time for it
        prepare_fallback(packing, run)
        columns = price_all_columns(problem, run)
        found = Deepening(columns, most, run, ahead, budget).run()
    if len(found.chosen) == most < k and found.rest < np.inf:
        run.stopped_by = run.stopped_by or "memory_limit"
    # no other solution costs less
    rest = found.rest + columns.offset
    rest -= _rounding(columns, prepared, found.rest)
    if not found.chosen:
        rest = max(rest, ahead.bound + columns.offset - _rounding(columns, prepared, ahead.bound))
        return [_unproved(problem, rest, k, run, columns, found.known)]
    answers = _in_order(problem, [columns.indices(chosen) for chosen in found.chosen])
    runtime, compile_time = run.runtime(), run.compile_time()
    return [
        Solution(
            tuples=problem.tuples[indices],
            indices=indices,
            cost=cost,
            lower_bound=min(cost - _rounding(columns, prepared, cost - columns.offset), rest),
            solver="kbest",
            iterations=found.nodes,
            runtime=runtime,
            stopped_by=run.stopped_by or "converged",
            parameters={"k": k, "rank": index + 1},
            compile_time=compile_time,
        )
        for index, (cost, indices) in enumerate(answers)
    ]


def _rounding(columns: AllColumns, prepared: Prepared, weight: float) -> float:
    """Bound the rounding errors of the sums by which solutions of this weight are compared.

    Reduced costs are >= 0, so that the magnitude of a solution's negative weights is bounded by that of its
    multipliers; weights are differences of costs.
    """
    if not math.isfinite(weight):
        return 0.0
    size = abs(weight) + 2.0 * float(np.abs(columns.duals).sum()) + float(np.abs(prepared.single_cost).sum())
    return max(max(8.0, columns.slack.size) * sys.float_info.epsilon * size, columns.error)


def checked_k(k: object) -> int:
    """Return k, a whole number >= 1, as an int."""
    if not isinstance(k, (int, np.integer)) or isinstance(k, bool) or k < 1:
        raise InvalidInputError(f"k: expected a whole number >= 1, got {k!r}")
    return int(k)


def _in_order(problem: AssignmentProblem, chosen: list[NDArray[np.intp]]) -> list[tuple[float, NDArray[np.intp]]]:
    """Cost and tuples in lexicographic order of each solution; solutions by cost, equal costs by tuples."""
    sizes = [indices.size for indices in chosen]
    used, index = np.unique(np.concatenate(chosen), return_inverse=True)
    order = np.lexsort(problem.tuples[used].T[::-1])
    rank_of = np.empty(used.size, dtype=np.intp)
    rank_of[order] = np.arange(used.size)
    owner = np.repeat(np.arange(len(chosen)), sizes)
    ranks = rank_of[index]
    by_solution = np.split(ranks[np.lexsort((ranks, owner))], np.cumsum(sizes)[:-1])
    answers = []
    for ordered in by_solution:
        indices = used[order[ordered]]
        answers.append((math.fsum(problem.costs[indices].tolist()), ordered.tolist(), indices))
    answers.sort(key=lambda answer: answer[:2])
    return [(cost, indices) for cost, _, indices in answers]


def quick(problem: AssignmentProblem, bound: float, run: Run) -> Solution:
    """Return the greedy solution, which a run on a large problem has already made, with the bound given.

    InfeasibleError if the choice cannot be completed (possible only without dummies), and no time is left for a search.
    """
    prepared = prepare(problem)
    columns = run.fallback if run.fallback is not None else greedy_choice(prepared.packing, run)
    if columns is None:
        raise infeasible(prepared.packing, run)
    return certify(problem, prepared, Outcome(columns, 0, bound - prepared.offset), run, "greedy", GreedyParameters())


def _unproved(
    problem: AssignmentProblem, bound: float, k: int, run: Run, columns: AllColumns, known: NDArray[np.int32] | None
) -> Solution:
    """Return the best solution known, where time ended before one was proved optimal."""
    if known is None:
        solution = quick(problem, bound, run)
    else:
        ((cost, indices),) = _in_order(problem, [columns.indices(known)])
        solution = Solution(problem.tuples[indices], indices, cost, min(bound, cost), "kbest", 0, 0.0)
        with contextlib.suppress(InfeasibleError):
            solution = min(solution, quick(problem, bound, run), key=lambda answer: answer.cost)
    return replace(
        solution,
        solver="kbest",
        runtime=run.runtime(),
        compile_time=run.compile_time(),
        stopped_by=run.stopped_by,
        duals=(),
        trace=(),
        parameters={"k": k, "rank": 1},
    )


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
