"""Optima and probabilities of small problems in exact arithmetic, to hold every solver's answers against."""

import heapq
import math
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from assoc.errors import InfeasibleError
from assoc.problem import AssignmentProblem


def exact_optimum(problem: AssignmentProblem) -> Fraction:
    """Optimal cost in exact arithmetic; see `exact_ranks`."""
    return exact_ranks(problem, 1)[0]


def exact_ranks(problem: AssignmentProblem, k: int) -> list[Fraction]:
    """Costs of the k best solutions in exact arithmetic, by recursion over the sets of covered measurements.

    Raises
    ------
    InfeasibleError
        The problem has no solution.
    """
    ranks, unit = [0], unit_of(problem)
    for _, part in _parts(problem):
        own = ranks_of_part(part, k, unit)
        # of two ascending lists the i-th and j-th are among the k least sums only if i j <= k
        ranks = heapq.nsmallest(k, (one + other for i, one in enumerate(ranks, 1) for other in own[: k // i]))
    return [Fraction(rank, unit) for rank in ranks]


def unit_of(problem: AssignmentProblem) -> int:
    """All costs are whole numbers of one part in so many: sums of these are exact and quick."""
    return max((cost.as_integer_ratio()[1] for cost in problem.costs.tolist()), default=1)


def ranks_of_part(problem: AssignmentProblem, k: int, unit: int) -> list[int]:
    """Costs, in units, of the k best solutions of a problem with few measurements."""
    covering, to_cover = coverings(problem, unit)
    memo: dict[int, list[int]] = {}

    def rest(covered: int) -> list[int]:
        low = (~covered & -~covered).bit_length() - 1
        if low >= to_cover:
            return [0]
        if covered not in memo:
            ways = (
                price + more for mask, price in covering[low] if not mask & covered for more in rest(covered | mask)
            )
            memo[covered] = heapq.nsmallest(k, ways)
        return memo[covered]

    if not rest(0):
        raise InfeasibleError("no solution")
    return rest(0)


def exact_marginals(problem: AssignmentProblem) -> dict[tuple[int, ...], float]:
    """Probability of each tuple where a solution weighs exp(-cost), from exact differences of costs.

    Raises
    ------
    InfeasibleError
        The problem has no solution.
    """
    tuples = problem.tuples.tolist()
    return {
        tuple(tuples[k]): p
        for rows, part in _parts(problem)
        for k, p in zip(rows, marginals_of_part(part), strict=True)
    }


def _parts(problem: AssignmentProblem) -> list[tuple[list[int], AssignmentProblem]]:
    """Split a problem with dummies into parts that share no measurement: the rows of each, and a problem of them."""
    if not problem.dummy or len(problem.tuples) == 0:
        return [(list(range(len(problem.tuples))), problem)]
    measurements = [[(s, i) for s, i in enumerate(row) if i] for row in problem.tuples.tolist()]
    chief = {one: one for own in measurements for one in own}

    def root(one: tuple[int, int]) -> tuple[int, int]:
        while chief[one] != one:
            one = chief[one]
        return one

    for own in measurements:
        for one in own[1:]:
            chief[root(one)] = root(own[0])
    members: dict[tuple[int, int], list[int]] = {}
    for k, own in enumerate(measurements):
        members.setdefault(root(own[0]), []).append(k)
    parts = []
    for rows in members.values():
        columns = [np.unique(column, return_inverse=True) for column in problem.tuples[rows].T]
        # numbers from 1, and 0 for none also where no tuple has none
        tuples = np.stack([index + (values[0] > 0) for values, index in columns], axis=1)
        parts.append((rows, AssignmentProblem(tuples, problem.costs[rows], tuples.max(axis=0))))
    return parts


def marginals_of_part(problem: AssignmentProblem) -> list[float]:
    """Probability of each tuple of a problem with few measurements."""
    unit = unit_of(problem)
    covering, to_cover = coverings(problem, unit)
    # for each set of covered measurements: the least cost of the rest, the weight of all rests relative to that
    memo: dict[int, tuple[int, float] | None] = {}

    def ways(covered: int) -> list[tuple[int, int, int, float]]:
        low = (~covered & -~covered).bit_length() - 1
        found = []
        for mask, price in covering[low] if low < to_cover else []:
            more = None if mask & covered else rest(covered | mask)
            if more is not None:
                found.append((mask, price + more[0], covered | mask, more[1]))
        return found

    def rest(covered: int) -> tuple[int, float] | None:
        if (~covered & -~covered).bit_length() - 1 >= to_cover:
            return 0, 1.0
        if covered not in memo:
            found = ways(covered)
            least = min((cost for _, cost, _, _ in found), default=0)
            weight = math.fsum(_weight(least - cost, unit) * own for _, cost, _, own in found)
            memo[covered] = (least, weight) if found else None
        return memo[covered]

    if rest(0) is None:
        raise InfeasibleError("no solution")
    reached = {0: 1.0}
    probability: dict[int, float] = {}
    # a set comes after all sets that it contains
    for covered in sorted({0, *memo}):
        here = memo.get(covered)
        if here is None or covered not in reached:
            continue
        for mask, cost, after, own in ways(covered):
            share = reached[covered] * _weight(here[0] - cost, unit) * own / here[1]
            probability[mask] = probability.get(mask, 0.0) + share
            reached[after] = reached.get(after, 0.0) + share
    return [probability.get(mask, 0.0) for mask in masks(problem)]


def _weight(exponent: int, unit: int) -> float:
    return math.exp(max(exponent / unit, -1e4))


def _offsets(problem: AssignmentProblem) -> tuple[list[int], int]:
    """Each sensor's first bit, sensors whose measurements must be covered first; how many bits must be covered."""
    sizes = problem.sizes.tolist()
    smallest = min(sizes)
    order = sorted(range(len(sizes)), key=lambda s: not (problem.dummy or sizes[s] == smallest))
    offset, bits, to_cover = [0] * len(sizes), 0, 0
    for s in order:
        offset[s] = bits
        bits += sizes[s]
        if problem.dummy or sizes[s] == smallest:
            to_cover = bits
    return offset, to_cover


def masks(problem: AssignmentProblem) -> list[int]:
    """The measurements of each tuple, as bits."""
    offset, _ = _offsets(problem)
    return [sum(1 << (offset[s] + i - 1) for s, i in enumerate(row) if i) for row in problem.tuples.tolist()]


def coverings(problem: AssignmentProblem, unit: int) -> tuple[list[list[tuple[int, int]]], int]:
    """For each measurement that must be covered the tuples that begin in it, as bits and cost in units; how many."""
    _, to_cover = _offsets(problem)
    covering: list[list[tuple[int, int]]] = [[] for _ in range(to_cover)]
    best: dict[int, int] = {}
    for mask, price in zip(masks(problem), _in_units(problem.costs.tolist(), unit), strict=True):
        if mask not in best or price < best[mask]:
            best[mask] = price
    for mask, price in best.items():
        low = (mask & -mask).bit_length() - 1
        if low < to_cover:
            covering[low].append((mask, price))
    return covering, to_cover


def _in_units(costs: list[float], unit: int) -> list[int]:
    return [numerator * (unit // denominator) for numerator, denominator in map(float.as_integer_ratio, costs)]


def exact_cost(problem: AssignmentProblem, indices: NDArray[np.intp]) -> Fraction:
    """Cost of a choice of tuples in exact arithmetic."""
    chosen = problem.costs[indices].tolist()
    unit = max((cost.as_integer_ratio()[1] for cost in chosen), default=1)
    return Fraction(sum(_in_units(chosen, unit)), unit)
