"""What a Solution says about itself, and what the front door refuses."""

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

import assoc
from assoc.errors import AssocWarning, InfeasibleError, InvalidInputError
from assoc.problem import AssignmentProblem
from assoc.ranking.kbest import kbest
from assoc.ranking.marginals import marginals
from assoc.solution import Solution
from assoc.solvers.assign import assign
from tests.oracles import gated_problem


def solution(cost, bound, tuples=((1, 1, 0), (0, 0, 1))):
    return Solution(
        tuples=np.array(tuples, dtype=np.int32).reshape(-1, 3),
        indices=np.arange(len(tuples)),
        cost=cost,
        lower_bound=bound,
        solver="greedy",
        iterations=1,
        runtime=0.001,
    )


@pytest.mark.parametrize(
    ("cost", "bound", "status"),
    [
        (5.0, 5.0, "optimal"),
        (5.0, 5.0 - 4e-6, "optimal"),
        (5.0, 5.0 - 6e-6, "feasible"),
        (-5.0, -5.0 - 4e-6, "optimal"),
        (-5.0, -5.0 - 6e-6, "feasible"),
        (0.0, -9e-7, "optimal"),
        (0.0, -2e-6, "feasible"),
        (1e6, 1e6 - 0.9, "optimal"),
        (1.0, -np.inf, "feasible"),
    ],
)
def test_status_follows_from_the_gap(cost, bound, status):
    found = solution(cost, bound)
    assert found.status == status
    assert found.gap == cost - bound


def test_frame():
    frame = solution(0.0, 0.0).to_frame()
    assert list(frame.columns) == ["sensor_1", "sensor_2", "sensor_3", "measurements"]
    assert frame.to_numpy().tolist() == [[1, 1, 0, 2], [0, 0, 1, 1]]
    assert len(solution(0.0, 0.0, ()).to_frame()) == 0


def test_what_assign_returns():
    problem = gated_problem(np.random.default_rng(1), (5, 5, 5), 0.5)
    found = assoc.assign(problem, seed=np.random.SeedSequence(3))
    assert found.solver == "exact" and found.status == "optimal"
    assert found.runtime > 0.0
    assert found.tuples.tolist() == sorted(found.tuples.tolist())
    assert found.trace[-1].cost == pytest.approx(found.cost)
    assert found.parameters
    assert np.array_equal(problem.tuples[found.indices], found.tuples)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"solver": "exakt"}, "solver: unknown name 'exakt'; did you mean exact"),
        ({"seed": -1}, "seed: expected a whole number >= 0, or None for a random one, got -1"),
        ({"time_limit": 0}, "time_limit: expected seconds > 0"),
        ({"time_limit": float("nan")}, "time_limit: expected"),
        ({"nodez": 3}, "nodez: no parameter of solver 'exact'; did you mean nodes"),
        ({"nodes": -3}, "nodes: expected"),
        ({"solver": "greedy", "ants": 3}, "ants: no parameter of solver 'greedy'; it takes none"),
    ],
)
def test_assign_refuses(arguments, message):
    problem = AssignmentProblem([[1, 1]], [-1.0], [1, 1])
    with pytest.raises(InvalidInputError, match=message) as caught:
        assign(problem, **arguments)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("shape", [(4, 4), (3, 5), (5, 3)])
def test_assign_says_that_it_takes_a_matrix_as_scipy_does(shape):
    costs = np.random.default_rng(0).normal(size=shape)
    with pytest.warns(
        AssocWarning, match=rf"array of shape \({shape[0]}, {shape[1]}\) is taken as by scipy's"
    ) as caught:
        solution = assign(costs)
        kbest(costs, 2)
        marginals(costs)
    assert all("\n" not in str(one.message) for one in caught) and len(caught) == 3
    assert {one.filename for one in caught} == {__file__}
    assert np.array_equal(solution.tuples.T - 1, linear_sum_assignment(costs))
    assert np.array_equal(assign(AssignmentProblem.from_dense(costs, dummy=False)).tuples, solution.tuples)
    with pytest.warns(AssocWarning), pytest.raises(InfeasibleError):
        assign(np.full(shape, np.inf).tolist())
    with pytest.raises(
        InvalidInputError, match="problem: expected an AssignmentProblem or costs of two or more dimens"
    ):
        assign(costs[0])


def test_infeasible_says_why():
    with pytest.raises(InfeasibleError, match="1 measurement.* that must be used are in no tuple"):
        assign(AssignmentProblem([[1, 1]], [0.0], [2, 3], dummy=False))
    with pytest.raises(InfeasibleError, match="no choice of tuples"):
        assign(AssignmentProblem([[1, 1], [2, 1]], [0.0, 0.0], [2, 3], dummy=False))
    with pytest.raises(InfeasibleError, match="that must be used"):
        assign(AssignmentProblem([[1, 1]], [float("inf")], [1, 1], dummy=False))
