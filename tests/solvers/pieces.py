"""Problems and components on which metaheuristics are compared with plain references, step by step."""

import numpy as np

import assoc
from assoc.packing.bounds.dual_ascent import dual_bound
from assoc.packing.component import split_components
from assoc.packing.local_search import LocalSearch
from assoc.packing.prepare import prepare
from assoc.packing.run import Run
from assoc.simulation import simulate
from assoc.solvers.methods import EXACT_METHODS
from experiments.common.instances.synthetic import axial_random
from tests.oracles import gated_problem


def problems():
    """Problems of several kinds that no bound closes: ghosts, dense ones with ties and signs, an axial one."""
    rng = np.random.default_rng(5)
    return {
        "ghosts": assoc.build_problem(simulate("bearing-only", seed=1, targets=5, scans=1), 0),
        "mixed": gated_problem(rng, (5, 6, 4), 0.4, "mixed"),
        "ties": gated_problem(rng, (6, 5, 5), 0.3, "ties"),
        "four": gated_problem(rng, (4, 4, 4, 3), 0.2, "mixed"),
        "axial": axial_random(5, 3),
    }


def open_problem():
    """Return a problem whose gap no bound closes at once, and which greedy does not solve."""
    return gated_problem(np.random.default_rng(3), (8, 8, 7), 0.3, "mixed")


def component(problem):
    """Return the largest component of a problem, with multipliers that leave its gap open."""
    packing = prepare(problem).packing
    duals = dual_bound(packing)
    # looser multipliers: what is reduced to nothing shows no difference between one choice and another
    duals = np.where(packing.slack, np.minimum(1.02 * duals - 0.05, 0.0), duals - 0.05)
    parts = split_components(packing, duals, np.arange(packing.num_columns))
    return max(parts, key=lambda part: part.packing.num_columns)


def search_of(one, seed=0, refinement="none", clusters=5):
    """Return the local search of a component, with all that `assign` hands in."""
    return LocalSearch(one, Run(seed, methods=EXACT_METHODS), refinement, clusters)


def with_greedy_cover(one):
    """Offer a component its greedy cover, improved by insertion; returns the component."""
    search_of(one, refinement="local").offer_greedy()
    return one


def random_covers(one, strictness, count):
    """Return random covers of a component, not improved, of as many seeds."""
    return [search_of(one, seed).random_cover(strictness) for seed in range(count)]


def rows_of(packing, j):
    """Rows of column j."""
    return [int(r) for r in packing.cols[j] if r >= 0]


def columns_of(owner):
    """Chosen columns of a cover."""
    return sorted({int(j) for j in owner if j >= 0})


def cover_of(packing, columns):
    """Owner of each row."""
    owner = np.full(packing.num_rows, -1, dtype=np.int32)
    for j in columns:
        assert (owner[rows_of(packing, j)] < 0).all()
        owner[rows_of(packing, j)] = j
    return owner


def weight(packing, columns):
    """Weight of a choice of columns, as searches see it: what must be covered is covered at any price."""
    price = 0.0
    if packing.is_axial:
        price = 2.0 * np.abs(packing.weights).max() * packing.cols.shape[1] + 1.0
    duty = [sum(not packing.slack[r] for r in rows_of(packing, j)) for j in columns]
    return float(sum(packing.weights[j] for j in columns) - price * sum(duty))


def temperature(one, best):
    """Scale of the reduced costs that matter, from the least weight known (``inf``: none)."""
    widest = max(0.02 * np.ptp(one.packing.weights), 1e-12)
    if best == np.inf:
        return widest
    return min(max((best - one.bound) / 4.0, 1e-9 * max(1.0, abs(one.bound))), widest)


def is_complete(packing, columns):
    """Whether all rows that must be covered are."""
    return {r for j in columns for r in rows_of(packing, j)} >= set(np.flatnonzero(~packing.slack))


def reference_walk(one, tau, slack_tau, alpha, beta, scale, ants, rng):
    """Covers of all ants, drawn by eq. 8 with eta_j = exp(-2^k rc_j / T); the columns of each."""
    packing = one.packing
    order = list(range(packing.num_rows))
    covers = []
    for ant in range(ants):
        strictness = beta * 2.0 ** (ant % 10) / scale
        power = strictness * one.reduced
        value = np.where(power < 40.0, tau**alpha * np.exp(-power), 0.0)
        stay = np.where(packing.slack, slack_tau**alpha * np.exp(strictness * np.minimum(one.duals, 0.0)), 0.0)
        for i in range(len(order) - 1, 0, -1):
            k = int(rng.integers(0, i + 1))
            order[i], order[k] = order[k], order[i]
        taken, chosen = set(), []
        for r in order:
            if r in taken:
                continue
            allowed = [j for j in range(packing.num_columns) if r in rows_of(packing, j)]
            allowed = [j for j in allowed if not taken & set(rows_of(packing, j))]
            chances = np.array([stay[r], *value[allowed]])
            draw = rng.random()
            if chances.sum() > 0.0:
                place = int(np.searchsorted(np.cumsum(chances / chances.sum()), draw, side="right")) - 1
            else:
                place = 0 if allowed else -1
            if place >= 0:
                chosen.append(allowed[place])
                taken |= set(rows_of(packing, allowed[place]))
        covers.append(sorted(chosen))
    return covers


class Incumbent:
    """What plain references keep: the best complete cover, as sorted columns, and iterations without a better one."""

    def __init__(self, one, parameters, rng):
        self.one, self.p, self.rng = one, parameters, rng
        self.best, self.least, self.stalled = None, np.inf, 0

    def offer(self, columns):
        """Weight of a new cover; the best complete one is kept."""
        cost = self.one.packing.weights[columns].sum()
        if cost < self.least - self.one.tolerance and is_complete(self.one.packing, columns):
            self.best, self.least = sorted(columns), cost
        return cost

    def random_cover(self, strictness):
        """Columns and weight of one ant's cover without pheromone."""
        ones = np.ones(self.one.packing.num_columns), np.ones(self.one.packing.num_rows)
        scale = temperature(self.one, self.least)
        (columns,) = reference_walk(self.one, *ones, 1.0, strictness, scale, 1, self.rng)
        return columns, self.offer(columns)

    def ends_iteration(self, before):
        """Count an iteration that began with this least weight."""
        self.stalled = 0 if self.least < before - self.one.tolerance else self.stalled + 1


def iterate(one, search, local):
    """One iteration of a metaheuristic, counted as the loop around it does; the best columns, None for none."""
    before = one.weight
    search.iterate(local)
    one.iterations += 1
    one.stalled = 0 if one.weight < before - one.tolerance else one.stalled + 1
    return None if one.best is None else columns_of(one.best)
