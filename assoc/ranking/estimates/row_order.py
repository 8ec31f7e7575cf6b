"""An order of measurements (rows) in which few are uncertain at a time.

Tuples are decided in the order of their first rows. A row is *uncertain* at a time when some of its tuples are decided
and it has not had its turn: with the chance m that one of those decided covers it, its entropy is
-m log m - (1 - m) log(1 - m). The sum over the uncertain rows, H, estimates the logarithm of how many sets of covered
rows matter at that time (`assoc.ranking.estimates.truncated_sweep`).

Orders along the first eigenvectors of the graph's Laplacian begin (Fiedler, 1973), whose edges weigh as much as their
tuples are likely. The best is improved by moving single rows, as long as the sum of exp(H / 2) over all times falls.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import coo_array, diags_array
from scipy.sparse.linalg import eigsh

from assoc._system.compiled import inner_njit, njit
from assoc._types import Floats, Ints

_VECTORS = 3
_JOINED = 1e-3
"""Weight of an edge besides its likelihood: it keeps the graph in one piece."""
_LEAST_LIKELY = 1e-3
"""Tuples less likely than this do not count in the search for an order."""
_ROUNDS, _FURTHEST = 4, 60
"""Moves of each row to the left and to the right, and over how many others at most."""
_STEPS = 1024
_SHARES = np.linspace(0.0, 1.0, _STEPS + 1)[1:-1]
_ENTROPY = np.concatenate([[0.0], -_SHARES * np.log(_SHARES) - (1.0 - _SHARES) * np.log(1.0 - _SHARES), [0.0]])
"""Entropy of the shares 0, 1 / 1024, ..., 1."""


class _Decided(NamedTuple):
    """Tuples over rows, and what is decided of them."""

    cols: Ints
    """Rows of each tuple, (K, S); -1 where it has fewer."""
    share: Floats
    """How likely each is, (K,)."""
    row_ptr: Ints
    """Row r is in the tuples ``row_cols[row_ptr[r]:row_ptr[r + 1]]``."""
    row_cols: Ints
    entropy: Floats
    """`_ENTROPY`."""
    turns: Ints
    """Rows of each tuple that have had their turn, (K,): it is decided from the first on."""
    covered: Floats
    """Chance that decided tuples cover the row, (R,)."""


def row_order(cols: Ints, share: Floats, rows: int, most: float) -> tuple[Ints, float]:
    """Order the R rows of one cluster; return the order, and the logarithm of the sum of exp(H) over all times.

    ``cols`` (K, S) are the rows of each tuple, -1 where it has fewer, and ``share`` (K,) says how likely each is. An
    order that begins above ``most`` is not improved.
    """
    likely = share >= _LEAST_LIKELY
    decided = _undecided(cols[likely], share[likely], rows)
    least = np.inf
    best: Ints = np.arange(rows)
    for order in _starts(cols, share, rows):
        found = _total(_entropies(decided, order))
        decided.turns[:], decided.covered[:] = 0, 0.0
        if found < least:
            best, least = order, found
    if least > most:
        return best, least
    best = best.copy()
    for _ in range(_ROUNDS):
        entropy = _entropies(decided, best)
        moved = _moved_left(decided, best, entropy)
        moved += _moved_right(decided, best, entropy)
        decided.turns[:], decided.covered[:] = 0, 0.0
        if not moved:
            break
    return best, _total(_entropies(decided, best))


def _total(entropy: Floats) -> float:
    return float(np.logaddexp.reduce(entropy[1:]))


def _undecided(cols: Ints, share: Floats, rows: int) -> _Decided:
    column, sensor = np.nonzero(cols >= 0)
    row = cols[column, sensor]
    ptr = np.append(0, np.cumsum(np.bincount(row, minlength=rows)))
    row_cols = column[np.argsort(row, kind="stable")]
    return _Decided(cols, share, ptr, row_cols, _ENTROPY, np.zeros(len(share), np.int64), np.zeros(rows))


def _starts(cols: Ints, share: Floats, rows: int) -> list[Ints]:
    """Orders along the first eigenvectors, each in both directions; of few rows, as they are numbered."""
    if rows < _VECTORS + 3:
        return [np.arange(rows)]
    first, second = np.triu_indices(cols.shape[1], 1)
    a, b = cols[:, first].T.ravel(), cols[:, second].T.ravel()
    both = (a >= 0) & (b >= 0)
    weight = np.tile(share + _JOINED, len(first))[both]
    near = coo_array((weight, (a[both], b[both])), (rows, rows)).tocsr()
    near = near + near.T
    laplacian: Any = diags_array(near.sum(axis=1)) - near
    # fixed, so that the result is the same each time
    begin = np.random.default_rng(0).random(rows)
    shift = -_JOINED * float(near.sum(axis=1).mean())
    vectors = eigsh(laplacian.tocsc(), _VECTORS + 1, sigma=shift, v0=begin)[1]
    orders = [np.argsort(vector, kind="stable") for vector in vectors.T[1:]]
    return [turned for order in orders for turned in (order, order[::-1])]


@inner_njit
def _uncertain(decided: _Decided, r: int) -> float:
    """Entropy of a row that has not had its turn."""
    return float(decided.entropy[min(max(int(decided.covered[r] * _STEPS + 0.5), 0), _STEPS)])


@inner_njit
def _turn(decided: _Decided, r: int, step: int) -> float:
    """Give a row its turn (``step`` 1) or take it back (-1); return by how much H rises."""
    rise = -step * _uncertain(decided, r)
    for x in range(decided.row_ptr[r], decided.row_ptr[r + 1]):
        j = decided.row_cols[x]
        decided.turns[j] += step
        if decided.turns[j] != (1 if step > 0 else 0):
            continue
        for u in decided.cols[j]:
            if u >= 0 and u != r:
                rise -= _uncertain(decided, u)
                decided.covered[u] += step * decided.share[j]
                rise += _uncertain(decided, u)
    return rise


@njit
def _entropies(decided: _Decided, order: Ints) -> Floats:
    """Give all rows their turns; return H before the first and after each of them, (R + 1,)."""
    entropy = np.zeros(order.size + 1)
    for t in range(order.size):
        entropy[t + 1] = entropy[t] + _turn(decided, order[t], 1)
    return entropy


@inner_njit
def _work(h: float) -> float:
    return math.exp(min(0.5 * h, 700.0))


@njit
def _moved_left(decided: _Decided, order: Ints, entropy: Floats) -> int:
    """Move rows to the left, the last one first; return how many. All turns are taken back."""
    moved = 0
    for t in range(order.size - 1, -1, -1):
        r = order[t]
        _turn(decided, r, -1)
        gain = most = 0.0
        best = i = t
        while i > max(t - _FURTHEST, 0):
            i -= 1
            _turn(decided, order[i], -1)
            after = entropy[i] + _turn(decided, r, 1)
            _turn(decided, r, -1)
            gain += _work(entropy[i + 1]) - _work(after)
            if gain > most * (1.0 + 1e-9):
                most, best = gain, i
        if best < t:
            moved += 1
            order[best + 1 : t + 1] = order[best:t].copy()
            order[best] = r
        while i < t:
            entropy[i + 1] = entropy[i] + _turn(decided, order[i], 1)
            i += 1
    return moved


@njit
def _moved_right(decided: _Decided, order: Ints, entropy: Floats) -> int:
    """Move rows to the right, the first one first; return how many. All rows get their turns."""
    moved = 0
    for t in range(order.size):
        r = order[t]
        gain = most = 0.0
        best = i = t
        after = entropy[t]
        while i < min(t + _FURTHEST, order.size - 1):
            i += 1
            after += _turn(decided, order[i], 1)
            gain += _work(entropy[i]) - _work(after)
            if gain > most * (1.0 + 1e-9):
                most, best = gain, i
        while i > t:
            _turn(decided, order[i], -1)
            i -= 1
        if best > t:
            moved += 1
            order[t:best] = order[t + 1 : best + 1].copy()
            order[best] = r
            for k in range(t, best):
                entropy[k + 1] = entropy[k] + _turn(decided, order[k], 1)
            for k in range(best - 1, t, -1):
                _turn(decided, order[k], -1)
        else:
            entropy[t + 1] = entropy[t] + _turn(decided, r, 1)
    return moved
