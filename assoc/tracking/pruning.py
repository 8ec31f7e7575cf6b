"""How track trees are cut: weak branches, and branches against what has been decided."""

from __future__ import annotations

from typing import Any

import numpy as np

Array = np.ndarray[Any, np.dtype[Any]]


def keep_best(tree: Array, score: Array, most: int, drop: float) -> Array:
    """Rows of the best branches of each tree, ordered by tree, then score.

    Parameters
    ----------
    tree, score : arrays (B,)
    most : int
        The most branches of a tree.
    drop : float
        Branches further than this below their tree's best are cut.
    """
    if not len(tree):
        return np.zeros(0, dtype=np.int64)
    order = np.lexsort((-score, tree))
    sorted_tree = tree[order]
    first = np.ones(len(order), dtype=np.bool_)
    first[1:] = sorted_tree[1:] != sorted_tree[:-1]
    start = np.flatnonzero(first)
    group = np.cumsum(first) - 1
    rank = np.arange(len(order)) - start[group]
    kept: Array = order[(rank < most) & (score[order] >= score[order[start]][group] - drop)]
    return kept


def decide(tree: Array, score: Array, chosen: Array, old: Array, oldest: Array, sizes: Array) -> tuple[Array, Array]:
    """Decide which tree each measurement of the oldest scan belongs to.

    The trees of the best global hypothesis take theirs first. Trees that are not in it, but began in that
    scan or before, take what is left in the order of their scores, and end if nothing fits; they are targets
    in the making. Younger trees do not touch the scan and stay.

    Parameters
    ----------
    tree, score : arrays (B,)
        Of each branch.
    chosen : bool array (B,)
        Whether it is in the best global hypothesis.
    old : bool array (B,)
        Whether its tree began in the oldest scan or before.
    oldest : int array (B, S)
        The oldest scan's measurements (1-based, 0: missed).
    sizes : int array (S,)

    Returns
    -------
    kept : bool array (B,)
        Branches that agree with what was decided.
    speakers : int array
        One branch of each tree that has decided.
    """
    owner = [np.zeros(int(size) + 1, dtype=np.int64) for size in sizes]
    anchors = np.flatnonzero(chosen & old)
    for s, one in enumerate(owner):
        one[oldest[anchors, s]] = tree[anchors]
        one[0] = 0
    speakers = list(anchors)
    waiting = np.flatnonzero(old & ~np.isin(tree, tree[anchors]))
    taken: set[int] = set()
    for row in waiting[np.lexsort((tree[waiting], -score[waiting]))].tolist():
        own = int(tree[row])
        if own in taken or any(owner[s][oldest[row, s]] for s in range(len(owner)) if oldest[row, s]):
            continue
        taken.add(own)
        speakers.append(row)
        for s, one in enumerate(owner):
            if oldest[row, s]:
                one[oldest[row, s]] = own
    rows = np.array(speakers, dtype=np.int64)
    rows = rows[np.argsort(tree[rows], kind="stable")]
    kept = ~old
    if len(rows):
        place = np.minimum(np.searchsorted(tree[rows], tree), len(rows) - 1)
        kept |= (tree[rows][place] == tree) & (oldest == oldest[rows[place]]).all(axis=1)
    return kept, rows
