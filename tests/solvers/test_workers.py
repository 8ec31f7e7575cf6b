"""Workers with everything switched on: dives, exact sub-steps, and branch and bound."""

import assoc
from assoc.simulation import simulate
from tests.sizes import sample


@sample("solver", ["aco", "genetic", "tabu"], every=3)
def test_the_same_seed_and_workers_give_the_same_search(solver):
    """To the last bit, whatever the timing of threads."""
    problem = assoc.build_problem(simulate("bearing-only", seed=12, targets=24, scans=1), 0)
    found = []
    for _ in range(2):
        solution = assoc.assign(problem, solver, seed=3, workers=2, iterations=3)
        found.append(([(point.iteration, point.cost) for point in solution.trace], solution.indices.tolist()))
    assert found[0] == found[1] and len(found[0][0]) > 1
