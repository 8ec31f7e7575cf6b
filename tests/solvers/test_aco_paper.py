"""Mode paper against equations 7 to 11 and the stopping rule in plain numpy, cycle by cycle, same random numbers."""

import time

import numpy as np
import pytest

import assoc
from assoc.errors import InfeasibleError, InvalidInputError
from assoc.packing.prepare import prepare
from assoc.packing.run import Run
from assoc.simulation import simulate
from assoc.solvers.aco import paper
from assoc.solvers.aco.parameters import AcoParameters
from tests.solvers.pieces import is_complete, problems, rows_of

PROBLEMS = problems()
# more measurements than partners: those that are left are no false alarms, and no choice of an ant
_PAIRS = [[i, j] for i in range(1, 5) for j in range(1, 8)]
PROBLEMS["unequal"] = assoc.AssignmentProblem(
    _PAIRS, np.random.default_rng(8).uniform(10.0, 20.0, len(_PAIRS)), [4, 7], dummy=False
)
SETTINGS = [
    {"alpha": 1.0, "beta": 1.0, "rho": 0.9},
    {"alpha": 2.0, "beta": 1.0, "rho": 0.3},
    {"alpha": 1.0, "beta": 3.0, "rho": 0.6, "ants": 7, "visibility": "shifted", "scale": 4.0},
    {"alpha": 0.0, "beta": 1.5, "rho": 0.5, "ants": 40, "scale": 3.0},
    {"alpha": 2.0, "beta": 1.0, "rho": 0.3, "start_on": "any", "tuples": "all"},
]


def positive_costs(costs, visibility="exponential", scale=10.0, **_):
    """Return costs that eq. 7 can take, in the same order."""
    spread = [c - min(costs) for c in costs]
    return np.array([np.exp(d / scale) if visibility == "exponential" else d + scale for d in spread])


def reference(packing, parameters, seed, cycles):
    """The paper's ants with sets and sums; yields the tours of all ants and the pheromone after each cycle."""
    alpha, beta, rho = parameters["alpha"], parameters["beta"], parameters["rho"]
    ants = parameters.get("ants", 15)
    alone = np.arange(packing.num_rows if packing.slack.all() else 0)
    nodes = [set(rows_of(packing, j)) for j in range(packing.num_columns)] + [{int(r)} for r in alone]
    costs = positive_costs([*packing.weights.tolist(), *[0.0] * alone.size], **parameters)
    eta = 1.0 / costs  # eq. 7
    tau = eta.copy()  # tau_j(0)
    rng = np.random.default_rng(seed)
    # different nodes, as long as there are as many nodes as ants
    starts = np.resize(rng.permutation(len(nodes)), ants)
    for cycle in range(1, cycles + 1):
        tours = []
        for start in starts:
            tour, taken = [], set()
            allowed = list(range(len(nodes)))
            j = int(start)
            while True:
                tour.append(j)
                taken |= nodes[j]
                allowed = [i for i in allowed if not nodes[i] & taken]
                if not allowed:
                    break
                if cycle == 1:
                    j = max(allowed, key=lambda i: (eta[i], -i))
                else:
                    chances = tau[allowed] ** alpha * eta[allowed] ** beta
                    p = chances / chances.sum()  # eq. 8
                    j = allowed[min(int(np.searchsorted(np.cumsum(p), rng.random(), side="right")), len(p) - 1)]
            tours.append(tour)
        laid = np.zeros(len(nodes))
        for tour in tours:
            laid[tour] += 1.0 / costs[tour].sum()  # eqs. 10 and 11
        tau = rho * tau + laid  # eq. 9
        yield tours, tau
        if len({frozenset(tour) for tour in tours}) == 1:
            return
        if parameters.get("start_on") == "any":
            tours = [tours[k] for k in rng.integers(0, ants, ants)]
        starts = [tour[place] for tour, place in zip(tours, rng.integers(0, [len(t) for t in tours]), strict=True)]


@pytest.mark.parametrize("setting", range(len(SETTINGS)))
@pytest.mark.parametrize("name", PROBLEMS)
def test_cycle_by_cycle(name, setting):
    """Pheromone tells which tours were walked: each lays its own amount on its nodes."""
    problem, parameters = PROBLEMS[name], SETTINGS[setting]
    seen = []
    solution = assoc.assign(problem, "aco", seed=setting, mode="paper", iterations=12, watch=seen.append, **parameters)
    packing = prepare(problem, every_tuple="tuples" in parameters).packing
    expected = list(reference(packing, parameters, setting, 12))
    assert solution.iterations == len(expected) == len(seen)
    alone = packing.num_rows if packing.slack.all() else 0
    costs = positive_costs([*packing.weights.tolist(), *[0.0] * alone], **parameters)
    for cycle, (_, pheromone) in enumerate(expected, start=1):
        state = seen[cycle - 1]
        assert state.number == cycle
        np.testing.assert_allclose(state.pheromone, pheromone, rtol=1e-12, atol=0.0)
        np.testing.assert_allclose(state.visibility, 1.0 / costs, rtol=1e-12)
        value = pheromone ** parameters["alpha"] * (1.0 / costs) ** parameters["beta"]
        np.testing.assert_allclose(state.probability, value / value.sum(), rtol=1e-11)
    # the cheapest complete tour is the answer
    tuples = [[j for j in tour if j < packing.num_columns] for tours, _ in expected for tour in tours]
    costs_of = [packing.weights[chosen].sum() for chosen in tuples if is_complete(packing, chosen)]
    if costs_of:
        assert solution.cost - prepare(problem).offset == pytest.approx(min(costs_of), abs=1e-9)


def test_all_tuples_of_the_problem_can_be_nodes():
    problem = assoc.build_problem(simulate("three-radar", 0, scans=1), 0, all_tuples=True)
    best = assoc.assign(problem)
    for tuples, count in (("useful", 17), ("all", problem.num_tuples)):
        history = assoc.solvers.pheromone(problem, mode="paper", tuples=tuples)
        assert len(history.tuples) == count, tuples
        assert history.solution.cost == pytest.approx(best.cost)
        assert history.solution.lower_bound <= best.cost
    assert {*map(tuple, history.tuples.tolist())} == {*map(tuple, problem.tuples.tolist())}
    # the other solvers still see the useful ones alone
    assert prepare(problem).packing.num_columns == 9


def test_it_ends_when_all_ants_walk_the_same_tour():
    """Unless iterations are over before: then it says so."""
    problem = PROBLEMS["mixed"]
    whole = assoc.assign(problem, "aco", mode="paper", alpha=2.0, rho=0.3)
    assert 2 < whole.iterations < 1000 and whole.stopped_by == "converged"
    cut = assoc.assign(problem, "aco", mode="paper", alpha=2.0, rho=0.3, iterations=whole.iterations - 1)
    assert (cut.iterations, cut.stopped_by) == (whole.iterations - 1, "iterations")


def test_the_first_cycle_follows_visibility_alone():
    """So all tours are greedy ones, but for the node on which each starts."""
    problem = PROBLEMS["mixed"]
    packing = prepare(problem).packing
    (tours, _), *_ = reference(packing, SETTINGS[0], 3, 1)
    solution = assoc.assign(problem, "aco", seed=3, mode="paper", iterations=1)
    weights = np.append(packing.weights, np.zeros(packing.num_rows))
    assert solution.cost - prepare(problem).offset == pytest.approx(min(weights[tour].sum() for tour in tours))


def test_reciprocal_visibility_needs_positive_costs():
    costs = np.array([3.0, 2.0, 5.0, 9.0])
    np.testing.assert_array_equal(paper.transformed(costs, "reciprocal", 10.0), costs)
    with pytest.raises(InvalidInputError, match="visibility: 'reciprocal' needs positive costs"):
        assoc.assign(PROBLEMS["ghosts"], "aco", mode="paper", visibility="reciprocal")


def test_what_no_ant_can_complete_is_completed_or_refused():
    # two targets, and each tuple of the first measurement excludes the second
    problem = assoc.AssignmentProblem([[1, 1], [2, 1]], [1.0, 1.0], [2, 2], dummy=False)
    with pytest.raises(InfeasibleError):
        assoc.assign(problem, "aco", mode="paper")


def test_ants_that_do_not_walk_for_want_of_time_end_the_search():
    """A deadline may be early by what another process took of the processor; the time is then not over yet."""

    class Early(Run):
        def deadline(self):
            return time.monotonic() + 0.005

    packing = prepare(PROBLEMS["mixed"]).packing
    # compile first
    paper.solve_as_in_the_paper(packing, AcoParameters(mode="paper", ants=5), Run(0))
    # so many take longer than that
    found = paper.solve_as_in_the_paper(packing, AcoParameters(mode="paper", ants=10_000), Early(0))
    assert found.iterations == 1
