"""Estimates of the probability of each tuple by a sweep over measurements (rows) that keeps the heaviest sets only.

Rows have their turns one after the other. At its turn a row that is not yet covered is left out, or covered by a tuple
of which no row has had its turn. A *state* is a set of rows that are covered before their turn; its weight sums all
partial solutions that lead to it. After each turn only the heaviest states are kept. A backward sweep sums what
completes each state by kept ones, and both together give the probability of each tuple among the solutions all of
whose states were kept.

Weights are to be reduced by multipliers of a good solution (`assoc.ranking.sweep`): then a covered row costs about what
it is worth, and weights of states may be compared. The order of rows decides how many states matter
(`assoc.ranking.estimates.row_order`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._system.clock import is_over
from assoc._system.compiled import inner_njit, njit
from assoc._types import Floats, Ints

_MOST_STATES, _LARGEST = 2048, 2**21
"""States kept at a turn, and over all turns."""
_CANDIDATES = 2**20
"""States that are compared at a turn."""
_NEGLIGIBLE, _LIGHTEST = 1e-2, 1e-15
"""Parts of a state lighter than this, relative to the lightest state kept, and to the heaviest one, are left out."""
_NUMBER = 2**32 - 1
Words = NDArray[np.uint64]


class _Rows(NamedTuple):
    """R rows in the order of their turns, and K tuples in the order of their first rows, heavy ones first."""

    ptr: Ints
    """Tuples ``ptr[t]:ptr[t + 1]`` are decided at turn t."""
    weight: Floats
    """Weight of each tuple, (K,)."""
    free: Floats
    """Weight of leaving each row alone, (R,)."""
    bits: Words
    """Other rows of each tuple, as bits of a state, (K, W)."""
    bit: Words
    """Each row as the bit of a state, (R, W)."""


class _States(NamedTuple):
    """States kept after each turn (row 0: before the first), at most N of them."""

    covered: Words
    """Covered rows, (R + 1, N, W)."""
    weight: Floats
    """Relative to the heaviest, (R + 1, N)."""
    number: Ints
    """How many there are, (R + 1,)."""
    least: Floats
    """What is lighter than this was left out of the next turn, (R + 1,)."""
    dropped: Floats
    """Share of the weight that was not kept, (R + 1,)."""


class _Table(NamedTuple):
    """A hash table of states."""

    entries: Ints
    """The turn at which a state was entered, times 2**32, and its number; -1: none."""
    covered: Words
    """States by their numbers, (M, W)."""
    weight: Floats


def truncated_sweep(
    cols: Ints, order: Ints, weights: Floats, free: Floats, deadline: float, share: float = 1.0
) -> tuple[Floats, float] | None:
    """Estimate the probability of each of the K tuples of one cluster of R rows.

    Parameters
    ----------
    cols : int array, shape (K, S)
        Rows of each tuple; -1 where it has fewer than S.
    order : int array, shape (R,)
        Rows in the order of their turns.
    weights, free : float arrays, shapes (K,) and (R,)
        Reduced weights of the tuples, and of leaving each row alone.
    deadline : float
        When time is over.
    share : float
        Share of the states that are kept otherwise.

    Returns
    -------
    float array, shape (K,), and float; or None
        The probabilities, and the share of the weight that is dropped at a turn, on average. None without time, or if
        no solution is left.
    """
    rows, which = _in_order(cols, order, weights, free)
    most = max(int(share * min(_MOST_STATES, _LARGEST // max(order.size, 1))), 1)
    found = np.zeros(len(weights))
    dropped = _swept(rows, most, deadline, found)
    if np.isnan(dropped):
        return None
    probability = np.empty(len(weights))
    probability[which] = found
    return probability, dropped


def _in_order(cols: Ints, order: Ints, weights: Floats, free: Floats) -> tuple[_Rows, Ints]:
    """Rows by their turns, tuples by their first rows, and the number of each tuple."""
    count = order.size
    turn = np.empty(count + 1, np.int64)
    turn[order], turn[count] = np.arange(count), count
    turns = np.sort(turn[cols], axis=1)
    which = np.lexsort((-weights, turns[:, 0]))
    turns = turns[which]
    ptr = np.searchsorted(turns[:, 0], np.arange(count + 1))
    place, width = _bits(turns, ptr)
    bit = np.zeros((count + 1, (width + 63) // 64), np.uint64)
    there = np.flatnonzero(place >= 0)
    bit[there, place[there] // 64] = np.uint64(1) << (place[there] % 64).astype(np.uint64)
    bits = np.bitwise_or.reduce(bit[turns[:, 1:]], axis=1)
    return _Rows(ptr, weights[which], free[order], bits, bit), which


@njit
def _bits(turns: Ints, ptr: Ints) -> tuple[Ints, int]:
    """The bit of each row while it may be covered before its turn (-1: it never is), and how many bits there are."""
    count = ptr.size - 1
    place, unused = np.full(count, -1), np.arange(count)[::-1].copy()
    left, width = count, 1
    for t in range(count):
        for j in range(ptr[t], ptr[t + 1]):
            for u in turns[j, 1:]:
                if u < count and place[u] < 0:
                    left -= 1
                    place[u] = unused[left]
                    width = max(width, place[u] + 1)
        if place[t] >= 0:
            unused[left] = place[t]
            left += 1
    return place, width


@njit
def _swept(rows: _Rows, most: int, deadline: float, probability: Floats) -> float:
    """Sweep forwards and backwards, keeping this many states; return the share of the weight dropped at a turn.

    Not a number without time, or if nothing is left.
    """
    count, words = rows.free.size, rows.bits.shape[1]
    tuples = 0
    for t in range(count):
        tuples = max(tuples, rows.ptr[t + 1] - rows.ptr[t])
    room = min(most * (tuples + 1), _CANDIDATES)
    states = _States(
        np.zeros((count + 1, most, words), np.uint64), np.empty((count + 1, most)), np.ones(count + 1, np.int64),
        np.full(count + 1, _LIGHTEST), np.zeros(count + 1),
    )  # fmt: skip
    states.weight[0, 0] = 1.0
    table = _Table(np.full(_size(room), -1), np.empty((room, words), np.uint64), np.empty(room))
    dropped = 0.0
    for t in range(count):
        if is_over(deadline) or not _keep(states, t + 1, table, _followed(rows, states, t, table)):
            return np.nan
        dropped += states.dropped[t + 1]
    return dropped / count if _completed(rows, states, table, deadline, probability) else np.nan


@inner_njit
def _size(states: int) -> int:
    """Entries of a hash table of so many states."""
    size = 16
    while size < 2 * states:
        size *= 2
    return size


@njit
def _followed(rows: _Rows, states: _States, t: int, table: _Table) -> int:
    """List the states that follow at a turn, with their weights; return how many."""
    count, words = 0, rows.bits.shape[1]
    key = np.empty(words, np.uint64)
    covered, added = table.covered, table.weight
    # no more than may be needed: what fits into the cache is quicker
    entries = table.entries[: _size(min(states.number[t] * (rows.ptr[t + 1] - rows.ptr[t] + 1), added.size))]
    for i in range(states.number[t]):
        weight = states.weight[t, i]
        if not _changed(states.covered, t, i, rows.bit, t, key):
            _cleared(states.covered, t, i, rows.bit, key)
            count = _add(entries, covered, added, key, weight, t, count)
            continue
        for k in range(words):
            key[k] = states.covered[t, i, k]
        if rows.free[t] > 0.0:
            count = _add(entries, covered, added, key, weight * rows.free[t], t, count)
        for j in range(rows.ptr[t], rows.ptr[t + 1]):
            if weight * rows.weight[j] < states.least[t]:
                break
            if _changed(states.covered, t, i, rows.bits, j, key):
                count = _add(entries, covered, added, key, weight * rows.weight[j], t, count)
    return count


@inner_njit
def _changed(covered: Words, t: int, i: int, bits: Words, j: int, key: Words) -> bool:
    """Cover rows in a state, given as bits, and write it to ``key``; False if one of them is covered already."""
    for k in range(key.size):
        if covered[t, i, k] & bits[j, k]:
            return False
        key[k] = covered[t, i, k] | bits[j, k]
    return True


@inner_njit
def _cleared(covered: Words, t: int, i: int, bit: Words, key: Words) -> None:
    """Write a state to ``key`` without the row that has its turn."""
    for k in range(key.size):
        key[k] = covered[t, i, k] & ~bit[t, k]


@inner_njit
def _find(entries: Ints, covered: Words, key: Words, turn: int) -> int:
    """Where the table has a state of this turn, or where it may be entered."""
    mark = np.uint64(1469598103934665603)
    for k in range(key.size):
        mark = (mark ^ key[k]) * np.uint64(0x9E3779B97F4A7C15)
        mark ^= mark >> np.uint64(29)
    at = np.int64(mark & np.uint64(entries.size - 1))
    while entries[at] >> 32 == turn:
        same = True
        for k in range(key.size):
            same = same and covered[entries[at] & _NUMBER, k] == key[k]
        if same:
            break
        at = (at + 1) & (entries.size - 1)
    return int(at)


@inner_njit
def _add(entries: Ints, covered: Words, weights: Floats, key: Words, weight: float, turn: int, count: int) -> int:
    """Add to the weight of a state; return how many there are. What finds no room is left out."""
    at = _find(entries, covered, key, turn)
    if entries[at] >> 32 == turn:
        weights[entries[at] & _NUMBER] += weight
    elif count < weights.size:
        entries[at] = (turn << 32) | count
        for k in range(key.size):
            covered[count, k] = key[k]
        weights[count] = weight
        count += 1
    return count


@njit
def _keep(states: _States, t: int, table: _Table, count: int) -> bool:
    """Keep the heaviest of these states; False if none has a weight."""
    most, top, least, kept, total, share = states.weight.shape[1], 0.0, 0.0, 0, 0.0, 0.0
    weight = table.weight[:count]
    for i in range(count):
        top = max(top, weight[i])
        total += weight[i]
    if not 0.0 < top < np.inf:
        return False
    if count > most:
        least = np.partition(weight, count - most)[count - most]
    for i in range(count):
        if weight[i] >= least and kept < most:
            states.covered[t, kept] = table.covered[i]
            states.weight[t, kept] = weight[i] / top
            share += weight[i]
            kept += 1
    states.number[t] = kept
    states.dropped[t] = 1.0 - share / total
    states.least[t] = max(_NEGLIGIBLE * least / top, _LIGHTEST)
    return True


@njit
def _completed(rows: _Rows, states: _States, table: _Table, deadline: float, probability: Floats) -> bool:
    """Sum backwards what completes each state, and fill in the probabilities; False without time."""
    count = rows.free.size
    covered, added = table.covered, table.weight
    after, key, none = np.ones(1), np.empty(rows.bits.shape[1], np.uint64), np.zeros_like(rows.bit)
    for t in range(count - 1, -1, -1):
        if is_over(deadline):
            return False
        # later than all turns before
        turn = 2 * count - t
        entries = table.entries[: _size(states.number[t + 1])]
        for i in range(states.number[t + 1]):
            _cleared(states.covered, t + 1, i, none, key)
            _add(entries, covered, added, key, 0.0, turn, i)
        before, total = np.zeros(states.number[t]), 0.0
        for i in range(states.number[t]):
            weight, completed = states.weight[t, i], 0.0
            is_free = _changed(states.covered, t, i, rows.bit, t, key)
            _cleared(states.covered, t, i, rows.bit, key)
            at = _find(entries, covered, key, turn)
            if entries[at] >> 32 == turn:
                completed = (rows.free[t] if is_free else 1.0) * after[entries[at] & _NUMBER]
            if is_free:
                for j in range(rows.ptr[t], rows.ptr[t + 1]):
                    if weight * rows.weight[j] < states.least[t]:
                        break
                    if not _changed(states.covered, t, i, rows.bits, j, key):
                        continue
                    at = _find(entries, covered, key, turn)
                    if entries[at] >> 32 == turn:
                        completion = rows.weight[j] * after[entries[at] & _NUMBER]
                        completed += completion
                        probability[j] += weight * completion
            before[i] = completed
            total += weight * completed
        if not 0.0 < total < np.inf:
            return False
        probability[rows.ptr[t] : rows.ptr[t + 1]] /= total
        after = before / before.max()
    return True
