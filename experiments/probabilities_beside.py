"""Probabilities of tuples beside other ways to them, against exact sums.

The same problems for all, small enough that ``assoc.marginals`` closes every interval: its middle is the truth. *Ours*
is ``assoc.marginals`` with defaults. *Plain MCMC*: Metropolis moves that add, remove or replace one tuple or let two
measurements of a sensor change places, drawn uniformly (after Oh, Russell and Sastry, 2009, for one scan), ten million
moves from the best solution, the first fifth forgotten. *10,000 best*: shares in their own weight. *Loopy
belief propagation*: that of Stone Soup's JPDA (Williams and Lau, 2014), for two lists. Tuples of two measurements and
more; processor time of one core, kernels compiled.
"""

from argparse import Namespace
from collections.abc import Callable
from functools import partial

import numpy as np

import assoc
from assoc._system.compiled import inner_njit, njit
from assoc._types import Array, Floats, Ints
from assoc.packing.run import Run
from assoc.problem import AssignmentProblem
from assoc.ranking.columns import price_all_columns
from assoc.simulation import simulate
from experiments.common.claims import Claim
from experiments.common.command import main
from experiments.common.instances import scenes
from experiments.common.measuring import one_core, timed
from experiments.probabilities import two_lists

NAME = "probabilities_beside"
_MOVES = 10_000_000
_BEST = 10_000

KINDS: dict[str, Callable[[int], AssignmentProblem]] = {
    "two lists of 12": lambda seed: two_lists(12, seed),
    "crowd 3 x 100": lambda seed: assoc.build_problem(simulate("crowd", seed, targets=100, scans=1), 0),
    "gated 4 x 60": lambda seed: assoc.build_problem(scenes.gated(4, 60, seed), 0),
}


@inner_njit
def _put(cols: Ints, owner: Ints, j: int, value: int) -> None:
    for r in cols[j]:
        if r >= 0:
            owner[r] = value


@inner_njit
def _exchanged(cols: Ints, row_ptr: Ints, row_cols: Ints, j: int, s: int, r: int) -> int:
    """Number of the tuple that has measurement r of sensor s, else those of tuple j; -1: there is none."""
    for x in range(row_ptr[r], row_ptr[r + 1]):
        same = True
        for t in range(cols.shape[1]):
            same = same and (t == s or cols[row_cols[x], t] == cols[j, t])
        if same:
            return int(row_cols[x])
    return -1


@njit
def _walked(
    cols: Ints, gain: Floats, row_ptr: Ints, row_cols: Ints, first_row: Ints, owner: Ints, rng: np.random.Generator
) -> Floats:
    """Share of the moves, after the first fifth, for which each tuple is chosen; ``gain``: logarithms of weights."""
    num, num_sensors = gain.size, cols.shape[1]
    since, spent = np.zeros(num), np.zeros(num)
    old, new = np.empty(num_sensors, np.int64), np.empty(2, np.int64)
    for move in range(_MOVES):
        if move == _MOVES // 5:
            spent[:], since[:] = 0.0, move
        num_old = num_new = 0
        if rng.random() < 0.5:
            # add, remove or replace
            j = rng.integers(0, num)
            for r in cols[j]:
                if r >= 0 and owner[r] >= 0 and (num_old == 0 or owner[r] != old[num_old - 1]):
                    old[num_old] = owner[r]
                    num_old += 1
            if num_old > 1:
                continue
            if num_old == 0 or old[0] != j:
                new[0], num_new = j, 1
        else:
            # two measurements of a sensor change places
            s = rng.integers(0, num_sensors)
            row, other = rng.integers(first_row[s], first_row[s + 1]), rng.integers(first_row[s], first_row[s + 1])
            possible = row != other
            for r, to in ((row, other), (other, row)):
                if possible and owner[r] >= 0:
                    old[num_old] = owner[r]
                    num_old += 1
                    new[num_new] = _exchanged(cols, row_ptr, row_cols, owner[r], s, to)
                    possible = new[num_new] >= 0
                    num_new += 1
            if not possible:
                continue
        change = 0.0
        for i in range(num_new):
            change += gain[new[i]]
        for i in range(num_old):
            change -= gain[old[i]]
        if rng.random() >= np.exp(min(change, 0.0)):
            continue
        for i in range(num_old):
            _put(cols, owner, old[i], -1)
            spent[old[i]] += move - since[old[i]]
        for i in range(num_new):
            _put(cols, owner, new[i], new[i])
            since[new[i]] = move
    for r in range(owner.size):
        if owner[r] >= 0:
            # once for each measurement, which is why the start moves along
            spent[owner[r]] += _MOVES - since[owner[r]]
            since[owner[r]] = _MOVES
    return spent / (_MOVES - _MOVES // 5)


def plain_mcmc(problem: AssignmentProblem, seed: int) -> dict[tuple[int, ...], float]:
    """Frequencies of tuples in a Markov chain with uniform proposals, from the best solution."""
    columns = price_all_columns(problem, Run(0))
    keys = [tuple(row) for row in problem.tuples[columns.origin].tolist()]
    number = {key: j for j, key in enumerate(keys)}
    cols = columns.rows.astype(np.int64)
    owner = np.full(columns.slack.size, -1)
    for key in map(tuple, assoc.assign(problem).tuples.tolist()):
        if key in number:
            own = cols[number[key]]
            owner[own[own >= 0]] = number[key]
    column, sensor = np.nonzero(cols >= 0)
    row = cols[column, sensor]
    ptr = np.append(0, np.cumsum(np.bincount(row, minlength=owner.size)))
    order = np.argsort(row, kind="stable")
    first_row = np.append(0, np.cumsum(problem.sizes)).astype(np.int64)
    rng = np.random.default_rng(seed)
    share = _walked(cols, -columns.weights, ptr, column[order], first_row, owner, rng)
    return dict(zip(keys, share.tolist(), strict=True))


def best_alone(problem: AssignmentProblem, seed: int) -> dict[tuple[int, ...], float]:
    """Shares of tuples in the weight of the best solutions."""
    solutions = assoc.kbest(problem, _BEST)
    weights = np.exp(solutions[0].cost - np.array([solution.cost for solution in solutions]))
    held: dict[tuple[int, ...], float] = {}
    for solution, weight in zip(solutions, weights / weights.sum(), strict=True):
        for key in map(tuple, solution.tuples.tolist()):
            held[key] = held.get(key, 0.0) + weight
    return held


def loopy(problem: AssignmentProblem, seed: int) -> dict[tuple[int, ...], float]:
    """Stone Soup's loopy belief propagation on the likelihoods of two lists relative to false alarms."""
    from stonesoup.dataassociator.probability import JPDAwithLBP

    n, m = problem.sizes.tolist()
    likelihood = np.zeros((n, m + 1))
    likelihood[:, 0] = 1.0
    pairs = (problem.tuples > 0).all(axis=1)
    i, j = problem.tuples[pairs].T
    likelihood[i - 1, j] = np.exp(-problem.costs[pairs])
    # its test of convergence, made after each pass, may never be met; after a thousand it is
    found = JPDAwithLBP._loopy_belief_propagation(likelihood, 1_000, 1e-3)
    return {(a, b): float(found[a - 1, b]) for a, b in zip(i.tolist(), j.tolist(), strict=True)}


def ours(problem: AssignmentProblem, seed: int) -> dict[tuple[int, ...], float]:
    """What ``assoc.marginals`` says."""
    found = assoc.marginals(problem)
    return dict(zip(map(tuple, found.tuples.tolist()), found.probability.tolist(), strict=True))


_LOOPY = "loopy belief propagation"
WAYS: dict[str, Callable[[AssignmentProblem, int], dict[tuple[int, ...], float]]] = {
    "ours": ours,
    "plain MCMC": plain_mcmc,
    "10,000 best": best_alone,
    _LOOPY: loopy,
}


def compared(name: str, seeds: range) -> list[Claim]:
    """Errors, widths and times of all ways on the problems of one kind whose exact sums are known."""
    found: dict[str, list[tuple[Array, float]]] = {}
    widths, exact = [], 0
    for seed in seeds:
        problem = KINDS[name](seed)
        truth = assoc.marginals(problem, method="certified")
        if truth.unseen > 1e-6:
            continue
        exact += 1
        several = np.count_nonzero(truth.tuples, axis=1) > 1
        keys = [tuple(row) for row in truth.tuples[several].tolist()]
        for way, call in WAYS.items():
            if way == _LOOPY and len(problem.sizes) > 2:
                continue
            answer, seconds = timed(partial(call, problem, seed))
            error = np.abs(np.array([answer.get(key, 0.0) for key in keys]) - truth.probability[several])
            found.setdefault(way, []).append((error, seconds))
        widths.append(float((truth.upper - truth.lower)[several].mean()))
    claims = [Claim(f"{name}: problems summed exactly", "", None, exact)]
    for way, results in found.items():
        errors = np.concatenate([error for error, _ in results])
        claims += [
            Claim(f"{name}, {way}: mean error", "", None, float(errors.mean())),
            Claim(f"{name}, {way}: largest error", "", None, float(errors.max())),
            Claim(f"{name}, {way}: seconds", "s", None, float(np.mean([seconds for _, seconds in results]))),
        ]
    return claims + ([Claim(f"{name}, ours: mean width", "", None, float(np.mean(widths)))] if exact else [])


def experiment(chosen: Namespace) -> list[Claim]:
    """Compare on these kinds."""
    with one_core():
        # kernels are compiled before anything is timed
        for name in ("two lists of 12", "gated 4 x 60"):
            plain_mcmc(KINDS[name](0), 0)
            assoc.marginals(KINDS[name](0))
        seeds = range(2_000, 2_001 if chosen.quick else 2_005)
        return [claim for name in chosen.names for claim in compared(name, seeds)]


if __name__ == "__main__":
    raise SystemExit(main(NAME, experiment, __doc__, only=KINDS))
