"""What the tests compare against: exhaustive search, scipy's MILP, and generators of small problems.

Nothing here uses a solver of the package. Exhaustive search is written over bit masks of measurements
(tests/reliability/exact.py), so that "each measurement in exactly one tuple" is one integer comparison.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from assoc.errors import InfeasibleError
from assoc.problem import AssignmentProblem
from experiments.common.checking import check_answer
from experiments.common.peers import by_milp
from tests.reliability.exact import coverings, exact_optimum, masks, unit_of


@dataclass(frozen=True)
class Ranked:
    """One solution of an enumeration: its cost and its tuples in lexicographic order."""

    cost: float
    tuples: tuple[tuple[int, ...], ...]


def all_solutions(problem: AssignmentProblem, limit: int = 300_000) -> list[Ranked]:
    """Every solution, cheapest first (ties in lexicographic order of their tuples).

    Raises
    ------
    MemoryError
        There are more than ``limit``: the problem is too large for this oracle.
    """
    unit = unit_of(problem)
    covering, to_cover = coverings(problem, unit)
    key = dict(zip(masks(problem), map(tuple, problem.tuples.tolist()), strict=True))
    found: list[Ranked] = []

    def extend(covered: int, cost: int, chosen: tuple[tuple[int, ...], ...]) -> None:
        free = ~covered
        low = (free & -free).bit_length() - 1
        if low >= to_cover:
            if len(found) >= limit:
                raise MemoryError(f"more than {limit} solutions")
            found.append(Ranked(cost / unit, tuple(sorted(chosen))))
            return
        # A tuple is filed under its lowest bit, and everything below `low` is covered already.
        for mask, price in covering[low]:
            if not mask & covered:
                extend(covered | mask, cost + price, (*chosen, key[mask]))

    extend(0, 0, ())
    return sorted(found, key=lambda s: (s.cost, s.tuples))


def brute_force(problem: AssignmentProblem) -> float:
    """Optimal cost, summed in exact arithmetic; InfeasibleError where there is no solution."""
    return float(exact_optimum(problem))


def milp_optimum(
    problem: AssignmentProblem, time_limit: float = 60.0, forbidden: Sequence[NDArray[np.integer]] = ()
) -> float:
    """Optimal cost by HiGHS through scipy; `forbidden`: solutions that do not count, by the indices of their tuples.

    Raises
    ------
    InfeasibleError
        The problem has no solution.
    TimeoutError
        Not proven within the time limit.
    """
    if problem.num_tuples == 0:
        if problem.dummy or problem.sizes.min() == 0:
            return 0.0
        raise InfeasibleError("no tuples")
    result = by_milp(problem, time_limit, forbidden)
    if result.status == 2:
        raise InfeasibleError("no solution")
    if result.status != 0:
        raise TimeoutError(result.message)
    return check_answer(problem, problem.tuples[np.round(result.x) == 1])


def _grid(sizes: NDArray[np.int64], first: int) -> NDArray[np.int64]:
    axes = [np.arange(first, n + 1) for n in sizes]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(sizes))


def _draw_costs(rng: np.random.Generator, count: int, style: str) -> NDArray[np.float64]:
    if style == "ties":
        return rng.integers(-3, 3, count).astype(float)
    if style == "positive":
        return rng.uniform(0.0, 10.0, count)
    if style == "negative":
        return rng.uniform(-10.0, 0.0, count)
    return rng.normal(-2.0, 4.0, count)


def gated_problem(
    rng: np.random.Generator,
    sizes: tuple[int, ...],
    density: float = 0.5,
    style: str = "mixed",
    *,
    listed_singletons: float = 0.0,
    duplicates: float = 0.0,
) -> AssignmentProblem:
    """Random problem with dummies in which only a share of the tuples survived the gate.

    `density` is the share of the tuples with two or more measurements that are kept, `listed_singletons` that of
    singletons with a cost of their own (the rest are added at 0), `duplicates` that of tuples listed a second time with
    another cost. Costs of style "ties" are small integers.
    """
    grid = _grid(np.array(sizes), 0)
    count = np.count_nonzero(grid, axis=1)
    share = np.where(count >= 2, density, np.where(count == 1, listed_singletons, 0.0))
    tuples = grid[rng.random(len(grid)) < share]
    again = tuples[rng.random(len(tuples)) < duplicates]
    tuples = rng.permutation(np.concatenate([tuples, again]), axis=0)
    return AssignmentProblem(tuples.astype(np.int32), _draw_costs(rng, len(tuples), style), sizes)


def axial_problem(
    rng: np.random.Generator,
    sizes: tuple[int, ...],
    density: float = 1.0,
    style: str = "mixed",
) -> AssignmentProblem:
    """Random axial problem, square or rectangular; below density 1 it may have no solution."""
    grid = _grid(np.array(sizes), 1)
    tuples = grid[rng.random(len(grid)) < density]
    return AssignmentProblem(tuples.astype(np.int32), _draw_costs(rng, len(tuples), style), sizes, dummy=False)


def disconnected_problem(rng: np.random.Generator, parts: int, style: str = "mixed") -> AssignmentProblem:
    """Several small 3-D problems with dummies side by side, their measurements shuffled together."""
    shapes = rng.integers(0, 4, (parts, 3)).tolist()
    blocks = [gated_problem(rng, tuple(shape), 0.6, style) for shape in shapes]
    sizes = np.sum([block.sizes for block in blocks], axis=0)
    renumber = [np.concatenate([[0], rng.permutation(n) + 1]) for n in sizes]
    start = np.zeros(3, dtype=int)
    rows, costs = [], []
    for block in blocks:
        shifted = np.where(block.tuples > 0, block.tuples + start, 0)
        rows.append(np.stack([renumber[s][shifted[:, s]] for s in range(3)], axis=1))
        costs.append(block.costs)
        start += block.sizes
    return AssignmentProblem(np.concatenate(rows).astype(np.int32), np.concatenate(costs), sizes)


_DUMMY_SHAPES: list[tuple[int, ...]] = [
    *[(3, 3), (2, 5), (2, 0), (1, 1)],
    *[(3, 3, 3), (2, 3, 4), (4, 1, 2), (0, 3, 3), (4, 4, 3)],
    *[(2, 2, 2, 2), (3, 2, 1, 2), (2, 2, 2, 2, 2), (1, 2, 2, 1, 2), (1, 2, 1, 2, 1, 1)],
]
_AXIAL_SHAPES: list[tuple[int, ...]] = [
    *[(4, 4), (3, 5), (4, 4, 4), (3, 4, 5), (5, 3, 3), (1, 4, 2)],
    *[(2, 3, 2, 4), (3, 3, 3, 3), (2, 2, 2, 2, 2), (2, 3, 2, 2, 3), (2, 2, 2, 2, 2, 2)],
]


def small_problems(count: int, seed: int = 0, *, dummy: bool | None = None) -> Iterator[AssignmentProblem]:
    """Problems that brute force can answer, in every shape and temper the solvers must bear.

    Sensors 2 to 6; gated at several densities; mixed, positive, negative and tied costs; duplicates,
    empty sensors, listed singletons, disconnected clusters; axial ones square, rectangular and sparse
    (those may have no solution).
    """
    for number in range(count):
        rng = np.random.default_rng([seed, number])
        style = ("mixed", "positive", "negative", "ties")[rng.integers(4)]
        with_dummies = number % 3 != 0 if dummy is None else dummy
        if with_dummies and rng.random() < 0.15:
            yield disconnected_problem(rng, int(rng.integers(2, 4)), style)
        elif with_dummies:
            yield gated_problem(
                rng,
                _DUMMY_SHAPES[rng.integers(len(_DUMMY_SHAPES))],
                float(rng.choice([0.1, 0.4, 0.8])),
                style,
                listed_singletons=float(rng.choice([0.0, 0.5])),
                duplicates=float(rng.choice([0.0, 0.2])),
            )
        else:
            shape = _AXIAL_SHAPES[rng.integers(len(_AXIAL_SHAPES))]
            yield axial_problem(rng, shape, float(rng.choice([0.3, 0.7, 1.0])), style)
