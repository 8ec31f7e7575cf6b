"""motile's problems by our solvers: the same cost and the same tracks as by its own."""

import numpy as np
import pytest

from assoc.errors import InvalidInputError

pytest.importorskip("motile", reason="motile is not installed: pip install 'assoc[motile]'")

import motile
import networkx
from motile import constraints, costs

from assoc.integrations.motile import problem_of, solve, values_of
from assoc.ranking.kbest import kbest


def tracking(seed, children=1, appear=True, points=12, frames=4):
    """Points that move at random, some of them missed and some false, as a problem of motile."""
    rng = np.random.default_rng(seed)
    graph, before = networkx.DiGraph(), []
    places = rng.uniform(0, 40, (points, 2))
    for t in range(frames):
        places = places + rng.normal(0, 2, places.shape)
        found = np.concatenate([places[rng.random(points) < 0.8], rng.uniform(0, 40, (3, 2))])
        now = [(len(graph) + i, place) for i, place in enumerate(found)]
        for node, (x, y) in now:
            graph.add_node(node, t=t, x=x, y=y, score=rng.uniform())
        near = [(u, v) for u, a in before for v, b in now if np.hypot(*(a - b)) < 9]
        graph.add_edges_from(near)
        before = now
    solver = motile.Solver(motile.TrackGraph(graph))
    solver.add_constraint(constraints.MaxParents(1))
    solver.add_constraint(constraints.MaxChildren(children))
    solver.add_cost(costs.NodeSelectedCost(weight=-3.0, attribute="score", constant=0.5))
    solver.add_cost(costs.EdgeDistanceCost(("x", "y"), weight=1.0, constant=-4.0))
    if appear:
        solver.add_cost(costs.NodeAppearCost(constant=1.0))
        solver.add_cost(costs.NodeDisappearCost(constant=0.5))
    return solver


@pytest.mark.parametrize("appear", [True, False])
def test_the_same_tracks_as_by_its_own_solver(appear):
    for seed in range(4):
        solver = tracking(seed, appear=appear)
        theirs = solver.solve()
        tracks = set(solver.get_selected_subgraph().edges)
        ours = solve(solver)
        assert ours.get_status() == theirs.get_status() == "OPTIMAL"
        assert ours.get_value() == pytest.approx(theirs.get_value(), abs=1e-4)
        np.testing.assert_allclose(np.round(theirs), ours.variable_values)
        assert set(solver.get_selected_subgraph().edges) == tracks and 0 < len(tracks)
        assert ours.get_value() == pytest.approx(float(np.dot(ours.variable_values, solver.costs)), abs=1e-4)
        assert ours.native_status.lower_bound == pytest.approx(ours.get_value(), abs=1e-6)


def test_any_solver_and_its_bound():
    solver = tracking(1)
    best = problem_of(solver), solve(solver).get_value()
    greedy = solve(solver, "greedy", time_limit=10.0)
    assert greedy.get_value() >= best[1] - 1e-9 >= greedy.native_status.lower_bound - 1e-6
    second = kbest(best[0], 2)[1]
    values = values_of(solver, second)
    assert best[1] < second.cost == pytest.approx(float(values @ solver.costs), abs=1e-4)
    assert best[0].num_sensors == 2 and best[0].sizes.tolist() == [len(solver.graph.nodes)] * 2


def test_tracks_that_split_or_are_constrained_otherwise_are_refused():
    with pytest.raises(InvalidInputError, match=r"the constraint MaxChildren\(1\): node \d+ may split"):
        solve(tracking(0, children=2))
    solver = tracking(0)
    chosen = [edge[0] for edge in np.array(list(solve(solver) and solver.get_selected_subgraph().edges))[:2]]
    solver.add_constraint(constraints.ExclusiveNodes([[int(node) for node in chosen]]))
    with pytest.raises(InvalidInputError, match="solve it with motile's own solver"):
        solve(solver)
