import math

import pytest

from assoc.association import associate
from assoc.association.plan import Plan
from assoc.costs import build_problem
from assoc.simulation import simulate
from assoc.solvers.assign import assign

GATES = (0.7, 0.9, 0.999)


@pytest.mark.parametrize("probability", GATES)
def test_loss_is_the_distance_to_the_optimum_without_gates(probability):
    """Against a MILP of all tuples, of scenes whose narrow gates turn true tuples away."""
    scene = simulate("crowd", 3, targets=15, scans=4)
    found = associate(scene, gating={"gate_probability": probability}, gate_loss=True)
    for scan in found.scans:
        free = assign(build_problem(scene, scan.scan, gate_probability=1.0), "milp")
        assert scan.gate_loss == pytest.approx(scan.solution.cost - free.cost, abs=1e-6)
        assert scan.gate_loss >= scan.solution.cost - free.cost - 1e-9
    assert found.totals()["gate_loss"] == pytest.approx(sum(scan.gate_loss for scan in found.scans))


def test_narrow_gates_cost_more():
    scene = simulate("crowd", 3, targets=15, scans=4)
    loss = [associate(scene, gating={"gate_probability": one}, gate_loss=True).totals()["gate_loss"] for one in GATES]
    assert loss[0] > loss[1] > loss[2] >= 0.0


def test_no_gates_cost_nothing_and_nobody_asked():
    scene = simulate("three-radar", scans=2)
    free = associate(scene, gating={"gate_probability": 1.0}, gate_loss=True)
    assert free.totals()["gate_loss"] == pytest.approx(0.0, abs=1e-6)
    plain = associate(scene)
    assert plain.scans[0].gate_loss is None and "gate_loss" not in plain.to_dict()["totals"]
    assert "gate" not in plain.summary()


def test_too_many_tuples_without_gates_are_said():
    scene = simulate("crowd", 3, targets=15, scans=1)
    some, every = (build_problem(scene, 0, gate_probability=one).num_tuples for one in (0.9, 1.0))
    assert some < every
    result = associate(scene, gating={"gate_probability": 0.9, "max_tuples": some}, gate_loss=True)
    assert math.isinf(result.scans[0].gate_loss)
    assert result.to_dict()["scans"][0]["gate_loss"] is None
    assert "gating loss: unknown" in result.summary()


def test_bound_of_a_solver_that_is_not_exact_holds():
    scene = simulate("bearing-only", 2, scans=2, targets=6)
    for scan in associate(scene, "greedy", gate_loss=True).scans:
        free = assign(build_problem(scene, scan.scan, gate_probability=1.0), "milp")
        assert scan.gate_loss >= scan.solution.cost - free.cost - 1e-9


def test_each_ranked_association_has_its_own_loss():
    scene = simulate("crowd", 3, targets=8, scans=1)
    plan = Plan((scene,), "exact", gating={"gate_probability": 0.9}, kbest=3, gate_loss=True)
    best = plan((0, 0))
    free = assign(build_problem(scene, 0, gate_probability=1.0), "milp").cost
    assert best.gate_loss == best.ranked[0].gate_loss and len(best.ranked) == 3
    for one in best.ranked:
        assert one.gate_loss == pytest.approx(one.solution.cost - free, abs=1e-6)
