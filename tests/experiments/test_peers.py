"""Peers answer the same problems, feasibly, and the exact ones with the optimum."""

import numpy as np
import pytest

import assoc
from assoc.problem import AssignmentProblem
from experiments.common import contestants
from experiments.common.instances import synthetic
from tests import oracles

EXACT = ["cp_sat", "cp_sat_1", "scip", "scip_1", "highs"]


def problems() -> list[AssignmentProblem]:
    rng = np.random.default_rng(0)
    return [
        oracles.gated_problem(rng, (4, 4, 3), 0.6, "mixed", listed_singletons=0.3),
        oracles.gated_problem(rng, (3, 2, 3, 2), 0.4, "negative", duplicates=0.2),
        oracles.axial_problem(rng, (3, 5, 4), 1.0, "positive"),
        synthetic.planted(3, 0, targets=6)[0],
    ]


@pytest.mark.parametrize("name", EXACT)
def test_exact_peers_find_the_optimum(name: str) -> None:
    for problem in problems():
        best = oracles.brute_force(problem)
        answer = contestants.run(name, problem, 20.0)
        assert answer.proven
        assert answer.cost == pytest.approx(best, abs=2e-5)
        assert answer.bound is not None
        assert best - 1e-3 <= answer.bound <= best + 1e-6
        assert oracles.check_answer(problem, answer.tuples) == answer.cost


def test_one_sensor_at_a_time_is_feasible_and_not_better() -> None:
    found = 0
    for problem in problems():
        answer = contestants.run("sequential", problem, 20.0)
        best = oracles.brute_force(problem)
        assert answer.cost >= best - 1e-9
        assert answer.bound is None or answer.bound <= best + 1e-6
        found += np.isfinite(answer.cost)
    assert found >= 3


@pytest.mark.parametrize("name", ["exact", "tabu", "annealing", "cp_sat_1"])
def test_those_listened_to_tell_what_they_find(name: str) -> None:
    problem, heard = synthetic.axial_random(6, 0), []
    answer = contestants.run(name, problem, 5.0, lambda cost, bound: bool(heard.append((cost, bound))))
    assert min(cost for cost, _ in heard) == pytest.approx(answer.cost) and answer.seconds > 0.0 < answer.cpu
    assert max(bound for _, bound in heard) <= oracles.brute_force(problem) + 1e-6


def test_what_a_solver_says_of_itself_is_not_believed(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = synthetic.axial_random(3, 0)
    found = assoc.assign(problem)
    says = {"cost": found.cost, "indices": found.indices}
    monkeypatch.setitem(
        contestants.LISTENED, "exact", lambda problem, limit, told: (says["indices"], None, True, says["cost"])
    )
    assert contestants.run("exact", problem, 1.0).cost == found.cost
    says["cost"] += 0.1
    with pytest.raises(AssertionError, match="exact: says"):
        contestants.run("exact", problem, 1.0)
    says["indices"] = found.indices[:2]
    with pytest.raises(AssertionError, match="is in 0 chosen tuples"):
        contestants.run("exact", problem, 1.0)


@pytest.mark.parametrize("name", ["chils", "mmwis", "branch_reduce"])
def test_independent_sets_are_associations(name: str) -> None:
    pytest.importorskip("chszlablib")
    rng = np.random.default_rng(5)
    for sizes in ((4, 4, 3), (3, 2, 3, 2), (5, 4)):
        problem = oracles.gated_problem(rng, sizes, 0.6, "mixed", listed_singletons=0.3)
        answer = contestants.run(name, problem, 0.5)
        # a graph of some ten vertices: each of them finds its heaviest set, to the rounding of weights
        assert answer.cost == pytest.approx(oracles.brute_force(problem), abs=1e-4)
