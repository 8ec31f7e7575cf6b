"""Links, divisions and merges as tuples of one assignment problem, and the particles that a solution makes of them.

A link is a point as a source and a later one as a target. A division has one source and two targets, a merger two
sources and one target. A tuple has at most one measurement of each list, so that points which may be in one tuple
together are put into different lists: the colours of a greedy colouring.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from assoc._types import Array
from assoc.association.link_costs import LinkCosts, Pairs, Points
from assoc.problem import AssignmentProblem
from assoc.solution import Solution


def links_of(solution: Solution, lists: list[Array], sources: int) -> Array:
    """The links of a solution, a source and a target each, int (K, 2); two of a division and of a merger.

    ``lists`` are the points of each list of the problem, of which the first ``sources`` are of sources.
    """
    links: list[tuple[int, int]] = []
    if len(lists) == 2:
        taken = solution.tuples[solution.tuples.all(axis=1)] - 1
        return np.column_stack([lists[0][taken[:, 0]], lists[1][taken[:, 1]]])
    for row in solution.tuples[np.count_nonzero(solution.tuples, axis=1) > 1].tolist():
        ends = [lists[s][index - 1] for s, index in enumerate(row) if index]
        cut = sum(index > 0 for index in row[:sources])
        links += [(one, other) for one in ends[:cut] for other in ends[cut:]]
    return np.array(links, dtype=np.int64).reshape(-1, 2)


def lineage_problem(points: Points, pairs: Pairs, costs: LinkCosts) -> tuple[AssignmentProblem, list[Array], int]:
    """The problem of all candidates that cost less than their points alone; what `links_of` takes of it."""
    count, (start, end) = len(points.places), costs.of_end()
    price = costs.of_links(pairs)
    near = pairs.within(1)
    # parts (source, target, target) and (target, source, source), and what they cost
    apart = _forks(near, near.ends, costs.divisions, end + 2.0 * start)
    joined = _forks(near, near.ends[:, ::-1], costs.merges, start + 2.0 * end)
    sources, targets = _coloured(count, joined[0][:, 1:]), _coloured(count, apart[0][:, 1:])
    lists = [
        np.flatnonzero(colour == c) for colour in (sources, targets) for c in range(int(colour.max(initial=0)) + 1)
    ]
    cut = int(sources.max(initial=0)) + 1
    place = np.zeros((2, count), dtype=np.int64)
    for s, members in enumerate(lists):
        place[int(s >= cut), members] = np.arange(1, len(members) + 1)
    good = price < 0.0
    ends = pairs.ends[good]
    blocks, prices = [], [price[good], apart[1], joined[1]]
    for from_, to in (
        ([ends[:, 0]], [ends[:, 1]]),
        ([apart[0][:, 0]], [apart[0][:, 1], apart[0][:, 2]]),
        ([joined[0][:, 1], joined[0][:, 2]], [joined[0][:, 0]]),
    ):
        tuples = np.zeros((len(from_[0]), len(lists)), dtype=np.int64)
        rows = np.arange(len(tuples))
        for one in from_:
            tuples[rows, sources[one]] = place[0, one]
        for one in to:
            tuples[rows, cut + targets[one]] = place[1, one]
        blocks.append(tuples)
    problem = AssignmentProblem(np.concatenate(blocks), np.concatenate(prices), [len(one) for one in lists])
    return problem, lists, cut


def _forks(near: Pairs, ends: Array, price: float | None, saved: float) -> tuple[Array, Array]:
    """One point with two others, (F, 3), and their costs below 0, (F,); none without a price."""
    if price is None:
        return np.empty((0, 3), dtype=np.int64), np.empty(0)
    order = np.argsort(ends[:, 0], kind="stable")
    ends, squares = ends[order], near.squares[order]
    _, first, count = np.unique(ends[:, 0], return_index=True, return_counts=True)
    forks, costs = [np.empty((0, 3), dtype=np.int64)], [np.empty(0)]
    for n in np.unique(count[count > 1]):
        a, b = np.triu_indices(n, 1)
        one, other = ((first[count == n][:, None] + index).ravel() for index in (a, b))
        cost = squares[one] + squares[other] + price - saved
        kept = cost < 0.0
        forks.append(np.column_stack([ends[one, 0], ends[one, 1], ends[other, 1]])[kept])
        costs.append(cost[kept])
    return np.concatenate(forks), np.concatenate(costs)


def _coloured(count: int, edges: Array) -> Array:
    """A colour for each of `count` points, from 0, so that no edge (E, 2) joins two of one colour."""
    colour = np.zeros(count, dtype=np.int64)
    neighbours: dict[int, set[int]] = {}
    for a, b in edges.tolist():
        neighbours.setdefault(a, set()).add(b)
        neighbours.setdefault(b, set()).add(a)
    done: set[int] = set()
    for point in sorted(neighbours, key=lambda one: -len(neighbours[one])):
        taken = {int(colour[other]) for other in neighbours[point] & done}
        colour[point] = next(c for c in range(len(taken) + 1) if c not in taken)
        done.add(point)
    return colour


def numbered(points: Points, links: Array) -> tuple[Array, Array]:
    """Particles of all points (N,), from 0 in order of appearance, and parents and children (K, 2)."""
    count = len(points.places)
    targets, sources = (np.bincount(links[:, column], minlength=count) for column in (0, 1))
    plain = (targets[links[:, 0]] == 1) & (sources[links[:, 1]] == 1)
    before = np.full(count, -1)
    before[links[plain, 1]] = links[plain, 0]
    numbers, known = np.empty(count, dtype=np.int64), 0
    for low, high in pairwise(points.first):
        earlier = before[low:high]
        new = earlier < 0
        numbers[low:high][~new] = numbers[earlier[~new]]
        numbers[low:high][new] = known + np.arange(new.sum())
        known += int(new.sum())
    return numbers, numbers[links[~plain]]
