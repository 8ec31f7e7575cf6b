"""Two lists, which are one large component by nature, beside scipy.

Some candidates each, or all pairs, with costs that are uniform, whole numbers below 1000 or below 10 ("ties"), or
products of the places; and lists with missed detections and false alarms, which scipy's routine gets as a full matching
of twice the size. Its time is that of the routine alone, from a ready matrix, ours that of `assoc.assign`: from tuples;
of all pairs from the same matrix as scipy, but where they are "listed". Processor time of one core, kernels compiled;
lists of each kind are solved once before any are measured. Both must find the same cost; ratios are of the same
problems. Three lists under wide gates are a family of experiments.benchmarks.
"""

import warnings
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.sparse import csr_array
from scipy.sparse.csgraph import min_weight_full_bipartite_matching
from scipy.spatial import cKDTree

import assoc
from experiments.common.claims import Claim
from experiments.common.command import main
from experiments.common.measuring import one_core, processor_time

SEEDS = 6
"""Problems of each kind."""
FIRST_SEED = 7001
"""No problem of these seeds was looked at before it was measured."""
COLUMNS = ("tuples", "exact, s", "slowest, s", "others / exact", "least ratio")


def _exact(problem: assoc.AssignmentProblem | Any) -> tuple[assoc.Solution, float]:
    with warnings.catch_warnings():
        # of a matrix, that it is taken as by scipy
        warnings.simplefilter("ignore", assoc.AssocWarning)
        answer, spent = processor_time(lambda: assoc.assign(problem, advise=False))
    if answer.status != "optimal":
        raise AssertionError(f"not proved: gap {answer.gap:.3g}, stopped by {answer.stopped_by}")
    return answer, spent


def _prices(kind: str, rows: Any, columns: Any, rng: np.random.Generator) -> Any:
    """Costs of pairs of these rows and columns."""
    if kind == "products":
        return (rows + 1.0) * (columns + 1.0)
    return 0.1 + rng.random(len(rows)) if kind == "uniform" else rng.integers(1, int(kind), len(rows)).astype(float)


def candidates(count: int, each: int, kind: str, seed: int) -> tuple[int, float, float]:
    """Two lists with some candidates each: tuples, seconds of exact and of scipy's sparse matching."""
    rng = np.random.default_rng(seed)
    # a permutation among them: there is a full matching
    other = np.concatenate([rng.integers(0, count, (count, each - 1)), rng.permutation(count)[:, None]], axis=1)
    pairs = np.unique(np.stack([np.repeat(np.arange(count), each), other.ravel()], axis=1), axis=0)
    costs = _prices(kind, *pairs.T, rng)
    answer, ours = _exact(assoc.AssignmentProblem(pairs + 1, costs, (count, count), dummy=False))
    matrix = csr_array((costs, pairs.T), shape=(count, count))
    (rows, columns), theirs = processor_time(lambda: min_weight_full_bipartite_matching(matrix))
    _same(answer.cost, float(matrix[rows, columns].sum()))
    return len(pairs), ours, theirs


def all_pairs(
    shape: tuple[int, int],
    kind: str,
    seed: int,
    peer: Callable[[Any], Any] = linear_sum_assignment,
    listed: bool = False,
) -> tuple[int, float, float]:
    """Two lists with all pairs: tuples, seconds of exact and of a peer, scipy's linear_sum_assignment.

    `exact` gets the matrix, too, or tuples that are ready.
    """
    rows, columns = np.indices(shape).reshape(2, -1)
    costs = _prices(kind, rows, columns, np.random.default_rng(seed))
    matrix = costs.reshape(shape)
    pairs = np.stack([rows, columns], axis=1) + 1
    answer, ours = _exact(assoc.AssignmentProblem(pairs, costs, shape, dummy=False) if listed else matrix)
    chosen, theirs = processor_time(lambda: peer(matrix))
    _same(answer.cost, float(matrix[chosen].sum()))
    return matrix.size, ours, theirs


def with_false_alarms(count: int, seed: int) -> tuple[int, float, float]:
    """Two lists of detections of targets in the plane, some missed, some false: tuples, seconds of exact and of scipy.

    scipy matches each detection with its like in the other list or with one of its own, as false alarm, at cost 0.
    """
    rng = np.random.default_rng(seed)
    width, noise = np.sqrt(count), 0.35
    targets = rng.random((count, 2)) * width
    first, second = (
        np.concatenate([seen + noise * rng.normal(size=seen.shape), rng.random((count // 10, 2)) * width])
        for seen in (targets[rng.random(count) < 0.9], targets[rng.random(count) < 0.9])
    )
    near = cKDTree(first).sparse_distance_matrix(cKDTree(second), 3.6 * noise, output_type="coo_matrix")
    left, right, prices = near.row, near.col, near.data**2 / (4.0 * noise**2) - 3.3
    n, m = len(first), len(second)
    rows, columns = np.arange(n), np.arange(m)
    tuples = np.concatenate([
        np.stack([left, right], axis=1) + 1, np.stack([rows + 1, 0 * rows], axis=1),
        np.stack([0 * columns, columns + 1], axis=1),
    ])  # fmt: skip
    answer, ours = _exact(assoc.AssignmentProblem(tuples, np.append(prices, np.zeros(n + m)), (n, m)))
    # scipy takes no costs of 0: all are higher by 10
    costs = 10.0 + np.append(prices, np.zeros(n + m + prices.size))
    places = np.concatenate([left, rows, n + columns, n + right]), np.concatenate([right, m + rows, columns, m + left])
    matrix = csr_array((costs, places), shape=(n + m, n + m))
    chosen, theirs = processor_time(lambda: min_weight_full_bipartite_matching(matrix))
    _same(answer.cost, float((matrix[chosen] - 10.0).sum()))
    return len(tuples), ours, theirs


def _same(ours: float, theirs: float) -> None:
    if abs(ours - theirs) > 1e-9 * max(1.0, abs(theirs)):
        raise AssertionError(f"the costs differ: {ours!r}, scipy {theirs!r}")


COSTS = {"uniform": "uniform", "1000": "whole numbers", "10": "ties"}
KINDS: dict[str, Callable[[int], tuple[int, float, float]]] = {
    **{f"two lists with false alarms, {n}": partial(with_false_alarms, n) for n in (300, 1000, 3000, 10_000)},
    **{f"two lists of {n}, {each} candidates, {name}": partial(candidates, n, each, kind)
       for n, each in ((300, 5), (1000, 5), (3000, 30), (10_000, 10)) for kind, name in COSTS.items()},
    **{f"two lists of {n} and {m}, all pairs, {name}": partial(all_pairs, (n, m), kind)
       for n, m in ((100, 100), (300, 300), (1000, 1000), (1000, 1500)) for kind, name in COSTS.items()},
    **{f"two lists of {n} and {m}, all pairs, products": partial(all_pairs, (n, m), "products")
       for n, m in ((300, 450), (1000, 1000))},
    **{f"two lists of 1000 and 1000, all pairs listed, {name}": partial(all_pairs, (1000, 1000), kind, listed=True)
       for kind, name in COSTS.items()},
}  # fmt: skip


def experiment(quick: bool, rng: np.random.Generator) -> list[Claim]:
    """Solve every kind."""
    claims: list[Claim] = []
    with one_core():
        # compiled on problems that are not measured
        candidates(3000, 10, "uniform", 0), with_false_alarms(3000, 0)
        for shape in ((300, 300), (300, 400)):
            all_pairs(shape, "uniform", 0), all_pairs(shape, "uniform", 0, listed=True)
        for name, solve in KINDS.items():
            if quick and any(number in name for number in ("3000", "10000")):
                continue
            solve(0)
            found = np.array([solve(FIRST_SEED + number) for number in range(1 if quick else SEEDS)])
            tuples, ours, ratio = found[:, 0], found[:, 1], found[:, 2] / found[:, 1]
            values = (np.median(tuples), np.median(ours), ours.max(), np.median(ratio), ratio.min())
            claims += [
                # no slower than scipy
                Claim(f"{name}: {what}", "", None, float(value), band=(1.0, None) if what in COLUMNS[3:] else None,
                      source="chosen by us")
                for what, value in zip(COLUMNS, values, strict=True)
            ]  # fmt: skip
            print(f"{name}: {', '.join(f'{value:.3g}' for value in values)}", flush=True)
    return claims


if __name__ == "__main__":
    raise SystemExit(main("large_components", experiment, __doc__))
