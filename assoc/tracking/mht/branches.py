"""The tables of a track-oriented tracker after a scan of one sensor, in one compiled call.

The next branches are those before, missed, then the pairs of a branch and a measurement, then the roots of new
trees; of these the branches are kept that cost the best global hypothesis least.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from assoc._system.compiled import njit, search_njit
from assoc._types import Array
from assoc.packing.kernels.copying import copy_to
from assoc.tracking.mht.best_hypothesis import VISITS, choose
from assoc.tracking.mht.losses import priced
from assoc.tracking.mht.pruning import keep_best
from assoc.tracking.track_batch import BEST, BITS, EXISTS, HITS, ID, LAST, MASK, MISSED, SCORE, STARTED


class Tables(NamedTuple):
    """Branches without their states; see `TrackBatch` and `TrackOrientedMHT`."""

    numbers: Array
    counts: Array
    history: Array
    born: Array


class Hits(NamedTuple):
    """Branches and measurements in their gates: row, 0-based number, gain of the score, seconds; each (K,)."""

    branch: Array
    measurement: Array
    gain: Array
    when: Array


class Roots(NamedTuple):
    """New trees: ids (K,), 1-based measurements of the scan's sensors (K, S), seconds and scores to begin with (K,)."""

    ids: Array
    rows: Array
    when: Array
    score: Array


def extend(
    tables: Tables, miss: Array, hits: Hits, roots: Roots, column: int, scan: int, most: int, drop: float,
    solve: Callable[[Array, Array, Array], Array], visits: int = VISITS,
) -> tuple[Array, Tables, Array]:  # fmt: skip
    """Next branches, cut to those that matter to good global hypotheses.

    The branches of the best global hypothesis stay whatever prices say of them. Where it is not found quickly a solver
    is asked: branches cut around a poor hypothesis are lost for good, and the next sensors cannot mend that.

    Parameters
    ----------
    tables : Tables
        Before.
    miss : array (B,)
        What a miss adds to the score of each branch.
    hits, roots
    column : int
        Of the sensor in the history.
    scan : int
        In which the new trees begin.
    most, drop
        As for `keep_best`.
    solve
        The best global hypothesis of branches, by their trees, scores and histories, as a mask.
    visits
        As for `choose`.

    Returns
    -------
    kept, tables
        Rows among branches missed, hits and roots, in this order; and what is known of them.
    chosen
        Which of them are the best global hypothesis found.
    """
    limits = _Limits(most, drop, visits)
    history, doubtful, grown, *cut = _extend(tables, miss, hits, roots, column, scan, limits)
    if doubtful.size:
        tree, score, _, chosen = grown
        other = solve(tree[doubtful], score[doubtful], history[doubtful])
        if score[doubtful[other]].sum() > score[doubtful[chosen[doubtful]]].sum():
            chosen[doubtful] = other
            cut = _cut(tables, hits, roots, _Grown(*grown), column, scan, limits)
    kept, chosen, *rest = cut
    return kept, Tables(*rest), chosen


class _Grown(NamedTuple):
    """All next branches before they are cut: tree, score, loss, and whether the best global hypothesis has it; (K,)."""

    tree: Any
    score: Any
    loss: Any
    chosen: Any


class _Limits(NamedTuple):
    """Branches of a tree and losses to keep (`keep_best`), and work on the best hypothesis (`choose`)."""

    most: int
    drop: float
    visits: int


@search_njit
def _extend(tables: Tables, miss: Any, hits: Hits, roots: Roots, column: int, scan: int, limits: _Limits) -> Any:
    """Grow all next branches and cut them; also returns what is needed to cut them anew."""
    numbers, counts, history, born = tables
    branch, measurement, gain, _ = hits
    ids, rows, _, first = roots
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
    chosen, doubtful = choose(score, wide, known, limits.visits)
    grown = _Grown(tree, score, known.loss, chosen)
    kept, ours, new_numbers, new_counts, new_history, new_born = _cut(tables, hits, roots, grown, column, scan, limits)
    told = (tree, score, known.loss, chosen)
    return wide, np.flatnonzero(doubtful), told, kept, ours, new_numbers, new_counts, new_history, new_born


@njit
def _cut(tables: Tables, hits: Hits, roots: Roots, grown: _Grown, column: int, scan: int, limits: _Limits) -> Any:
    """The branches that stay, and their tables."""
    numbers, counts, history, born = tables
    branch, measurement, _, when = hits
    ids, rows, since, first = roots
    score = grown.score
    old, pairs = born.size, branch.size
    kept = keep_best(grown.tree, score, np.where(grown.chosen, -1.0, grown.loss), limits.most, limits.drop)
    new_numbers, new_counts = np.empty((kept.size, numbers.shape[1])), np.zeros((kept.size, counts.shape[1]), np.int64)
    new_history, new_born = np.zeros((kept.size, history.shape[1]), np.int32), np.full(kept.size, scan)
    for k in range(kept.size):
        row = kept[k]
        if row >= old + pairs:
            i = row - old - pairs
            new_numbers[k, SCORE] = new_numbers[k, BEST] = new_numbers[k, EXISTS] = first[i]
            new_numbers[k, STARTED] = new_numbers[k, LAST] = since[i]
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
            new_history[k, column] = measurement[row - old] + 1
    return kept, grown.chosen[kept], new_numbers, new_counts, new_history, new_born


@njit
def count_scan(counts: Any, history: Any, sensors: int, looked: Any) -> None:
    """Count, in place, who was detected by any of the scan's sensors, the first columns of the history.

    The scan counts for branches that a sensor looked at (bool (B,)).
    """
    for i in range(counts.shape[0]):
        seen = False
        for s in range(sensors):
            seen = seen or history[i, s] > 0
        if not (seen or looked[i]):
            continue
        counts[i, BITS] = (counts[i, BITS] << 1) & MASK | seen
        counts[i, MISSED] = 0 if seen else counts[i, MISSED] + 1
        counts[i, HITS] += seen
