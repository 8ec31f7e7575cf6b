"""Every way to an answer on the same random problems, against exact arithmetic and against each other.

    python -m tests.reliability.differential --count 5000 --seed 1 [--ways exact,aco] [--each 1] [--processes 2]

prints the faults found (none, one hopes), each with the seed and number that make it again. With ``--each`` a problem
is answered in so many ways only, each in its turn: more problems, and the state that one way leaves is met by another.
"""

import argparse
import contextlib
import math
import sys
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from assoc._parameters import Parameters
from assoc._system.compile_time import compile_seconds
from assoc._system.processes import process_map
from assoc.errors import AssocWarning, InfeasibleError
from assoc.packing.packing import Packing
from assoc.packing.run import Outcome, Run
from assoc.problem import AssignmentProblem
from assoc.ranking.kbest import kbest
from assoc.ranking.marginals import WIDEST, weighed
from assoc.solution import OPTIMALITY_TOLERANCE, Solution
from assoc.solvers import registry
from assoc.solvers.assign import assign
from assoc.solvers.greedy.parameters import GreedyParameters
from assoc.solvers.greedy.solve import solve as greedy_solve
from experiments.common.claims import Claim
from tests.reliability.exact import exact_cost, exact_marginals, exact_ranks
from tests.reliability.problems import Case, draw
from tests.reliability.results import add_ends, report

Way = Callable[[AssignmentProblem], list[Solution]]


_RANKS = 4
_END = 200
"""Rankings of problems with fewer solutions are asked for to the end."""
_SLOW = 5.0  # seconds; problems of this size take milliseconds
_PROGRESS = 60.0  # seconds between two lines that say how far one is


def _by(solver: str, **parameters: object) -> Way:
    return lambda problem: [assign(problem, solver, **parameters)]


def _through_a_file(problem: AssignmentProblem) -> list[Solution]:
    """Solve what comes back from an npz file; the choice must be as good as that of the original."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "problem.npz"
        problem.save(path)
        again = AssignmentProblem.load(path)
    if not (
        np.array_equal(again.tuples, problem.tuples)
        and again.costs.tobytes() == problem.costs.tobytes()
        and np.array_equal(again.sizes, problem.sizes)
        and again.dummy == problem.dummy
    ):
        raise AssertionError("the problem changed on its way through a file")
    return [assign(again, "exact")]


def _through_a_tensor(problem: AssignmentProblem) -> list[Solution]:
    """Solve the problem written out densely."""
    again = AssignmentProblem.from_dense(problem.to_dense(), dummy=problem.dummy)
    answer = assign(again, "exact")
    # rows of the other problem: find the same tuples, at their smaller cost, in this one
    least: dict[tuple[int, ...], int] = {}
    for i in np.argsort(-problem.costs, kind="stable").tolist():
        least[tuple(problem.tuples[i].tolist())] = i
    indices = np.array([least[tuple(row)] for row in answer.tuples.tolist()], dtype=np.intp)
    return [
        Solution(
            answer.tuples,
            indices,
            answer.cost,
            answer.lower_bound,
            "exact",
            answer.iterations,
            answer.runtime,
        )
    ]


def _from_a_start(solver: str, **parameters: object) -> Way:
    """Begin with a solution, good, middling or bad: the answer costs no more."""

    def way(problem: AssignmentProblem) -> list[Solution]:
        starts = [assign(problem, "greedy"), *kbest(problem, 5)]
        if problem.dummy:
            # all measurements as false alarms
            alone = AssignmentProblem(problem.tuples[:0], [], problem.sizes)
            starts.append(assign(alone, "greedy", advise=False))
        start = starts[problem.num_tuples % len(starts)]
        answer = assign(problem, solver, start=start, **parameters)
        excess = exact_cost(problem, answer.indices) - exact_start(problem, start)
        # of sums of 1e20 doubles know no units
        if excess > magnitude(problem, exact_start(problem, start)) / 10**17:
            raise AssertionError(f"costs {answer.cost!r}, its start {start.cost!r}")
        return [answer]

    return way


def exact_start(problem: AssignmentProblem, start: Solution) -> Fraction:
    """What the tuples of a start cost in a problem, in exact arithmetic."""
    costs = sorted(zip(map(tuple, problem.tuples.tolist()), problem.costs.tolist(), strict=True), reverse=True)
    least = dict(costs)
    return sum((Fraction(least[tuple(row)]) for row in start.tuples.tolist()), Fraction(0))


@dataclass(frozen=True)
class _NoParameters(Parameters):
    """A liar has nothing to choose."""


def _lie(packing: Packing, parameters: Parameters, run: Run) -> Outcome:
    """Choose greedily and lie about it: of the bound, of multipliers, or by changing the weights for all who follow."""
    columns = greedy_solve(packing, GreedyParameters(), run).columns
    weight = float(packing.weights[columns].sum())
    kind = packing.num_columns % 4
    if kind == 0:
        with contextlib.suppress(ValueError):
            packing.weights[:] = -packing.weights
    return [
        Outcome(columns, 1, -math.inf),
        Outcome(columns, 1, math.inf),
        Outcome(columns, 1, weight),
        Outcome(columns, 1, weight, np.full(packing.num_rows, 1e3)),
    ][kind]


def _by_a_liar(problem: AssignmentProblem) -> list[Solution]:
    registry.register("liar", _NoParameters, _lie)
    try:
        return [assign(problem, "liar")]
    finally:
        del registry._REGISTERED["liar"]


def _after_a_liar(problem: AssignmentProblem) -> list[Solution]:
    """What exact says once a liar has had the problem in its hands."""
    _by_a_liar(problem)
    return [assign(problem)]


WAYS: dict[str, Way] = {
    "exact": _by("exact"),
    "greedy": _by("greedy"),
    "aco": _by("aco"),
    # the colony of the paper walks on where others have long closed, and so does genetic search: some cycles are enough
    "aco paper": _by("aco", mode="paper", iterations=40),
    "genetic": _by("genetic", iterations=20),
    "tabu": _by("tabu"),
    "lagrangian": _by("lagrangian"),
    "lagrangian cold": _by("lagrangian", warm_start=False, polish=False),
    "milp scip": _by("milp"),
    "milp highs": _by("milp", backend="highs"),
    "kbest": lambda problem: kbest(problem, _RANKS),
    "ranking": lambda problem: kbest(problem, _END),
    "file": _through_a_file,
    "tensor": _through_a_tensor,
    **{f"{solver} from a start": _from_a_start(solver) for solver in ("exact", "aco", "tabu", "lagrangian", "milp")},
    "genetic from a start": _from_a_start("genetic", iterations=20),
    "liar": _by_a_liar,
    "after a liar": _after_a_liar,
}
_SAMPLED = "marginals sampled"
LISTED = {"marginals": (WIDEST, 1.0), _SAMPLED: (0, 0.05)}
"""Ways to probabilities: measurements open in sums, and how long chains are."""
_TOLD, _WITHIN, _BEYOND = "sampled probabilities with an error below 1", "within four errors", "beyond ten errors"
RANKED = {"kbest": _RANKS, "ranking": _END}
"""Ways to rankings: how many solutions are asked for."""
PROVING = ("exact", "kbest", "ranking", "file", "tensor", "exact from a start", "after a liar")
"""Ways that promise the optimum on problems of this size."""


def magnitude(problem: AssignmentProblem, worst: Fraction) -> Fraction:
    """Sum of the magnitudes of costs that solutions of a cost can have: what rounding is measured by.

    A tuple that costs more than all negative ones can make good is in none of them.
    """
    costs = list(map(Fraction, problem.costs.tolist()))
    most = worst - sum(cost for cost in costs if cost < 0)
    return sum((abs(cost) for cost in costs if cost <= most), Fraction(0))


def answered(work: Callable[[], Any], solvable: bool, found: list[Any]) -> Iterator[str]:
    """Add what the work returns to ``found``, or say what is wrong: an error, or an answer where there is none."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.filterwarnings("ignore", "none of the .* tuples costs less|.* too large for doubles", AssocWarning)
            result = work()
    except InfeasibleError:
        if solvable:
            yield "says infeasible"
    except Exception as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        yield f"raises {type(error).__name__} at {Path(last.filename).name}:{last.lineno}: {error}"
    else:
        if solvable:
            found.append(result)
        else:
            yield "answers a problem that has no solution"


def faults(problem: AssignmentProblem, truth: list[Fraction] | None, name: str, way: Way) -> Iterator[str]:
    """What is wrong with the answer that comes this way; ``truth``: the best costs, None where there is no solution."""
    found: list[Any] = []
    yield from answered(lambda: way(problem), truth is not None, found)
    if not found or truth is None:
        return
    answers = found[0]
    # bounds of later places hold for what is not before them
    for place, (answer, own) in enumerate(zip(answers, truth, strict=False)):
        yield from (f"{text} (place {place})" for text in _faults_of(problem, own, answer))
    if name in RANKED and len(answers) != len(truth):
        yield f"lists {len(answers)} solutions of {len(truth)}"
    first, optimum = answers[0], truth[0]
    if name in PROVING:
        # solvers close their gaps to 1e-9 of the weights they see, which are differences of costs
        room = magnitude(problem, optimum) * Fraction(1.01) / 10**9
        excess = exact_cost(problem, first.indices) - optimum
        if excess > Fraction(OPTIMALITY_TOLERANCE) * max(1, abs(optimum)) + room:
            yield f"is {float(excess):.3g} above the optimum {float(optimum):.6g}"
        if first.status != "optimal" and first.gap > float(room):
            yield f"is not certified: gap {first.gap:.3g} of {first.cost:.6g}"
    costs = [answer.cost for answer in answers]
    if costs != sorted(costs):
        yield "ranks its answers wrongly"
    if len({answer.tuples.tobytes() for answer in answers}) != len(answers):
        yield "lists a solution twice"


def probability_faults(
    problem: AssignmentProblem, truth: dict[tuple[int, ...], float] | None, name: str, compared: Counter[str]
) -> Iterator[str]:
    """What is wrong with the probabilities; ``truth`` None: there is no solution.

    A standard error is no bound, and no sample shows what it never met: how often those that were sampled by force are
    within their errors is counted in ``compared``, and judged over all problems (`sampled_claims`).
    """
    results: list[Any] = []
    yield from answered(lambda: weighed(problem, None, *LISTED[name]), truth is not None, results)
    if not results or truth is None:
        return
    found = results[0]
    if not np.isfinite([found.probability, found.error]).all() or ((found.error == 0.0) != found.exact).any():
        yield "says no numbers, or an error that is not that of its kind"
    for row, p, error in zip(found.tuples.tolist(), found.probability.tolist(), found.error.tolist(), strict=True):
        # singletons that are not listed are in the result, not in the problem
        true = truth.get(tuple(row))
        away = 0.0 if true is None else max(abs(p - true) - 2e-8, 0.0)
        if true is not None and name == _SAMPLED and 0.0 < error < 1.0:
            compared.update({_TOLD: 1, _WITHIN: away <= 4.0 * error, _BEYOND: away > 10.0 * error})
        elif not away <= 10.0 * error:
            yield f"says {p:.12g} +- {error:.3g} of {row}, true is {true:.12g}"
        if not 0.0 <= p <= 1.0 or not 0.0 <= error <= 1.0:
            yield f"says {p!r} +- {error!r} of {row}"


def _faults_of(problem: AssignmentProblem, optimum: Fraction, answer: Solution) -> Iterator[str]:
    if not np.array_equal(problem.tuples[answer.indices], answer.tuples):
        yield "names other tuples than it indexes"
    smallest = int(problem.sizes.min())
    for s, size in enumerate(problem.sizes.tolist()):
        column = answer.tuples[:, s]
        used = np.bincount(column[column > 0], minlength=size + 1)[1:]
        if (used > 1).any() or ((problem.dummy or size == smallest) and (used == 0).any()):
            yield f"is not feasible in sensor {s + 1}"
    cost = exact_cost(problem, answer.indices)
    if not math.isfinite(answer.cost) or float(cost) != answer.cost:
        yield f"says cost {answer.cost!r}, its tuples cost {float(cost)!r}"
    # nan fails every comparison; a bound may be -inf where nothing is known
    if not answer.lower_bound <= answer.cost:
        yield f"has the bound {answer.lower_bound!r} above its cost {answer.cost!r}"
    # a bound of up to the optimum's nearest float is at most half a unit in the last place above it
    if answer.lower_bound > float(optimum):
        over = Fraction(answer.lower_bound) - optimum
        # a cost is the nearest float to the exact sum: half a unit in the last place may lie above it
        if over > abs(optimum) / 2**53 and over > magnitude(problem, optimum) / 10**17 + abs(optimum) / 2**53:
            yield f"has a bound {float(over):.3g} above the optimum {float(optimum)!r}"
    if answer.status == "optimal" and answer.cost > float(optimum):
        excess = cost - optimum
        if excess > Fraction(1.01 * OPTIMALITY_TOLERANCE) * max(1, abs(cost)):
            yield f"says optimal, {float(excess):.3g} above the optimum {float(optimum):.6g}"


def true_ranks(case: Case, names: list[str]) -> list[Fraction] | None:
    """Costs of as many of the best solutions as some of the ways ask for; None where there are none."""
    try:
        return exact_ranks(case.problem, max(RANKED.get(name, 1) for name in names))
    except InfeasibleError:
        return None


def judge(case: Case, names: list[str]) -> list[str]:
    """All faults on one case, as lines."""
    return _judged(case, names, true_ranks(case, names), Counter())


def sampled_claims(name: str, compared: Counter[str]) -> list[Claim]:
    """How often the sampled probabilities of a run are within four of their standard errors: in 99 of 100, at least."""
    if not compared[_TOLD]:
        return []
    share = compared[_WITHIN] / compared[_TOLD]
    return [Claim(f"{name}: share of sampled probabilities within four errors", ours=share, band=(0.99, 1.0))]


def _judged(case: Case, names: list[str], ranks: list[Fraction] | None, compared: Counter[str]) -> list[str]:
    truth = None
    if ranks is not None and not LISTED.keys().isdisjoint(names):
        truth = exact_marginals(case.problem)
    lines = []
    for name in names:
        if name in LISTED:
            found = probability_faults(case.problem, truth, name, compared)
        else:
            found = faults(case.problem, ranks and ranks[: RANKED.get(name, 1)], name, WAYS[name])
        lines += [f"{name} {text}" for text in found]
    return lines


@dataclass
class Judge:
    """Judges cases by their numbers.

    Answers the structure and temper of the case, the faults, and what was compared: answers by their ways.
    """

    seed: int
    names: list[str]
    each: int = 0

    def __call__(self, number: int) -> tuple[str, str, list[str], Counter[str]]:
        """Draw a case and judge it."""
        case = draw(self.seed, number)
        before = time.process_time() - compile_seconds()
        each = self.each or len(self.names)
        names = [self.names[(number * each + turn) % len(self.names)] for turn in range(each)]
        ranks = true_ranks(case, names)
        compared = Counter(dict.fromkeys(names, 1) if self.each else {}, answers=each)
        lines = _judged(case, names, ranks, compared)
        seconds = time.process_time() - compile_seconds() - before
        if seconds > _SLOW:
            lines.append(f"all ways together take {seconds:.1f} s")
        if ranks is not None and "ranking" in names:
            compared.update({"rankings to the end": len(ranks) < _END, "solutions ranked": len(ranks)})
        if ranks is not None and not LISTED.keys().isdisjoint(names):
            compared["probabilities"] = case.problem.num_tuples
        return case.structure, case.temper, lines, compared


def main(arguments: list[str] | None = None) -> int:
    """Run the program; exit code 1 if there were faults."""
    parser = argparse.ArgumentParser(description="All solvers on random problems, against exact arithmetic.")
    parser.add_argument("--count", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--start", type=int, default=0)
    parser.add_argument("--ways", default=",".join([*WAYS, *LISTED]))
    parser.add_argument("--each", type=int, default=0, help="ways a problem, in turn (default: all)")
    parser.add_argument("--show", type=int, default=5, help="examples of each kind of fault")
    parser.add_argument("--processes", type=int, default=1)
    add_ends(parser)
    chosen = parser.parse_args(arguments)
    names = chosen.ways.split(",")
    kinds: Counter[str] = Counter()
    compared: Counter[str] = Counter()
    numbers = range(chosen.start, chosen.start + chosen.count)
    started = said = time.perf_counter()
    judged = process_map(Judge(chosen.seed, names, chosen.each), numbers, chosen.processes)
    for number, (structure, temper, lines, counts) in zip(numbers, judged, strict=True):
        compared.update(counts, problems=1)
        for line in lines:
            kind = f"[{temper}] " + " ".join(word for word in line.split() if not any(c.isdigit() for c in word))
            kinds[kind] += 1
            if kinds[kind] <= chosen.show:
                print(f"seed {chosen.seed} number {number} ({structure}, {temper}): {line}", flush=True)
        if time.perf_counter() - started > 60.0 * chosen.minutes:
            break
        if time.perf_counter() - said > _PROGRESS:
            said = time.perf_counter()
            done, faulty = number + 1 - chosen.start, sum(kinds.values())
            print(f"{done} of {chosen.count} problems, {said - started:.0f} s: {faulty} faults, {compared}", flush=True)
    claims = sampled_claims(chosen.publish or "differential", compared)
    return report("differential", chosen.publish, compared, kinds, claims)


if __name__ == "__main__":
    sys.exit(main())
