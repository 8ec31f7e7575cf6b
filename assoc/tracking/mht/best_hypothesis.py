"""The best global hypothesis: depth-first search bounded by the prices of trees and measurements.

The score of a global hypothesis is the sum of the prices of `assoc.tracking.mht.losses`, less the losses of the
branches taken and the prices of unused trees and measurements. Trees that share no measurement, not even through
others, form independent groups. In each group the search tries the branches tree by tree, the least loss first, and
prunes where even the branches that still fit cannot beat the incumbent. With good prices the first descent is nearly
always optimal. Groups that exceed their limit of work are returned as doubtful, for a solver. Groups so large that
one descent exceeds it get only that; in the largest, first scans of crowds, it is enough if it is within a small gap of
the prices.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import inner_njit, njit
from assoc._system.kernels.copying import copy_to
from assoc._system.kernels.sorting import order_of, sort_by
from assoc._types import Floats
from assoc.tracking.mht.losses import Priced

VISITS = 20_000
"""Limit on branches visited in a group; less than a millisecond."""

GAP, VAST = 1e-3, 2000
"""Relative gap that groups of so many trees may keep."""


class _Branches(NamedTuple):
    """The branches of positive score, tree by tree, and the measurements that are in use."""

    rows: NDArray[np.int64]
    """Rows of the branches, those of a tree by loss."""
    start: NDArray[np.int64]
    """Where each tree begins in ``rows``, and the last one ends."""
    history: NDArray[np.int32]
    known: Priced
    used: NDArray[np.bool_]


@njit
def choose(score: Floats, history: NDArray[np.int32], known: Priced, visits: int) -> Any:
    """Find the branches of the best global hypothesis among those of positive score, (B,).

    `history` (B, C) are the measurements of each branch by column, 1-based, 0: missed; `known` are prices and losses of
    the same branches, and `visits` limits the branches visited in each group.

    Returns the chosen, (B,), at most one branch of each tree, no measurement twice, with the largest sum of scores
    found; branches of positive score in groups where the limit was reached before optimality was proved, (B,), mostly
    none; and the largest relative gap of the other groups, 0 but for the largest.
    """
    chosen, doubtful = np.zeros(score.size, np.bool_), np.zeros(score.size, np.bool_)
    num = known.trees.size
    good, start = _by_tree(score, known)
    # trees that share a measurement belong to one group
    parent = np.arange(num)
    holder = np.full(known.measurements.size, -1, np.int64)
    for row in good:
        for c in range(history.shape[1]):
            if history[row, c] > 0:
                at = known.first[c] + history[row, c] - 1
                if holder[at] < 0:
                    holder[at] = known.number[row]
                else:
                    a, b = _root(parent, holder[at]), _root(parent, known.number[row])
                    parent[max(a, b)] = min(a, b)
    group = np.empty(num, np.int64)
    for t in range(num):
        group[t] = _root(parent, t)
    branches = _Branches(good, start, history, known, np.zeros(known.measurements.size, np.bool_))
    order = order_of(group)
    begin, gap = 0, 0.0
    while begin < num:
        end = begin + 1
        while end < num and group[order[end]] == group[order[begin]]:
            end += 1
        if end - begin == 1:
            # nobody contends for measurements of this tree: the best of its branches loses nothing
            t = order[begin]
            if start[t] < start[t + 1]:
                chosen[good[start[t]]] = True
            begin = end
            continue
        trees = order[begin:end]
        if trees.size * (trees.size - 1) // 2 <= visits:
            settled = _search(branches, trees, visits, chosen) >= 0
        else:
            lost, total = _descend(branches, trees, score, chosen)
            settled = trees.size >= VAST and lost <= GAP * total
            if settled:
                gap = max(gap, lost / total)
        if not settled:
            for t in trees:
                for g in range(start[t], start[t + 1]):
                    doubtful[good[g]] = True
        begin = end
    return chosen, doubtful, gap


@inner_njit
def _by_tree(score: Floats, known: Priced) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The branches of positive score, tree by tree, the least loss first, and where each tree begins, (T + 1,)."""
    start = np.zeros(known.trees.size + 1, np.int64)
    for row in range(score.size):
        if score[row] > 0.0:
            start[known.number[row] + 1] += 1
    for t in range(known.trees.size):
        start[t + 1] += start[t]
    rows, place = np.empty(start[-1], np.int64), start.copy()
    for row in range(score.size):
        if score[row] > 0.0:
            rows[place[known.number[row]]] = row
            place[known.number[row]] += 1
    for t in range(known.trees.size):
        sort_by(rows, known.loss, start[t], start[t + 1])
    return rows, start


@inner_njit
def _root(parent: NDArray[np.int64], t: int) -> int:
    while parent[t] != t:
        parent[t] = parent[parent[t]]
        t = parent[t]
    return t


@inner_njit
def _fits(branches: _Branches, row: int) -> bool:
    history, first, used = branches.history, branches.known.first, branches.used
    for c in range(first.size - 1):
        m = history[row, c]
        if m > 0 and used[first[c] + m - 1]:
            return False
    return True


@inner_njit
def _mark(branches: _Branches, row: int, value: bool) -> None:
    history, first, used = branches.history, branches.known.first, branches.used
    for c in range(first.size - 1):
        m = history[row, c]
        if m > 0:
            used[first[c] + m - 1] = value


@inner_njit
def _left_over(branches: _Branches, trees: NDArray[np.int64], taken: NDArray[np.int64]) -> float:
    """Sum the prices of the group's measurements that a complete choice does not use."""
    rows, start, history, known, used = branches
    total = 0.0
    for i in range(trees.size):
        for k in range(start[trees[i]], start[trees[i] + 1]):
            for c in range(history.shape[1]):
                m = history[rows[k], c]
                if m > 0 and not used[known.first[c] + m - 1] and known.measurements[known.first[c] + m - 1] > 0.0:
                    total += known.measurements[known.first[c] + m - 1]
                    used[known.first[c] + m - 1] = True
    for i in range(trees.size):
        for k in range(start[trees[i]], start[trees[i] + 1]):
            _mark(branches, rows[k], False)
    for i in range(trees.size):
        if taken[i] >= 0:
            _mark(branches, taken[i], True)
    return total


@inner_njit
def _descend(
    branches: _Branches, trees: NDArray[np.int64], score: Floats, chosen: NDArray[np.bool_]
) -> tuple[float, float]:
    """The first descent of `_search`, without its bounds; how far it is below the prices, at most, and its score."""
    rows, start, known = branches.rows, branches.start, branches.known
    taken = np.full(trees.size, -1, np.int64)
    trees = trees[order_of(-known.trees[trees])]
    lost = total = 0.0
    for i in range(trees.size):
        for k in range(start[trees[i]], start[trees[i] + 1]):
            if _fits(branches, rows[k]):
                taken[i] = rows[k]
                break
        if taken[i] < 0:
            lost += known.trees[trees[i]]
            continue
        lost += max(known.loss[taken[i]], 0.0)
        total += score[taken[i]]
        chosen[taken[i]] = True
        _mark(branches, taken[i], True)
    lost += _left_over(branches, trees, taken)
    for i in range(trees.size):
        if taken[i] >= 0:
            _mark(branches, taken[i], False)
    return lost, total


@inner_njit
def _search(branches: _Branches, trees: NDArray[np.int64], left: int, chosen: NDArray[np.bool_]) -> int:
    """Choose the branches of one group; return the visits left, negative if the limit was exceeded."""
    rows, start, known = branches.rows, branches.start, branches.known
    depth = trees.size
    # trees with high prices first: leaving one of them out costs most
    trees = trees[order_of(-known.trees[trees])]
    at = np.empty(depth + 1, np.int64)
    taken = np.full(depth, -1, np.int64)
    best = np.full(depth, -1, np.int64)
    lost = np.zeros(depth + 1)
    least = np.inf
    total = 0.0
    for t in trees:
        total += known.trees[t]
    margin = 1e-12 * (total + 1.0)
    i = 0
    at[0] = start[trees[0]]
    while i >= 0:
        if i == depth:
            total = lost[i]
            if total < least:
                total += _left_over(branches, trees, taken)
            if total < least - margin:
                least = total
                copy_to(best, taken)
            i -= 1
            continue
        if taken[i] >= 0:
            _mark(branches, taken[i], False)
            taken[i] = -1
        end = start[trees[i] + 1]
        # the next branch that fits; after the last one, none
        while at[i] < end and not _fits(branches, rows[at[i]]):
            at[i] += 1
            left -= 1
        # branches are sorted by loss: the later ones are no better
        if at[i] < end and lost[i] + known.loss[rows[at[i]]] >= least - margin:
            at[i] = end
        if at[i] > end or (at[i] == end and lost[i] + known.trees[trees[i]] >= least - margin):
            i -= 1
            continue
        if at[i] < end:
            taken[i] = rows[at[i]]
            lost[i + 1] = lost[i] + max(known.loss[taken[i]], 0.0)
            _mark(branches, taken[i], True)
        else:
            lost[i + 1] = lost[i] + known.trees[trees[i]]
        at[i] += 1
        bound = lost[i + 1]
        for j in range(i + 1, depth):
            more = known.trees[trees[j]]
            for k in range(start[trees[j]], start[trees[j] + 1]):
                left -= 1
                if _fits(branches, rows[k]):
                    more = min(more, max(known.loss[rows[k]], 0.0))
                    break
            bound += more
        if left < 0 and least < np.inf:
            break
        if bound < least - margin:
            i += 1
            if i < depth:
                at[i] = start[trees[i]]
    for i in range(depth):
        if taken[i] >= 0:
            _mark(branches, taken[i], False)
        if best[i] >= 0:
            chosen[best[i]] = True
    return left
