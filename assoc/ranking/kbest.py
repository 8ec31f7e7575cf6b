"""The true k best solutions of an assignment problem.

Two sensors: Murty's algorithm (murty/murty.py). More: the multipliers of the dual bound give every solution its
excess, the sum of its reduced costs, over the bound. All solutions whose excess is at most D use only
columns of reduced cost <= D. D grows until k solutions lie within; for each D the columns that are left
fall apart into components, each component's solutions are ranked (component_ranking.py), and the ranked lists
are merged (merging.py). Nothing is sampled or guessed: a solution that is not listed has been excluded by a bound.
"""

from __future__ import annotations

import contextlib
import math
import sys
import time
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from assoc._parameters import checked_time_limit
from assoc._system import memory
from assoc._system.door import door
from assoc._system.interrupts import interruptible
from assoc.errors import InfeasibleError, InvalidInputError
from assoc.packing.branching.feasibility import infeasible
from assoc.packing.prepare import Prepared, conditioned, prepare
from assoc.packing.run import Outcome, Run
from assoc.problem import AssignmentProblem
from assoc.ranking.columns import AllColumns, price_all_columns
from assoc.ranking.head_start import HeadStart
from assoc.ranking.iterative_deepening import Deepening
from assoc.ranking.two_sensors import rank_two_sensors
from assoc.solution import Solution
from assoc.solvers.certificate import certify
from assoc.solvers.greedy.fallback import prepare_fallback
from assoc.solvers.greedy.parameters import GreedyParameters
from assoc.solvers.greedy.solve import greedy_choice

# bytes of a solution and for each measurement in it: in the search's stores while they grow, and as an answer
_SOLUTION, _MEASUREMENT = 2_000, 130


@door
def kbest(problem: AssignmentProblem, k: int, *, time_limit: float | None = None) -> list[Solution]:
    """Return the k best solutions, truly ranked.

    Parameters
    ----------
    problem : AssignmentProblem
        What to solve; any number of sensors, with or without dummies.
    k : int
        How many; if the problem has fewer solutions, all of them are returned. If there is memory for fewer (some
        2 kB and 150 bytes for each measurement of the problem), so many are, and ``stopped_by`` says "memory_limit".
    time_limit : float, optional
        Seconds. When they are over, the list is cut after the last rank that is proved. If not even the
        best is, the best solution known is returned alone; its ``status`` is then "feasible".

    Returns
    -------
    list of Solution
        By cost, equal costs by their tuples. Solutions are different when their sets of tuples are: a tuple
        that is listed twice counts once, at its smaller cost. The ``lower_bound`` of the i-th solution holds
        for all solutions that are not among the i - 1 before it.

    Raises
    ------
    InfeasibleError
        There is no solution, or none was found in the time.
    InvalidInputError
        ``k`` is not a whole number >= 1, or the time limit is not positive.

    Notes
    -----
    Costs that differ by rounding alone (relative 1e-12) count as equal; which of the solutions that tie for
    the last place are returned is not defined. Where large costs cancel so that rounding hides the order, ranks
    are "feasible": they may cost more than the true ones, by their gap at the most.

    References
    ----------
    K. G. Murty, "An algorithm for ranking all the assignments in order of increasing cost", Operations
    Research 16, 682-687 (1968).
    """
    if not isinstance(problem, AssignmentProblem):
        raise InvalidInputError(f"problem: expected an AssignmentProblem, got {type(problem).__name__}")
    started, k, limit = time.perf_counter(), checked_k(k), checked_time_limit(time_limit)
    known: list[Solution] = []
    with interruptible():
        for own in conditioned(problem):
            run = Run(0, time_limit=limit, started=started)
            found = [own.restored(problem, one) for one in rank(own.problem, k, None, run).solutions]
            places = {one.tuples.tobytes() for one in known}
            new = [one for one in found if one.tuples.tobytes() not in places]
            # up to the first that has a lowered cost; where time is over that one is better than none
            sure = next((place for place, one in enumerate(new) if own.alters(one)), len(new))
            count = max(sure, 1) if run.stopped_by and not known else sure
            known += [_at_rank(one, len(known) + place + 1) for place, one in enumerate(new[:count])]
            if sure == len(new) or run.stopped_by or len(known) >= k:
                break
    return known[:k]


def _at_rank(solution: Solution, place: int) -> Solution:
    """The solution with its place in the list."""
    parameters = {**solution.parameters, "rank": place}
    return solution if parameters == solution.parameters else replace(solution, parameters=parameters)


@dataclass(frozen=True, slots=True)
class Ranking:
    """The k best and what is known of all others.

    Attributes
    ----------
    solutions : list of Solution
        See ``kbest``.
    rest : float
        No other solution costs less than this; ``inf``: there is no other.
    columns : AllColumns
        The columns and their prices.
    """

    solutions: list[Solution]
    rest: float
    columns: AllColumns


def rank(problem: AssignmentProblem, k: int, time_limit: float | None, run: Run | None = None) -> Ranking:
    """Return the k best together with a bound on the rest; a run that is under way has its own time limit."""
    started = time.perf_counter()
    run = run or Run(0, time_limit=checked_time_limit(time_limit), started=started)
    each = _SOLUTION + (_MEASUREMENT + 4 * problem.num_sensors) * int(problem.sizes.sum())
    most = memory.at_most(k, each)
    prepared = prepare(problem)
    packing = prepared.packing
    ahead = HeadStart(packing, run)
    if problem.num_sensors == 2:
        columns, found = rank_two_sensors(problem, most, run)
    else:
        # what stands for the best when time is over: the ascent would leave no time for it
        prepare_fallback(packing, run)
        columns = price_all_columns(problem, run)
        found = Deepening(columns, most, run, ahead).run()
    if len(found.chosen) == most < k and found.rest < np.inf:
        run.stopped_by = run.stopped_by or "memory_limit"
    rest = found.rest + columns.offset
    rest -= _rounding(columns, prepared, found.rest)
    if not found.chosen:
        rest = max(rest, ahead.bound + columns.offset - _rounding(columns, prepared, ahead.bound))
        return Ranking([_unproved(problem, rest, k, run, columns, found.known)], rest, columns)
    answers = _in_order(problem, [columns.indices(own) for own in found.chosen])
    runtime, compile_time = run.runtime(), run.compile_time()
    solutions = [
        Solution(
            tuples=problem.tuples[indices],
            indices=indices,
            cost=cost,
            lower_bound=min(cost - _rounding(columns, prepared, cost - columns.offset), rest),
            solver="kbest",
            iterations=found.nodes,
            runtime=runtime,
            stopped_by=run.stopped_by or "converged",
            parameters={"k": k, "rank": place + 1},
            compile_time=compile_time,
        )
        for place, (cost, indices) in enumerate(answers)
    ]
    return Ranking(solutions, rest, columns)


def _rounding(columns: AllColumns, prepared: Prepared, weight: float) -> float:
    """By how much rounding can have changed the sums that solutions of this weight are compared by.

    Reduced costs are >= 0, so that the negative weights of a solution add up to no more than its multipliers do;
    weights are differences of costs.
    """
    if not math.isfinite(weight):
        return 0.0
    size = abs(weight) + 2.0 * float(np.abs(columns.duals).sum()) + float(np.abs(prepared.single_cost).sum())
    return max(max(8.0, columns.slack.size) * sys.float_info.epsilon * size, columns.error)


def checked_k(k: object) -> int:
    """Return a number of solutions wanted as an int.

    Raises
    ------
    InvalidInputError
        It is not a whole number >= 1.
    """
    if not isinstance(k, (int, np.integer)) or isinstance(k, bool) or k < 1:
        raise InvalidInputError(f"k: expected a whole number >= 1, got {k!r}")
    return int(k)


def _in_order(problem: AssignmentProblem, chosen: list[NDArray[np.intp]]) -> list[tuple[float, NDArray[np.intp]]]:
    """Cost and tuples in lexicographic order of each solution; solutions by cost, equal costs by tuples."""
    sizes = [indices.size for indices in chosen]
    used, place = np.unique(np.concatenate(chosen), return_inverse=True)
    order = np.lexsort(problem.tuples[used].T[::-1])
    rank_of = np.empty(used.size, dtype=np.intp)
    rank_of[order] = np.arange(used.size)
    owner = np.repeat(np.arange(len(chosen)), sizes)
    ranks = rank_of[place]
    by_solution = np.split(ranks[np.lexsort((ranks, owner))], np.cumsum(sizes)[:-1])
    answers = []
    for own in by_solution:
        indices = used[order[own]]
        answers.append((math.fsum(problem.costs[indices].tolist()), own.tolist(), indices))
    answers.sort(key=lambda answer: answer[:2])
    return [(cost, indices) for cost, _, indices in answers]


def quick(problem: AssignmentProblem, bound: float, run: Run) -> Solution:
    """Return the greedy solution, which a run on a large problem has made already, with a bound that is known.

    Raises
    ------
    InfeasibleError
        The greedy choice is a dead end (possible only without dummies), and no time is left to get out of it.
    """
    prepared = prepare(problem)
    columns = run.fallback if run.fallback is not None else greedy_choice(prepared.packing, run)
    if columns is None:
        raise infeasible(prepared.packing, run)
    return certify(problem, prepared, Outcome(columns, 0, bound - prepared.offset), run, "greedy", GreedyParameters())


def _unproved(
    problem: AssignmentProblem, bound: float, k: int, run: Run, columns: AllColumns, known: NDArray[np.int32] | None
) -> Solution:
    """Return the best solution known when time was over before the best was proved."""
    if known is None:
        solution = quick(problem, bound, run)
    else:
        ((cost, indices),) = _in_order(problem, [columns.indices(known)])
        solution = Solution(problem.tuples[indices], indices, cost, min(bound, cost), "kbest", 0, 0.0)
        with contextlib.suppress(InfeasibleError):
            solution = min(solution, quick(problem, bound, run), key=lambda one: one.cost)
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
