"""Every way to an answer, on random problems against exact arithmetic; `make fuzz` runs thousands."""

from collections import Counter
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from assoc.errors import AssocWarning, InfeasibleError
from assoc.problem import AssignmentProblem
from assoc.ranking.marginals import weighed
from assoc.solvers.assign import assign
from tests.reliability import differential
from tests.reliability.differential import LISTED, WAYS, Judge, faults, judge, sampled_claims
from tests.reliability.exact import (
    exact_marginals,
    exact_optimum,
    exact_ranks,
    marginals_of_part,
    ranks_of_part,
    unit_of,
)
from tests.reliability.problems import STRUCTURES, Case, draw, make, many_parts
from tests.reliability.tempers import TEMPERS
from tests.sizes import few_or_all, sample

# the structures and tempers there were when the faults below were found: the same numbers then draw the same problems
FIRST, SECOND = (list(STRUCTURES)[:14], list(TEMPERS)[:21]), (list(STRUCTURES)[:18], list(TEMPERS)[:21])
THIRD = (list(STRUCTURES)[:24], list(TEMPERS)[:29])
QUICK = [name for name in (*WAYS, *LISTED) if not name.startswith("milp")]


@sample("structure", STRUCTURES, every=3)
@few_or_all("tempers", ("normal",), ("normal", "ties", "wide"))
def test_every_structure(tempers, structure):
    for number, temper in enumerate(tempers):
        problem = make(np.random.default_rng([41, number]), structure, temper)
        assert judge(Case(problem, structure, temper, number), QUICK) == []


@pytest.mark.parametrize("temper", TEMPERS)
@few_or_all("structures", ("duplicates",), ("duplicates", "axial rectangular"))
def test_every_temper(structures, temper):
    for number, structure in enumerate(structures):
        problem = make(np.random.default_rng([42, number]), structure, temper)
        assert judge(Case(problem, structure, temper, number), [*WAYS, *LISTED]) == []


@pytest.mark.parametrize(("structure", "temper"), [("odd cycle", "large gap"), ("axial square", "18 decades")])
@few_or_all("count", 4, 30)
def test_intervals_hold_where_the_bound_is_far_from_the_optimum(count, structure, temper):
    for number in range(count):
        problem = make(np.random.default_rng([44, number]), structure, temper)
        assert judge(Case(problem, structure, temper, number), list(LISTED)) == []


@pytest.mark.parametrize(
    "number",
    [
        345,  # lagrangian recovered nothing where there is one sensor
    ],
)
def test_faults_that_were_found(number):
    assert judge(draw(1, number, *FIRST), list(WAYS)) == []


@pytest.mark.parametrize("temper", ["prices 1e3", "prices 1e6"])
def test_exact_proves_its_answer_where_costs_cancel(temper):
    """Gaps were closed to 1e-9 of the weights, which where they cancel is more than a millionth of the cost."""
    assert assign(draw(1, 2012, *FIRST).problem).status == "optimal"
    for number, structure in enumerate(("gated", "duplicates", "chain", "axial square")):
        problem = make(np.random.default_rng([43, number]), structure, temper)
        answer, optimum = assign(problem), exact_optimum(problem)
        assert answer.status == "optimal" and answer.cost == pytest.approx(float(optimum), rel=1e-6, abs=1e-6)
        assert answer.lower_bound <= optimum + 1e-9


def test_exact_finds_the_optimum_where_rounding_is_too_coarse_to_prove_it():
    """Costs of 2e9 cancel, and doubles of that size know steps of 5e-7: "feasible", but not 4.2 above the optimum."""
    problem = draw(9707, 2196, *THIRD).problem
    with pytest.warns(AssocWarning, match="too large for doubles"):
        answer, optimum = assign(problem), exact_optimum(problem)
    assert answer.status == "feasible" and answer.gap < 1e-4
    assert answer.cost == pytest.approx(float(optimum), abs=1e-4)


@pytest.mark.parametrize("solver", ["aco", "genetic", "tabu"])
def test_rounding_is_no_improvement(solver):
    """Covers whose weights differ by rounding alone were taken for ever better ones, for 1000 iterations."""
    problem = draw(2, 16, *FIRST).problem
    assert np.ptp(problem.costs[problem.costs < 0]) < 1e-8
    assert assign(problem, solver, patience=20).iterations <= 60


@pytest.mark.slow
def test_thousands_of_small_parts_beside_a_hard_one():
    rng = np.random.default_rng(45)
    tuples, sizes, dummy = many_parts(rng, 2000)
    problem = AssignmentProblem(tuples, TEMPERS["near ties"](rng, tuples, sizes), sizes, dummy=dummy)
    # a dense tensor has no room; tours of the paper's ants through thousands of measurements take a minute
    ways = [name for name in QUICK if name not in ("tensor", "aco paper")]
    assert judge(Case(problem, "many parts", "near ties", 0), ways) == []


def test_parts_are_counted_as_the_whole_is():
    for number in range(40):
        problem = draw(9, number, *FIRST).problem
        try:
            ranks = [Fraction(rank, unit_of(problem)) for rank in ranks_of_part(problem, 50, unit_of(problem))]
        except InfeasibleError:
            continue
        assert exact_ranks(problem, 50) == ranks and exact_optimum(problem) == ranks[0]
        whole = marginals_of_part(problem)
        found = exact_marginals(problem)
        assert [found[tuple(row)] for row in problem.tuples.tolist()] == pytest.approx(whole, abs=1e-12)


def test_the_judge_sees_faults():
    """Answers made wrong on purpose."""
    problem = AssignmentProblem([[1, 1], [1, 2], [2, 1]], [-3.0, -2.5, -2.0], [2, 2])
    right = assign(problem)
    truth = exact_ranks(problem, 4)
    assert right.cost == truth[0] == -4.5

    def found(answers):
        return " ".join(faults(problem, truth, "exact", lambda _: answers))

    class Wrong:
        """The right answer with some of it changed."""

        def __init__(self, **changes):
            self.__dict__.update({name: getattr(right, name) for name in right.__slots__} | changes)
            self.gap, self.status = self.cost - self.lower_bound, "optimal"

    worse = AssignmentProblem([[1, 1], [1, 2], [2, 1]], [-3.0, 9.0, 9.0], [2, 2])
    other = assign(worse)
    assert found([right]) == ""
    assert "above the optimum" in found([Wrong(lower_bound=-4.4, cost=-4.4)])
    assert "says cost" in found([Wrong(cost=-4.6, lower_bound=-4.6)])
    assert "says optimal" in found([Wrong(tuples=other.tuples, indices=other.indices, cost=-3.0, lower_bound=-4.5)])
    assert "not feasible" in found([Wrong(tuples=right.tuples[:1], indices=right.indices[:1])])
    assert "bound nan" in found([Wrong(lower_bound=float("nan"))])
    assert "twice" in found([right, right])


def test_whole_numbers_that_are_large():
    """Bounds were closed to the cost found, 2 above the optimum: tolerances relative to 2.7e9 are more than 1."""
    case = draw(42, 5122, *FIRST)
    for solver in ("exact", "tabu", "genetic", "aco", "lagrangian"):
        assert assign(case.problem, solver, seed=0).lower_bound <= -2.7e9


def test_multipliers_that_are_large_and_cancel():
    """Tabu search divided by the sum of excesses, which rounding had made zero."""
    assert judge(draw(42, 3362, *FIRST), ["tabu"]) == []


def test_rounding_is_no_better_matching():
    """Among prices that cancel the dimensionwise search found improvements of the order of rounding for ever."""
    assert judge(draw(600, 593, *SECOND), ["aco"]) == []


@pytest.mark.parametrize(("factor", "holds"), [(1.0, True), (0.01, False)])
def test_sampled_probabilities_are_judged_over_all_problems(monkeypatch, factor, holds):
    def told(*arguments):
        found = weighed(*arguments)
        return replace(found, error=np.where(found.exact | (found.error == 1.0), found.error, factor * found.error))

    monkeypatch.setattr(differential, "weighed", told)
    compared = Counter()
    for number in range(12):
        _, _, lines, counts = Judge(9951, ["marginals sampled"])(number)
        compared.update(counts)
        assert lines == []
    (claim,) = sampled_claims("some", compared)
    assert claim.holds is holds
