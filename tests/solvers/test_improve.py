"""Common to all metaheuristics: limits, the best covers, and refinement."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import assoc
from assoc.packing import short_branching
from assoc.packing.bounds.dual_ascent import dual_bound
from assoc.packing.branching.search import BranchAndBound
from assoc.packing.component import split_component, split_components
from assoc.packing.cover import Cover
from assoc.packing.prepare import prepare
from assoc.packing.run import Run
from assoc.simulation import simulate
from assoc.solvers.improve import Team, search_components
from assoc.solvers.methods import EXACT_METHODS
from assoc.solvers.search_parameters import SearchParameters
from tests.oracles import gated_problem, milp_optimum
from tests.sizes import sample
from tests.solvers.pieces import component, open_problem, problems, random_covers, search_of, with_greedy_cover

PROBLEM = gated_problem(np.random.default_rng(12), (8, 8, 7), 0.5, "mixed")


class Idle:
    """A searcher that offers nothing."""

    def __init__(self):
        self.count = 0

    def iterate(self, search):
        self.count += 1


@pytest.fixture
def ghosts():
    """A component of 32 measurements that its multipliers do not close, with a greedy cover, and its least weight."""
    problem = assoc.build_problem(simulate("bearing-only", 0, targets=10, scans=1), 0)
    prepared = prepare(problem)
    whole = prepared.packing
    components = split_components(whole, dual_bound(whole), np.arange(whole.num_columns))
    for one in components:
        with_greedy_cover(one)
    rest = sum(one.weight for one in components if one.closed)
    (one,) = (one for one in components if not one.closed)
    return one, milp_optimum(problem) - prepared.offset - rest


def run_idle(**limits):
    """Iterations of a searcher that offers nothing, what ended them, and the weight found."""
    idle = Idle()
    packing = prepare(PROBLEM).packing
    run = Run(0, methods=EXACT_METHODS)
    outcome = search_components(lambda *_: idle, packing, run, SearchParameters(**limits))
    return idle.count, run.stopped_by, float(packing.weights[outcome.columns].sum())


def test_patience_and_iterations_end_the_search():
    assert run_idle(refinement="none", patience=7)[:2] == (7, "")
    assert run_idle(refinement="none", iterations=5)[:2] == (5, "iterations")
    assert run_idle(refinement="none", iterations=30, patience=30)[:2] == (30, "")


def test_the_best_cover_is_refined_by_refinement_full_alone():
    """A searcher that does nothing finds nothing, unless exact sub-steps do."""
    alone = run_idle(refinement="none", patience=2)[2]
    local = run_idle(refinement="local", patience=2)[2]
    full = run_idle(refinement="full", patience=2)[2]
    assert alone - 1.0 > local > full + 1.0


@pytest.mark.parametrize("workers", [1, 2])
def test_branch_and_bound_beside_a_metaheuristic_finds_and_proves(workers, ghosts):
    """With a searcher that does nothing the solution comes from branch and bound, and is proved optimal."""
    one, optimum = ghosts
    assert one.weight > optimum + 0.1 and not one.closed
    with ThreadPoolExecutor(workers) as pool:
        team = Team(lambda *_: Idle(), search_of(one, 0, "full", 0), workers, pool if workers > 1 else None)
        for _ in range(100):
            team.iterate()
    assert one.closed and one.weight == pytest.approx(optimum, abs=1e-9)
    assert optimum - 1e-6 < one.proven <= one.weight


def test_branch_and_bound_beside_is_refinement_full(ghosts):
    one, optimum = ghosts
    team = Team(lambda *_: Idle(), search_of(one, 0, "local", 0), 1, None)
    for _ in range(100):
        team.iterate()
    assert one.weight > optimum + 0.1 and one.proven == -np.inf


def test_what_is_worse_or_incomplete_is_not_kept():
    one = component(problems()["axial"])
    empty = np.full(one.packing.num_rows, -1, dtype=np.int32)
    assert not one.offer(empty, -1e9) and one.best is None
    with_greedy_cover(one)
    best, weight = one.best.copy(), one.weight
    assert not one.offer(best, weight + 1.0)
    assert one.weight == weight


@pytest.mark.parametrize("name", ["mixed", "four"])
def test_how_much_new_covers_are_improved(name):
    """none: not at all; local: halves are re-matched; full: exact sub-steps, too."""
    weights = {}
    for refinement in ("none", "local", "full"):
        one = component(problems()[name])
        search = search_of(one, 0, refinement)
        found = []
        for _ in range(8):
            owner = search.random_cover(1e-3)
            before = one.weight_of(owner)
            after = search.improve(owner)
            assert after == pytest.approx(one.weight_of(owner), abs=1e-9) and after <= before + 1e-9
            assert refinement != "none" or after == before
            found.append((before, after))
        weights[refinement] = np.mean(found, axis=0)
    # the cover itself is improved by insertion unless refinement is none
    assert weights["none"][0] > weights["local"][0] + 1.0
    assert weights["local"][1] > weights["full"][1] + 1e-6


class Lucky:
    """A searcher that offers a given cover, once."""

    def __init__(self, cover, worker):
        self.cover, self.worker = cover, worker
        self.seen, self.draws = [], []

    def iterate(self, search):
        component = search.component
        self.seen.append((component.worker, component.weight, component.iterations, component.stalled))
        self.draws.append(search.run.rng.random())
        if component.worker == self.worker and len(self.seen) == 3:
            component.offer(self.cover, component.weight_of(self.cover))


@pytest.mark.parametrize("lucky", [0, 2])
def test_workers_exchange_their_best(lucky):
    one = with_greedy_cover(component(PROBLEM))
    before = one.weight
    found = min(random_covers(one, 1.0, 40), key=one.weight_of)
    after = one.weight_of(found)
    assert after < before - 1e-6
    members = []

    def make(search):
        members.append(Lucky(found, lucky))
        return members[-1]

    with ThreadPoolExecutor(3) as pool:
        team = Team(make, search_of(one, 4, "none", 10), 3, pool)
        for _ in range(5):
            team.iterate()
            one.iterations += 1
    assert one.weight == pytest.approx(after) and one.best.tolist() == found.tolist()
    assert [worker for member in members for worker, *_ in member.seen] == [0] * 5 + [1] * 5 + [2] * 5
    for member in members:
        # the cover of the third round is everyone's in the fourth
        assert [weight for _, weight, *_ in member.seen] == pytest.approx([before] * 3 + [after] * 2)
        assert [number for _, _, number, _ in member.seen] == [0, 1, 2, 3, 4]
    assert len({draw for member in members for draw in member.draws}) == 15


def test_workers_refine_covers_of_their_own():
    """Covers are refined in place and in parallel: a shared array would be spoiled."""
    one = with_greedy_cover(component(PROBLEM))
    seen = []

    class Keeping(Idle):
        def iterate(self, search):
            seen.append(search.component.best)

    with ThreadPoolExecutor(3) as pool:
        Team(lambda *_: Keeping(), search_of(one, 4, "full", 10), 3, pool).iterate()
    covers = [*seen, one.best]
    for i, first in enumerate(covers):
        assert not any(np.shares_memory(first, other) for other in covers[i + 1 :])


@sample("solver", ["aco", "genetic", "tabu"], every=3)
def test_the_same_seed_and_workers_give_the_same_search(solver):
    """To the last bit, whatever the timing of threads."""
    found = []
    problem = gated_problem(np.random.default_rng(3), (14, 14, 13), 0.3, "mixed")
    for workers in (1, 2, 2, 3):
        solution = assoc.assign(problem, solver, seed=3, workers=workers, refinement="none", iterations=4)
        found.append([(point.iteration, point.cost) for point in solution.trace])
        assert solution.cost == pytest.approx(problem.costs[solution.indices].sum())
    assert found[1] == found[2]
    assert len({str(one) for one in found}) > 1


@pytest.mark.parametrize("solver", ["aco", "genetic", "tabu"])
def test_small_components_are_bounded_before_they_are_searched(solver):
    # any two of these share a measurement: the linear program takes half of each, with the bound 3 for an optimum of 2
    problem = assoc.AssignmentProblem([[1, 1, 0], [1, 0, 1], [0, 1, 1]], [-2.0, -2.0, -2.0], [1, 1, 1])
    solution = assoc.assign(problem, solver)
    assert (solution.cost, solution.status) == (-2.0, "optimal") and solution.lower_bound == pytest.approx(-2.0)
    # the first cover and one iteration: without the proof the search would continue until its patience ends
    assert solution.iterations == 2


def test_what_a_search_beside_ended_with_is_known_to_be_the_best(ghosts):
    """Even if its cover is better by less than the tolerance: no other would ever be found or proved."""
    one, _ = ghosts
    weight = one.weight

    class Ended:
        nodes = 7

        def __init__(self):
            self.columns, self.weight = one.best_columns().astype(np.int32), weight

        @property
        def lower_bound(self):
            return self.weight - one.tolerance

        def run(self, nodes):
            pass

    one.weight = weight + 0.5 * one.tolerance
    branching = short_branching.Branching(one, Run(0), lambda *_, **__: Ended())
    assert branching.advance(10) == 0
    assert one.closed and one.weight == weight


def test_what_is_proved_stays_when_columns_go(ghosts):
    """If the component splits, the best covers of the other parts give the bound of a part."""
    one, optimum = ghosts
    one.proven = one.bound + 0.5 * (optimum - one.bound)
    (smaller,) = split_component(one, share=1.0)
    assert smaller.proven == pytest.approx(one.proven) and smaller.weight == pytest.approx(one.weight)
    best = Cover.of(one.packing, _optimal_columns(one))
    assert one.offer(best.owner, one.weight_of(best.owner))
    several = split_component(one, share=1.0)
    assert len(several) > 1 and sum(part.weight for part in several) == pytest.approx(one.weight)
    for part in several:
        assert one.weight - part.weight + part.proven == pytest.approx(one.proven) and part.proven <= part.weight


def _optimal_columns(one):
    search = BranchAndBound(one.packing, one.duals, one.weight, one.tolerance, to_the_end=True)
    search.run(10_000)
    return search.columns


@pytest.mark.parametrize("solver", ["aco", "genetic", "tabu"])
def test_a_seed_is_not_used_up(solver):
    """The same SeedSequence again, or a generator whose state was set: the same search, with several workers, too."""
    problem = gated_problem(np.random.default_rng(3), (14, 14, 13), 0.3, "mixed")

    def search(seed):
        solution = assoc.assign(problem, solver, seed=seed, workers=2, refinement="none", iterations=3)
        return [(point.iteration, point.cost) for point in solution.trace]

    sequence = np.random.SeedSequence(5)
    assert search(sequence) == search(sequence)
    state = np.random.default_rng(6).bit_generator.state
    found = []
    for _ in range(2):
        generator = np.random.default_rng()
        generator.bit_generator.state = state
        found.append(search(generator))
    assert found[0] == found[1]


def test_weights_that_are_all_alike_have_a_size():
    """At a temperature near 0, pheromone and chance would have no influence."""
    grid = np.stack(np.meshgrid(*[np.arange(1, 5)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    keep = np.random.default_rng(2).random(len(grid)) < 0.3
    one = component(assoc.AssignmentProblem(grid[keep], np.full(keep.sum(), -1e5), [4, 4, 4]))
    assert one.temperature == pytest.approx(0.02 * 1e5)


@pytest.mark.parametrize("solver", ["aco", "genetic", "tabu"])
def test_with_nothing_else_at_work_each_finds_what_greedy_does_not(solver):
    problem = open_problem()
    best, greedy = assoc.assign(problem, "exact").cost, assoc.assign(problem, "greedy").cost
    assert greedy > best + 1.0
    costs = [assoc.assign(problem, solver, seed=seed, refinement="none").cost for seed in range(2)]
    assert min(costs) == pytest.approx(best, abs=1e-6)
