"""Grow and prune the branches of a track-oriented tracker by one sensor's scan, in one compiled call.

The candidates are, in this order: the old branches with a miss, the pairs of a branch and a measurement, and the roots
of new trees. Those with the least loss (`assoc.tracking.mht.losses`) are kept.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import njit
from assoc._system.kernels.copying import copy_to
from assoc._types import Array, Floats
from assoc.tracking.growth import Offers
from assoc.tracking.mht.best_hypothesis import VISITS, choose
from assoc.tracking.mht.losses import priced
from assoc.tracking.mht.pruning import keep_best
from assoc.tracking.records.track_batch import BEST, BITS, EXISTS, HIDDEN, HITS, ID, LAST, MASK, MISSED, SCORE, STARTED


class Tables(NamedTuple):
    """Branches without their states; see `TrackBatch` and `TrackOrientedMHT`."""

    numbers: Array
    counts: Array
    history: Array
    born: Array


_Grown = tuple[NDArray[np.int64], Floats, Floats, NDArray[np.bool_]]
"""All candidates: tree, score, loss, and whether the best global hypothesis contains it; each (K,)."""


def extend(
    tables: Tables, offers: Offers, column: int, scan: int, most: int, drop: float,
    solve: Callable[[Array, Array, Array], Array], visits: int = VISITS,
) -> tuple[Array, Tables, Array, float]:  # fmt: skip
    """Grow all B branches and keep those that matter to good global hypotheses.

    The branches of the best global hypothesis are always kept. Where the search does not find it quickly, a solver
    does: a branch that is cut around a poor hypothesis cannot come back. `solve` returns it as a mask, given the
    branches' trees, scores and histories. `column` is that of the sensor in the history, `scan` the one in which the
    new trees begin; `most` and `drop` are as for `keep_best`, `visits` as for `choose`.

    Returns rows of the candidates that are kept, their tables, which of them form the best global hypothesis found, and
    how far its score may be below the best one's where no solver was asked, relative; mostly 0.
    """
    history, uncertain, gap, grown, *cut = _extend(tables, offers, column, scan, most, drop, visits)
    doubtful = np.flatnonzero(uncertain)
    if doubtful.size:
        tree, score, _, chosen = grown
        other = solve(tree[doubtful], score[doubtful], history[doubtful])
        if score[doubtful[other]].sum() > score[doubtful[chosen[doubtful]]].sum():
            chosen[doubtful] = other
            cut = _cut(tables, offers, grown, column, scan, most, drop)
    kept, chosen, *rest = cut
    return kept, Tables(*rest), chosen, gap


@njit
def _extend(tables: Tables, offers: Offers, column: int, scan: int, most: int, drop: float, visits: int) -> Any:
    """Grow all branches and prune them; also return what is needed to prune them again."""
    numbers, counts, history, born = tables
    miss, branch, measurement, gain, _, births = offers
    ids, rows, _, first = births
    old, pairs = born.size, branch.size
    tree, score = np.empty(old + pairs + ids.size, np.int64), np.empty(old + pairs + ids.size)
    for i in range(old):
        tree[i], score[i] = counts[i, ID], numbers[i, SCORE] + miss[i]
    for i in range(pairs):
        tree[old + i], score[old + i] = counts[branch[i], ID], numbers[branch[i], SCORE] + gain[i]
    for i in range(ids.size):
        tree[old + pairs + i], score[old + pairs + i] = ids[i], first[i]
    wide = np.zeros((score.size, history.shape[1]), np.int32)
    for i in range(old):
        copy_to(wide[i], history[i])
    for i in range(pairs):
        copy_to(wide[old + i], history[branch[i]])
        wide[old + i, column] = measurement[i] + 1
    for i in range(ids.size):
        copy_to(wide[old + pairs + i, : rows.shape[1]], rows[i])
    known = priced(tree, score, wide)
    chosen, doubtful, gap = choose(score, wide, known, visits)
    grown = tree, score, known.loss, chosen
    kept, ours, new_numbers, new_counts, new_history, new_born = _cut(tables, offers, grown, column, scan, most, drop)
    return wide, doubtful, gap, grown, kept, ours, new_numbers, new_counts, new_history, new_born


@njit
def _cut(tables: Tables, offers: Offers, grown: _Grown, column: int, scan: int, most: int, drop: float) -> Any:
    """Prune the candidates; return the rows kept and their tables."""
    numbers, counts, history, born = tables
    _, branch, measurement, _, when, births = offers
    ids, rows, since, first = births
    tree, score, loss, chosen = grown
    old, pairs = born.size, branch.size
    order = loss.copy()
    for i in range(order.size):
        if chosen[i]:
            order[i] = -1.0
    kept = keep_best(tree, score, order, most, drop)
    new_numbers, new_counts = np.empty((kept.size, numbers.shape[1])), np.zeros((kept.size, counts.shape[1]), np.int64)
    new_history, new_born = np.zeros((kept.size, history.shape[1]), np.int32), np.full(kept.size, scan)
    for k in range(kept.size):
        row = kept[k]
        if row >= old + pairs:
            i = row - old - pairs
            new_numbers[k, SCORE] = new_numbers[k, BEST] = new_numbers[k, EXISTS] = first[i]
            new_numbers[k, STARTED] = new_numbers[k, LAST] = since[i]
            new_numbers[k, HIDDEN] = 0.0
            new_counts[k, ID] = ids[i]
            copy_to(new_history[k, : rows.shape[1]], rows[i])
            continue
        source = row if row < old else branch[row - old]
        copy_to(new_numbers[k], numbers[source])
        copy_to(new_counts[k], counts[source])
        copy_to(new_history[k], history[source])
        new_born[k] = born[source]
        new_numbers[k, SCORE] = score[row]
        new_numbers[k, EXISTS] += score[row] - numbers[source, SCORE]
        new_numbers[k, BEST] = max(numbers[source, BEST], score[row])
        if row >= old:
            new_numbers[k, LAST] = max(numbers[source, LAST], when[row - old])
            new_numbers[k, HIDDEN] = 0.0
            new_history[k, column] = measurement[row - old] + 1
    return kept, chosen[kept], new_numbers, new_counts, new_history, new_born


@njit
def count_scan(counts: NDArray[np.int64], history: NDArray[np.int32], sensors: int, covered: NDArray[np.bool_]) -> None:
    """Update, in place, the counts of detections and misses by the scan, the first columns of the history.

    The scan counts only for branches that a dwell of some sensor covered: `covered`, bool (B,).
    """
    for i in range(counts.shape[0]):
        seen = False
        for s in range(sensors):
            seen = seen or history[i, s] > 0
        if not (seen or covered[i]):
            continue
        counts[i, BITS] = (counts[i, BITS] << 1) & MASK | seen
        counts[i, MISSED] = 0 if seen else counts[i, MISSED] + 1
        counts[i, HITS] += seen
