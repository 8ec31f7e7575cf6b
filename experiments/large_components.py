"""Problems that are one large component: three lists under wide gates beside HiGHS, two lists beside scipy.

Three lists: points in the plane with a gate that joins nearly all tuples (`wide_gates`), to proven optima. HiGHS runs
through `scipy.optimize.milp` with a relative gap of 1e-9; both get the same problem, and must find the same cost. Two
lists: ten candidates each, or all pairs; scipy's time is that of its routine alone, ours that of `assoc.assign`.
Processor time of one core, kernels compiled; ratios are of the same problems.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.sparse import csr_array
from scipy.sparse.csgraph import min_weight_full_bipartite_matching

import assoc
from experiments.common.claims import Claim
from experiments.common.command import main
from experiments.common.instances.synthetic import wide_gates
from experiments.common.measuring import one_core, processor_time
from experiments.common.peers import by_milp

GATES = {1000: True, 2000: True, 3000: True, 10_000: False}
"""Targets -> whether HiGHS runs, too: at 10,000 it takes minutes."""
SEEDS, FEW = 6, 3
"""Problems of each kind; of 10,000 targets."""
FIRST_SEED = 7001
"""No problem of these seeds was looked at before it was measured."""
COLUMNS = ("tuples", "exact, s", "slowest, s", "others / exact", "least ratio")
MOST_SECONDS = 60.0
"""What a problem of 10,000 targets may take: chosen by us, as are all bands."""
BANDS: dict[str, dict[str, tuple[float | None, float | None]]] = {
    "wide gates": {"others / exact": (5.0, None), "least ratio": (3.0, None), "slowest, s": (None, MOST_SECONDS)},
    "two lists": {"others / exact": (1.0, None), "least ratio": (1.0, None)},
}


def _exact(problem: assoc.AssignmentProblem) -> tuple[assoc.Solution, float]:
    answer, spent = processor_time(lambda: assoc.assign(problem, advise=False))
    if answer.status != "optimal":
        raise AssertionError(f"not proved: gap {answer.gap:.3g}, stopped by {answer.stopped_by}")
    return answer, spent


def gates(targets: int, seed: int, beside: bool) -> tuple[int, float, float]:
    """Tuples, seconds of exact, and those of HiGHS (nan: not run)."""
    problem = wide_gates(targets, seed)
    answer, ours = _exact(problem)
    if not beside:
        return problem.num_tuples, ours, np.nan
    other, theirs = processor_time(lambda: by_milp(problem, np.inf))
    if not other.success or abs(other.fun - answer.cost) > 1e-6 * abs(answer.cost):
        raise AssertionError(f"{targets} targets, seed {seed}: {answer.cost!r}, HiGHS {other.fun!r}: {other.message}")
    return problem.num_tuples, ours, theirs


def candidates(count: int, seed: int) -> tuple[int, float, float]:
    """Two lists with ten candidates each: tuples, seconds of exact and of scipy's sparse matching."""
    rng = np.random.default_rng(seed)
    # a permutation among them: there is a full matching
    other = np.concatenate([rng.integers(0, count, (count, 9)), rng.permutation(count)[:, None]], axis=1)
    pairs = np.unique(np.stack([np.repeat(np.arange(count), 10), other.ravel()], axis=1), axis=0)
    costs = 0.1 + rng.random(len(pairs))
    answer, ours = _exact(assoc.AssignmentProblem(pairs + 1, costs, (count, count), dummy=False))
    matrix = csr_array((costs, pairs.T), shape=(count, count))
    (rows, columns), theirs = processor_time(lambda: min_weight_full_bipartite_matching(matrix))
    _same(answer.cost, float(matrix[rows, columns].sum()))
    return len(pairs), ours, theirs


def dense(
    kind: str, seed: int, count: int = 1000, peer: Callable[[Any], Any] = linear_sum_assignment
) -> tuple[int, float, float]:
    """Two lists with all pairs: tuples, seconds of exact and of a peer, scipy's linear_sum_assignment."""
    numbers = np.arange(1.0, count + 1.0)
    matrix = np.random.default_rng(seed).random((count, count)) if kind == "uniform" else np.outer(numbers, numbers)
    answer, ours = _exact(assoc.AssignmentProblem.from_dense(matrix, dummy=False))
    chosen, theirs = processor_time(lambda: peer(matrix))
    _same(answer.cost, float(matrix[chosen].sum()))
    return matrix.size, ours, theirs


def _same(ours: float, theirs: float) -> None:
    if abs(ours - theirs) > 1e-9 * max(1.0, abs(theirs)):
        raise AssertionError(f"the costs differ: {ours!r}, scipy {theirs!r}")


KINDS: dict[str, Callable[[int], tuple[int, float, float]]] = {
    **{f"wide gates, {n}": partial(lambda seed, n, beside: gates(n, seed, beside), n=n, beside=beside)
       for n, beside in GATES.items()},
    "two lists of 10000, ten candidates": lambda seed: candidates(10_000, seed),
    "two lists of 1000, all pairs": lambda seed: dense("uniform", seed),
    "two lists of 1000, costs i j": lambda seed: dense("product", seed),
}  # fmt: skip


def experiment(quick: bool, rng: np.random.Generator) -> list[Claim]:
    """Solve every kind."""
    claims: list[Claim] = []
    with one_core():
        # compiled on problems that are not measured
        for seed in range(3):
            gates(1500, seed, False)
        gates(100, 0, True), candidates(3000, 0), dense("uniform", 0, 300)
        for name, solve in KINDS.items():
            if quick and name.endswith(("3000", "10000")):
                continue
            seeds = 1 if quick else FEW if name == "wide gates, 10000" else SEEDS
            found = np.array([solve(FIRST_SEED + number) for number in range(seeds)])
            tuples, ours, ratio = found[:, 0], found[:, 1], found[:, 2] / found[:, 1]
            values = (np.median(tuples), np.median(ours), ours.max(), np.median(ratio), ratio.min())
            bands = next(bands for kind, bands in BANDS.items() if name.startswith(kind))
            claims += [
                Claim(f"{name}: {what}", "", None, float(value), band=bands.get(what), source="chosen by us")
                for what, value in zip(COLUMNS, values, strict=True)
                if np.isfinite(value)
            ]
            print(f"{name}: {', '.join(f'{value:.3g}' for value in values)}", flush=True)
    return claims


if __name__ == "__main__":
    raise SystemExit(main("large_components", experiment, __doc__))
