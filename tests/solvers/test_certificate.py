"""No wrong choice of columns passes the certificate, and a right one comes back as the problem's own tuples."""

import math

import numpy as np
import pytest

from assoc.errors import InfeasibleError
from assoc.packing.prepare import prepare
from assoc.packing.run import Outcome, Run
from assoc.problem import AssignmentProblem
from assoc.solvers.assign import assign
from assoc.solvers.certificate import certify
from assoc.solvers.greedy.parameters import GreedyParameters
from tests.oracles import small_problems

PROBLEM = AssignmentProblem([[1, 1], [2, 2], [1, 2], [2, 1]], [-3.0, -2.0, -4.0, -0.5], [2, 2])


def answer(problem, columns, bound=-np.inf):
    outcome = Outcome(np.array(columns, dtype=np.int64), 1, bound)
    return certify(problem, prepare(problem), outcome, Run(0), "test", GreedyParameters())


def column(problem, *tuple_):
    """Return the column of a tuple."""
    place = np.flatnonzero((problem.tuples == tuple_).all(axis=1))[0]
    return int(np.flatnonzero(prepare(problem).packing.origin == place)[0])


@pytest.mark.parametrize("wrong", [[-1], [4], [0, 99]])
def test_a_column_that_is_none_is_refused(wrong):
    with pytest.raises(InfeasibleError, match="does not use every measurement exactly once"):
        answer(PROBLEM, wrong)


@pytest.mark.parametrize("dummy", [True, False])
def test_choices_of_columns_against_a_plain_count(dummy):
    """Every choice of up to three columns of small problems: accepted if and only if each measurement is used once."""
    rng = np.random.default_rng(4)
    accepted = refused = 0
    for problem in small_problems(40, seed=3, dummy=dummy):
        packing = prepare(problem).packing
        for _ in range(20):
            if packing.num_columns == 0:
                break
            columns = rng.integers(0, packing.num_columns, rng.integers(0, 4)).tolist()
            used = [(s, i) for j in columns for s, i in enumerate(problem.tuples[packing.origin[j]]) if i > 0]
            must = 0 if dummy else int(problem.sizes.min()) * int((problem.sizes == problem.sizes.min()).sum())
            smallest = [s for s, size in enumerate(problem.sizes) if size == problem.sizes.min()]
            right = len(set(used)) == len(used) and (dummy or sum(s in smallest for s, _ in used) == must)
            if not right:
                refused += 1
                with pytest.raises(InfeasibleError):
                    answer(problem, columns)
                continue
            accepted += 1
            solution = answer(problem, columns)
            assert solution.cost == math.fsum(problem.costs[solution.indices])
            rows = [tuple(row) for row in solution.tuples.tolist()]
            assert rows == sorted(rows)
            assert (problem.tuples[solution.indices] == solution.tuples).all()
    assert accepted > 20 and refused > 20


def test_a_bound_holds_where_false_alarms_add_up_badly():
    """Added as numpy adds them, small costs beside 1 make the sum of all false alarms too large by seven epsilons."""
    # numpy adds blocks of 128 in eight sums, of which each has a 1 and fifteen small ones
    alone = np.where(np.arange(127) < 8, 1.0, 1.2e-16)
    tuples = [[number + 1, 0] for number in range(127)] + [[1, 1]]
    problem = AssignmentProblem(tuples, [*alone.tolist(), 0.0], [127, 1])
    # the tuple weighs -1; the answer leaves it out
    assert answer(problem, [], bound=-1.0).lower_bound <= math.fsum(alone[1:])


@pytest.mark.parametrize("dummy", [True, False])
def test_of_a_tuple_that_is_listed_twice_the_cheaper_copy_counts(dummy):
    """Whichever copy a solver chose, as within its tolerance they are the same."""
    costs = [-1.0 - 1e-10, -3.0, -1.0, -1.0 - 2e-10, -9.0]
    problem = AssignmentProblem([[1, 1], [2, 2], [1, 1], [1, 1], [2, 1]], costs, [2, 2], dummy=dummy)
    packing = prepare(problem).packing
    for place in (0, 2, 3):
        columns = np.flatnonzero((packing.origin == place) | (packing.origin == 1))
        solution = answer(problem, columns)
        assert solution.cost == math.fsum([-3.0, -1.0 - 2e-10])
        assert 3 in solution.indices


def test_a_bound_that_is_none_is_found_anew():
    for bound in (-np.inf, np.nan):
        assert -6.0 < answer(PROBLEM, [column(PROBLEM, 1, 2)], bound).lower_bound <= -5.0


def test_greedy_proves_of_the_whole_what_it_proves_of_its_parts():
    """Bounds of parts add up; the short ascent that many columns get does not close them."""
    rng, parts = np.random.default_rng(77), []
    while len(parts) < 6:
        tuples = np.unique(rng.integers(0, 5, (30, 3)), axis=0)[1:]
        part = AssignmentProblem(tuples, -rng.gamma(2.0, 2.0, len(tuples)), [4, 4, 4])
        if assign(part, "greedy").status == "optimal":
            parts.append((part.tuples, part.costs))
    # measurements of their own, which nobody contends for
    parts += [(np.full((1, 3), 1, np.int32), np.full(1, -10.0))] * 150
    sizes = np.array([tuples.max(axis=0) for tuples, _ in parts])
    before = np.cumsum(sizes, axis=0) - sizes
    tuples = np.concatenate([np.where(t > 0, t + b, 0) for (t, _), b in zip(parts, before, strict=True)])
    costs = np.concatenate([costs for _, costs in parts])
    assert assign(AssignmentProblem(tuples, costs, sizes.sum(axis=0)), "greedy").status == "optimal"
