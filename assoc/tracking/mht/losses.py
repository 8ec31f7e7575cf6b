"""The loss of a branch: how much worse the best global hypothesis becomes if it must contain it.

Track trees are pruned by these losses.

A global hypothesis takes at most one branch of each tree and each measurement at most once. The score of the
best one that contains a given branch is the branch's max-marginal; how far it lies below the best of all is
the branch's loss. By linear programming duality the loss is at least the branch's reduced cost

    loss >= sum of the prices of the trees and measurements that the branch uses - its score  (>= 0),

up to the gap between the best hypothesis and the bound, which is mostly zero. Prices are the multipliers of the
assignment problem's constraints (`assoc.packing.bounds.dual_ascent`): a measurement that several trees contend for has
a price above 0, one that only a single tree uses costs nothing. So a branch with a high score has a high loss if it
needs measurements that other trees need more, and its tree keeps a branch without them.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import inner_njit, njit
from assoc._system.kernels.sorting import order_of
from assoc._types import Floats
from assoc.packing.bounds.dual_ascent import START, SmoothPoint, hard_sweeps, smooth_passes, spread
from assoc.packing.packing import PackingArrays, assembled

# temperatures of the smoothed ascent, in nats: the branches of a tree differ by about ten, however high their scores,
# and losses must be exact enough to tell the best hypothesis from the second best
_HOTTEST, _COLDEST, _PASSES = 2.0, 0.05, 40


class Priced(NamedTuple):
    """Losses of B branches, and the prices that give them."""

    number: NDArray[np.int64]
    """Tree of each branch, from 0, (B,)."""
    first: NDArray[np.int64]
    """Offset of each column's measurements in `measurements`, (C + 1,)."""
    trees: Floats
    measurements: Floats
    """Prices, as `trees`, 0 or more; the sum of both bounds the score of the best global hypothesis."""
    loss: Floats
    """Lower bound on the loss of each branch, 0 or more up to rounding, (B,)."""


@njit
def priced(tree: NDArray[np.int64], score: Floats, history: NDArray[np.int32]) -> Any:
    """Find prices, and a lower bound on the loss of each branch, as `Priced`.

    Of each branch: its tree (B,); its log likelihood ratio (B,), where a tree that no branch of a hypothesis uses
    scores 0; its measurements by column (B, C), 1-based, 0: missed.
    """
    number, trees = _numbered(tree)
    columns = history.shape[1]
    first = np.zeros(columns + 1, np.int64)
    for c in range(columns):
        top = 0
        for b in range(tree.size):
            top = max(top, history[b, c])
        first[c + 1] = first[c] + top
    # only measurements that several trees contend for have a price, and only these trees determine it
    holder = np.full(first[columns], -1, np.int64)
    contested = np.zeros(first[columns], np.bool_)
    for b in range(tree.size):
        if score[b] > 0.0:
            for c in range(columns):
                if history[b, c] > 0:
                    m = first[c] + history[b, c] - 1
                    contested[m] = contested[m] or (holder[m] >= 0 and holder[m] != number[b])
                    holder[m] = number[b]
    price = np.zeros(trees + first[columns])
    involved, any_involved = np.zeros(trees, np.bool_), False
    for b in range(tree.size):
        if score[b] > 0.0:
            price[number[b]] = max(price[number[b]], score[b])
            for c in range(columns):
                if history[b, c] > 0 and contested[first[c] + history[b, c] - 1]:
                    involved[number[b]] = any_involved = True
    if any_involved:
        _price(number, score, history, first, contested, involved, price)
    loss = np.empty(tree.size)
    for b in range(tree.size):
        loss[b] = price[number[b]] - score[b]
        for c in range(columns):
            if history[b, c] > 0:
                loss[b] += price[trees + first[c] + history[b, c] - 1]
    return Priced(number, first, price[:trees].copy(), price[trees:].copy(), loss)


@inner_njit
def _numbered(tree: NDArray[np.int64]) -> Any:
    """Number the trees from 0; return the number of each branch's tree, and how many trees there are."""
    order = order_of(tree)
    number = np.empty(tree.size, np.int64)
    trees = 0
    for k in range(tree.size):
        if k > 0 and tree[order[k]] != tree[order[k - 1]]:
            trees += 1
        number[order[k]] = trees
    return number, trees + (1 if tree.size else 0)


@inner_njit
def _price(
    number: NDArray[np.int64],
    score: Floats,
    history: NDArray[np.int32],
    first: NDArray[np.int64],
    contested: NDArray[np.bool_],
    involved: NDArray[np.bool_],
    price: Floats,
) -> None:
    """Fill in the prices of the trees involved and of the contested measurements."""
    trees, columns = involved.size, history.shape[1]
    wanted = np.zeros(score.size, np.bool_)
    count = 0
    for b in range(score.size):
        wanted[b] = score[b] > 0.0 and involved[number[b]]
        count += wanted[b]
    rows = np.full((count, 1 + columns), -1, np.int32)
    weights = np.empty(count)
    k = 0
    for b in range(score.size):
        if wanted[b]:
            rows[k, 0] = number[b]
            weights[k] = -score[b]
            for c in range(columns):
                if history[b, c] > 0:
                    m = first[c] + history[b, c] - 1
                    if contested[m]:
                        rows[k, 1 + c] = trees + m
            k += 1
    slack = np.ones(price.size, np.bool_)
    # names of columns are not asked for
    cols, costs, free, col_start, row_start, row_ptr, row_cols, _, row_origin = assembled(
        rows, weights, slack, np.empty(count, np.int32)
    )
    packing = PackingArrays(cols, costs, free, col_start, row_start, row_ptr, row_cols)
    duals, reduced = np.zeros(free.size), np.empty(count)
    point = SmoothPoint(duals, reduced, np.empty(count), np.empty(free.size))
    # rows of trees come first in every component: after this sweep their prices are the scores of their best branches
    hard_sweeps(packing, duals, reduced, 1)
    temperature, hottest = spread(packing), 0.0
    for c in range(temperature.size):
        temperature[c] = min(max(START * temperature[c], 2.0 * _COLDEST), _HOTTEST)
        hottest = max(hottest, temperature[c])
    while hottest > _COLDEST:
        smooth_passes(packing, point, temperature, _PASSES, np.inf)
        hottest = 0.0
        for c in range(temperature.size):
            temperature[c] = max(0.5 * temperature[c], 0.5 * _COLDEST)
            hottest = max(hottest, temperature[c])
    hard_sweeps(packing, duals, reduced, 2)
    for r in range(free.size):
        price[row_origin[r]] = max(-duals[r], 0.0)
