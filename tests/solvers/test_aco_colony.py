"""Mode mmas against a plain max-min ant system, cycle by cycle, same random numbers; pheromone by tuple."""

import numpy as np
import pytest

import assoc
from assoc._system.compiled import draws
from assoc.packing.local_search import LocalSearch
from assoc.packing.neighbourhoods.insertion import search_arrays
from assoc.packing.neighbourhoods.random_cover import Trail, walk
from assoc.packing.prepare import prepare
from assoc.packing.run import Run
from assoc.solvers.aco.colony import Colony, cycle_of
from assoc.solvers.aco.parameters import AcoParameters
from tests.solvers.pieces import (
    columns_of,
    component,
    is_complete,
    iterate,
    open_problem,
    problems,
    random_covers,
    reference_walk,
    search_of,
    temperature,
    weight,
    with_greedy_cover,
)

PROBLEMS = problems()
RENEWAL = 15


@pytest.mark.parametrize("alpha, beta", [(1.0, 1.0), (2.0, 0.5), (0.0, 3.0), (1.5, 0.0)])
@pytest.mark.parametrize("name", PROBLEMS)
def test_walks(name, alpha, beta):
    """The best of 12 ants, on a trail of random pheromone."""
    one = component(PROBLEMS[name])
    rng = np.random.default_rng(3)
    for seed in range(3):
        tau, slack_tau = rng.uniform(0.1, 1.0, one.packing.num_columns), rng.uniform(0.1, 1.0, one.packing.num_rows)
        scale = temperature(one, np.inf) * (0.3, 1.0, 10.0)[seed]
        trail = Trail(tau, slack_tau, alpha, beta, scale)
        owner, least = walk(
            search_arrays(one.packing), one.costs, trail, 12, False, draws(np.random.default_rng(seed)), np.inf
        )
        covers = reference_walk(one, tau, slack_tau, alpha, beta, scale, 12, np.random.default_rng(seed))
        best = min(covers, key=lambda columns: weight(one.packing, columns))
        assert columns_of(owner) == best
        assert least == pytest.approx(weight(one.packing, best), rel=1e-12)


def reference_colony(one, parameters, cycles, rng):
    """A max-min ant system without any local search; yields both pheromones and the best columns after each cycle."""
    packing, p = one.packing, parameters
    lowest = 1.0 / (2.0 * max(np.count_nonzero(packing.cols >= 0) / packing.num_rows, 1.0))
    tau, slack_tau = np.ones(packing.num_columns), np.ones(packing.num_rows)
    best, least = None, np.inf
    recent, recent_least = None, np.inf
    stalled = 0
    for cycle in range(cycles):
        covers = reference_walk(one, tau, slack_tau, p.alpha, p.beta, temperature(one, least), p.ants, rng)
        columns = min(covers, key=lambda found: weight(packing, found))
        cost = packing.weights[columns].sum()
        better = is_complete(packing, columns) and cost < least - one.tolerance
        if better:
            best, least = columns, cost
        if is_complete(packing, columns) and cost < recent_least:
            recent, recent_least = columns, cost
        elite = recent if recent is not None and cycle % 3 == 2 else columns
        tau, slack_tau = p.rho * tau, p.rho * slack_tau
        tau[elite] += 1.0 - p.rho
        covered = packing.cols[elite]
        slack_tau[np.setdiff1d(np.arange(packing.num_rows), covered[covered >= 0])] += 1.0 - p.rho
        tau, slack_tau = np.maximum(tau, lowest), np.maximum(slack_tau, lowest)
        if stalled and stalled % RENEWAL == 0:
            tau, slack_tau = np.ones_like(tau), np.ones_like(slack_tau)
            recent, recent_least = None, np.inf
        stalled = 0 if better else stalled + 1
        yield tau, slack_tau, best


@pytest.mark.parametrize("name, rho", [*((name, 0.8) for name in PROBLEMS), ("mixed", 0.3)])
def test_cycle_by_cycle(name, rho):
    one = component(PROBLEMS[name])
    parameters = AcoParameters(ants=6, alpha=1.5, beta=0.7, rho=rho, refinement="none")
    told = []
    colony = Colony(one, parameters, lambda who, state: told.append((who, state)))
    search = search_of(one, 7)
    renewed = 0
    expected = reference_colony(one, parameters, 40, np.random.default_rng(7))
    for tau, slack_tau, best in expected:
        assert iterate(one, colony, search) == best
        np.testing.assert_allclose(colony.pheromone, tau, rtol=1e-12)
        np.testing.assert_allclose(colony.slack_pheromone, slack_tau, rtol=1e-12)
        renewed += bool((tau == 1.0).all())
    assert told == [(one, colony)] * 40
    assert renewed, "the renewal was not seen"
    assert colony.pheromone.max() <= 1.0


def test_a_colony_starts_from_the_best_known():
    one = with_greedy_cover(component(PROBLEMS["mixed"]))
    colony = Colony(one, AcoParameters(rho=0.6), lambda *_: None)
    chosen = np.isin(np.arange(one.packing.num_columns), columns_of(one.best))
    np.testing.assert_allclose(colony.pheromone[chosen], 1.0)
    np.testing.assert_allclose(colony.pheromone[~chosen], max(0.6, colony.lowest))


def test_each_cycle_is_watched():
    seen = []
    assoc.assign(open_problem(), "aco", refinement="none", iterations=40, watch=seen.append)
    assert [state.number for state in seen] == list(range(1, 41))


def test_probability_of_a_cycle():
    """What `Cycle` says, counted: the share of first draws of the first ant."""
    seen = []
    problem = open_problem()
    assoc.assign(problem, "aco", alpha=1.3, beta=0.8, iterations=3, refinement="none", watch=seen.append)
    state = seen[-1]
    n = state.columns.size
    packing = assoc.packing.prepare.prepare(problem).packing
    rows = packing.cols[state.columns]
    value = state.pheromone**1.3 * state.visibility**0.8
    for node in range(len(value)):
        own = rows[node][rows[node] >= 0] if node < n else state.rows[[node - n]]
        shares = []
        for r in own:
            rivals = np.concatenate([(rows == r).any(axis=1), state.rows == r])
            shares.append(value[node] / value[rivals].sum())
        assert state.probability[node] == pytest.approx(np.mean(shares), rel=1e-9)


def test_a_colony_learns_what_others_found():
    """A better cover from elsewhere is what every third cycle lays pheromone for."""
    one = with_greedy_cover(component(open_problem()))
    colony = Colony(one, AcoParameters(ants=1, beta=0.0, rho=0.5, refinement="none"), lambda *_: None)
    found = min(random_covers(one, 4.0, 60), key=one.weight_of)
    assert one.offer(found, one.weight_of(found))
    one.iterations = 2
    colony.iterate(search_of(one))
    chosen = np.isin(np.arange(one.packing.num_columns), columns_of(found))
    assert (colony.pheromone[chosen] >= 0.5 + 0.5 * colony.lowest - 1e-12).all()
    assert colony.least == one.weight


def test_visibility_of_a_cycle():
    """What choosing a column, or leaving a row alone, adds to the bound."""
    problem = open_problem()
    one = with_greedy_cover(component(problem))
    state = cycle_of(prepare(problem).packing, one, Colony(one, AcoParameters(), lambda *_: None))
    scale = temperature(one, one.weight)
    np.testing.assert_allclose(state.visibility[: state.columns.size], np.exp(-one.reduced / scale), rtol=1e-12)
    alone = np.exp(one.duals[one.packing.slack] / scale)
    np.testing.assert_allclose(state.visibility[state.columns.size :], alone, rtol=1e-12)


@pytest.fixture
def diving():
    """Dives that return one cover, the best of many, and what they were given; there are so many until time is over."""
    trails, left = [], [0]

    class Diving(LocalSearch):
        escapes = property(lambda self: left[0] > 0)

        def escape(self, number, trail, beta):
            trails.append(trail.copy())
            left[0] -= 1
            return best.copy()

    one = component(open_problem())
    best = min(random_covers(one, 4.0, 60), key=one.weight_of)
    return Diving(one, Run(0), "none"), best, trails, left


def test_divers_draw_by_the_pheromone_and_the_best_of_them_lays_it(diving):
    search, best, trails, left = diving
    one, left[0] = search.component, 1
    parameters = AcoParameters(ants=1, divers=1, alpha=1.7, beta=0.0, rho=0.5, refinement="none")
    colony = Colony(one, parameters, lambda *_: None)
    before = np.random.default_rng(2).uniform(0.2, 1.0, one.packing.num_columns)
    colony.pheromone[:] = before
    colony.iterate(search)
    (trail,) = trails
    np.testing.assert_allclose(trail, before**1.7, rtol=1e-12)
    chosen = np.isin(np.arange(one.packing.num_columns), columns_of(best))
    np.testing.assert_allclose(colony.pheromone, np.maximum(0.5 * before + 0.5 * chosen, colony.lowest), rtol=1e-12)


def test_divers_end_when_time_is_over(diving):
    search, _, trails, left = diving
    left[0] = 3
    colony = Colony(search.component, AcoParameters(ants=1, divers=100_000, refinement="none"), lambda *_: None)
    colony.iterate(search)
    assert len(trails) == 3
