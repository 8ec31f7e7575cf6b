"""The Lagrangian bound is valid on every kind of problem, and the recovered solutions are good."""

from fractions import Fraction

import numpy as np
import pytest

from assoc.errors import InvalidInputError
from assoc.packing.bounds.dual_ascent import certified_bound, dual_bound
from assoc.packing.prepare import prepare
from assoc.packing.run import Run
from assoc.solvers.assign import assign
from assoc.solvers.lagrangian.arranged import arrange
from assoc.solvers.lagrangian.parameters import LagrangianParameters
from assoc.solvers.lagrangian.relaxation import relax
from assoc.solvers.lagrangian.solve import Subgradient
from experiments.common.instances.synthetic import planted
from tests.oracles import brute_force, gated_problem, small_problems


def test_relaxation_is_above_the_multipliers_it_starts_from():
    rng = np.random.default_rng(5)
    for number in range(60):
        problem = gated_problem(rng, [(6, 7, 8), (5, 5, 5, 5)][number % 2], 0.2)
        packing = prepare(problem).packing
        start = dual_bound(packing, levels=2, passes=5)
        arranged = arrange(packing)
        duals, subgradient = relax(arranged, start)
        assert certified_bound(packing, duals) == pytest.approx(duals.sum(), abs=1e-9)
        assert duals.sum() >= start.sum() - 1e-9
        assert (duals <= 1e-12).all()
        # a supergradient: no multipliers of sensors 3..S do better than the plane through it
        other = np.minimum(start + rng.normal(0, 1, start.size), 0.0)
        moved, _ = relax(arranged, other)
        upper = arranged.sensor >= 2
        assert moved.sum() <= duals.sum() + subgradient @ ((moved - duals) * upper) + 1e-7


def assert_proves(packing, duals, optimum):
    """In fractions: no column is cheaper than its multipliers, a row that may stay unused has none above 0."""
    exact = [Fraction(u) for u in duals.tolist()]
    assert all(u <= 0 for u, slack in zip(exact, packing.slack, strict=True) if slack)
    for rows, weight in zip(packing.cols.tolist(), packing.weights.tolist(), strict=True):
        assert Fraction(weight) - sum(exact[r] for r in rows if r >= 0) >= -Fraction(1, 10**9)
    assert sum(exact) <= Fraction(optimum) + Fraction(1, 10**9)


@pytest.mark.parametrize("sizes", [(3, 3, 3), (2, 2, 3, 2), (2, 2, 2, 2, 2)])
def test_multipliers_prove_what_they_sum_to(sizes):
    rng = np.random.default_rng(9)
    for _ in range(8):
        problem = gated_problem(rng, sizes, 0.6)
        prepared = prepare(problem)
        packing, optimum = prepared.packing, brute_force(problem) - prepared.offset
        # at 0 also tuples that only the relaxed sensors see are too cheap
        for start in (np.zeros(packing.num_rows), -rng.exponential(2.0, packing.num_rows)):
            assert_proves(packing, relax(arrange(packing), start)[0], optimum)
        for steps in (1, 2, 5):
            parameters = LagrangianParameters(iterations=steps, warm_start=False, polish=False)
            search = Subgradient(packing, np.zeros(packing.num_rows), parameters, Run(rng), -np.inf)
            search.iterate()
            # over the columns left; the best cover is one of all columns
            assert_proves(search.packing, relax(search.arranged, search.duals)[0], search.weight)


def test_proof_by_multipliers():
    for problem in small_problems(100, seed=33, dummy=True):
        solution = assign(problem, "lagrangian", iterations=1)
        if not solution.duals:
            continue
        price = np.zeros(problem.num_tuples)
        for s, duals in enumerate(solution.duals):
            price += np.concatenate([[0.0], duals])[problem.tuples[:, s]]
        assert (problem.costs - price >= -1e-9).all()
        assert sum(d.sum() for d in solution.duals) <= solution.cost + 1e-9


@pytest.mark.parametrize(
    "bad",
    [{"iterations": 0}, {"gap": -1.0}, {"gap": float("nan")}, {"step": 0.0}, {"patience": 1.5}, {"polish": "yes"}],
)
def test_parameters_are_checked(bad):
    with pytest.raises(InvalidInputError, match=f"{next(iter(bad))}: expected"):
        assign(planted(3, 100, 3)[0], "lagrangian", **bad)
