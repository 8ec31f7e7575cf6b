"""Pruning of track trees: weak branches, and branches that contradict decisions."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import inner_njit, njit
from assoc._system.kernels.sorting import order_of, sort_by
from assoc._types import Array, Floats


@inner_njit
def keep_best(tree: Array, score: Array, loss: Array, most: int, drop: float) -> Array:
    """Rows of the branches that matter to good global hypotheses, ordered by tree, then loss.

    A tree keeps `most` branches, none with a loss (`assoc.tracking.mht.losses`) above `drop`. It ends if all its
    branches have greater losses: other trees explain its measurements much better. A tree whose best score is still
    negative is allowed that much more.
    """
    order = order_of(tree)
    kept = np.empty(order.size, np.int64)
    count, begin = 0, 0
    while begin < order.size:
        end = begin + 1
        while end < order.size and tree[order[end]] == tree[order[begin]]:
            end += 1
        best = -np.inf
        for k in range(begin, end):
            best = max(best, score[order[k]])
        limit = drop + max(0.0, -best)
        first = count
        for k in range(begin, end):
            if loss[order[k]] <= limit:
                kept[count] = order[k]
                count += 1
        sort_by(kept, loss, first, count)
        count = min(count, first + most)
        begin = end
    return kept[:count].copy()


def decide(tree: Array, score: Array, chosen: Array, old: Array, oldest: Array, sizes: Array) -> tuple[Array, Array]:
    """Decide which tree each measurement of the oldest scan, (B, S), 1-based, 0: missed, belongs to.

    The trees of the best global hypothesis, `chosen` (B,), take theirs first. Other trees that began in that scan or
    before (`old`) take what is left, the best score first, and end if nothing fits. Trees that began later are not
    affected. Branches of one tree are contiguous. Returns the branches that agree with the decision, (B,), and for each
    tree in it the row of the branch that it follows.
    """
    kept, speakers = _decide(tree, score, chosen, old, oldest, int(sizes.max(initial=0)))
    return np.asarray(kept), np.asarray(speakers)


@njit
def _decide(
    tree: NDArray[np.int64],
    score: Floats,
    chosen: NDArray[np.bool_],
    old: NDArray[np.bool_],
    oldest: NDArray[np.int32],
    most: int,
) -> Any:
    count, sensors = oldest.shape
    number = np.zeros(count, np.int64)
    for row in range(1, count):
        number[row] = number[row - 1] + (tree[row] != tree[row - 1])
    speaker = np.full(number[-1] + 1 if count else 0, -1, np.int64)
    taken = np.zeros((sensors, most + 1), np.bool_)
    for row in range(count):
        if chosen[row] and old[row]:
            speaker[number[row]] = row
            for s in range(sensors):
                taken[s, oldest[row, s]] = oldest[row, s] > 0
    waiting = np.empty(count, np.int64)
    size = 0
    for row in range(count):
        if old[row] and speaker[number[row]] < 0:
            waiting[size] = row
            size += 1
    waiting = waiting[:size]
    for row in waiting[order_of(-score[waiting])]:
        free = speaker[number[row]] < 0
        for s in range(sensors):
            free = free and not taken[s, oldest[row, s]]
        if free:
            speaker[number[row]] = row
            for s in range(sensors):
                taken[s, oldest[row, s]] = oldest[row, s] > 0
    kept = np.empty(count, np.bool_)
    for row in range(count):
        own = speaker[number[row]]
        kept[row] = not old[row]
        if own >= 0:
            same = True
            for s in range(sensors):
                same = same and oldest[row, s] == oldest[own, s]
            kept[row] = kept[row] or same
    return kept, speaker[speaker >= 0]


@njit
def same_tree(tree: NDArray[np.int64], mask: NDArray[np.bool_]) -> Any:
    """Mask of all branches of the trees with a branch in `mask`; branches of one tree are contiguous."""
    result = mask.copy()
    for row in range(1, tree.size):
        if result[row - 1] and tree[row] == tree[row - 1]:
            result[row] = True
    for row in range(tree.size - 2, -1, -1):
        if result[row + 1] and tree[row] == tree[row + 1]:
            result[row] = True
    return result
