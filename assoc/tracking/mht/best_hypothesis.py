"""The best global hypothesis where few trees contest the same measurements: depth first, in one compiled call.

A general solver's bounds and bookkeeping cost a millisecond or two, most of it calls, whatever the size; with a
handful of targets that is all the time a scan takes. The trees fall apart into groups that share no
measurement; in each group the branches are tried tree by tree, the best first, and a choice is given up when
even the best branches that still fit cannot reach what has been found.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from assoc._system.compiled import njit, search_njit
from assoc._types import Array

VISITS = 100_000
"""Branches looked at before all is left to a solver; a millisecond or two."""


def choose(tree: Array, score: Array, history: Array) -> Array | None:
    """Branches of the best global hypothesis, or None where that is too much work.

    Parameters
    ----------
    tree : int64 array (B,)
        Tree of each branch; those of one tree stand together.
    score : array (B,)
        Only branches of positive score are taken.
    history : int32 array (B, C)
        Measurements of each branch by column, 1-based, 0: missed.

    Returns
    -------
    bool array (B,) or None
        At most one branch of each tree, no measurement twice, and the largest sum of scores.
    """
    chosen = np.zeros(len(tree), dtype=np.bool_)
    if len(tree) and not _choose(tree, score, history, VISITS, chosen):
        return None
    return chosen


@search_njit
def _choose(tree: Any, score: Any, history: Any, visits: int, chosen: Any) -> bool:
    """Fill in `chosen`; False when the visits are used up."""
    good = np.flatnonzero(score > 0.0)
    if good.size == 0:
        return True
    columns = history.shape[1]
    first = np.zeros(columns + 1, np.int64)
    for c in range(columns):
        top = 0
        for b in good:
            top = max(top, history[b, c])
        first[c + 1] = first[c] + top
    # branches of each tree, the best first
    num = 0
    start = np.empty(good.size + 1, np.int64)
    for k in range(good.size):
        if k == 0 or tree[good[k]] != tree[good[k - 1]]:
            start[num] = k
            num += 1
    start[num] = good.size
    for t in range(num):
        part = good[start[t] : start[t + 1]]
        part[:] = part[np.argsort(-score[part], kind="mergesort")]
    # trees that share a measurement are of one group
    parent = np.arange(num)
    holder = np.full(first[columns], -1, np.int64)
    for t in range(num):
        for k in range(start[t], start[t + 1]):
            for c in range(columns):
                m = history[good[k], c]
                if m > 0:
                    at = first[c] + m - 1
                    if holder[at] < 0:
                        holder[at] = t
                    else:
                        a, b = _root(parent, holder[at]), _root(parent, t)
                        if a < b:
                            parent[b] = a
                        else:
                            parent[a] = b
    group = np.empty(num, np.int64)
    for t in range(num):
        group[t] = _root(parent, t)
    used = np.zeros(first[columns], np.bool_)
    left = visits
    for head in range(num):
        if group[head] != head:
            continue
        trees = np.flatnonzero(group == head)
        left = _search(trees, good, start, score, history, first, used, left, chosen)
        if left < 0:
            return False
    return True


@njit
def _root(parent: Any, t: int) -> int:
    while parent[t] != t:
        parent[t] = parent[parent[t]]
        t = parent[t]
    return t


@njit
def _fits(history: Any, first: Any, used: Any, row: int) -> bool:
    for c in range(first.size - 1):
        m = history[row, c]
        if m > 0 and used[first[c] + m - 1]:
            return False
    return True


@njit
def _mark(history: Any, first: Any, used: Any, row: int, value: bool) -> None:
    for c in range(first.size - 1):
        m = history[row, c]
        if m > 0:
            used[first[c] + m - 1] = value


@search_njit
def _search(
    trees: Any, good: Any, start: Any, score: Any, history: Any, first: Any, used: Any, left: int, chosen: Any
) -> int:
    """Choose the branches of one group; what is left of the visits, -1 when they are used up."""
    depth = trees.size
    top = np.empty(depth)
    for i in range(depth):
        top[i] = score[good[start[trees[i]]]]
    # trees of large scores first: they leave the least to guess
    trees = trees[np.argsort(-top, kind="mergesort")]
    place = np.empty(depth + 1, np.int64)
    taken = np.full(depth, -1, np.int64)
    best = np.full(depth, -1, np.int64)
    most, value = 0.0, 0.0
    i = 0
    place[0] = start[trees[0]]
    while i >= 0:
        if i == depth:
            if value > most:
                most = value
                best[:] = taken
            i -= 1
            continue
        if taken[i] >= 0:
            _mark(history, first, used, taken[i], False)
            value -= score[taken[i]]
            taken[i] = -1
        end = start[trees[i] + 1]
        # the next branch that fits; after the last one, none
        while place[i] < end and not _fits(history, first, used, good[place[i]]):
            place[i] += 1
            left -= 1
        if place[i] > end:
            i -= 1
            continue
        if place[i] < end:
            taken[i] = good[place[i]]
            value += score[taken[i]]
            _mark(history, first, used, taken[i], True)
        place[i] += 1
        bound = value
        for j in range(i + 1, depth):
            for k in range(start[trees[j]], start[trees[j] + 1]):
                left -= 1
                if _fits(history, first, used, good[k]):
                    bound += score[good[k]]
                    break
        if left < 0:
            return -1
        if bound > most * (1.0 + 1e-12):
            i += 1
            if i < depth:
                place[i] = start[trees[i]]
    for i in range(depth):
        if best[i] >= 0:
            chosen[best[i]] = True
    return left
