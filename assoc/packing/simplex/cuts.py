"""Cuts from odd sets of rows: whole-numbered solutions satisfy them, the linear program's solution does not.

Of an odd set Q of rows, each covered at most once, at most (|Q| - 1) / 2 pairs can be covered together:

    sum_j floor(|rows of j in Q| / 2) x_j <= (|Q| - 1) / 2.

(Half of the sum of the rows in Q, rounded down: a {0, 1/2} cut. Odd holes and cliques of the conflict graph are among
them.) The linear program's solution violates it by (1 - f(Q)) / 2, where

    f(Q) = sum of the slacks of the rows in Q + sum of x_j over the columns with an odd number of rows in Q.

Tabu search finds sets of small f; a move adds or removes one row. A cut is a row of the program like any other, with a
slack, which is a whole number in every whole-numbered solution.

References
----------
A. Caprara, M. Fischetti, "{0, 1/2}-Chvatal-Gomory cuts", Mathematical Programming 74 (1996), 221-235.
G. Andreello, A. Caprara, M. Fischetti, "Embedding {0, 1/2}-cuts in a branch-and-cut framework", INFORMS Journal on
Computing 19 (2007), 229-238 (separation by tabu search).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import inner_njit, njit
from assoc._system.kernels.copying import copy_to
from assoc._types import Floats, Ints
from assoc.packing.simplex.basis import Basis
from assoc.packing.simplex.program import Program

# an LP value this near to a whole number is one
_WHOLE = 1e-6
# largest f of a set that is worth a cut; sets kept of one search; moves from each row; tabu tenure
_LARGEST, _KEPT, _MOVES, _REST = 0.96, 30, 40, 6
# largest share of a set's rows that another set of the same search may have
_COMMON = 0.7


@njit
def odd_sets(cols: Ints, basis: Basis, num_rows: int) -> Any:
    """Odd sets of rows whose cuts the program's solution violates, the most violated first, (K, num_rows).

    The basis is optimal; ``num_rows`` are the rows of measurements, which cuts follow.
    """
    num, num_sensors = cols.shape
    members = np.empty(basis.variable.size, np.int32)
    values = np.empty(basis.variable.size)
    uncovered = np.ones(num_rows)
    count = 0
    for i in range(basis.variable.size):
        j, value = basis.variable[i], basis.values[i]
        if j < num and value > _WHOLE:
            if value < 1.0 - _WHOLE:
                members[count] = j
                values[count] = value
                count += 1
            for s in range(num_sensors):
                if cols[j, s] >= 0:
                    uncovered[cols[j, s]] -= value
    pointer, by_row = _by_row(cols, members[:count], num_rows)
    sets = np.zeros((_KEPT, num_rows), np.bool_)
    scores = np.full(_KEPT, _LARGEST)
    kept = 0
    inside, odd = np.zeros(num_rows, np.bool_), np.zeros(count, np.bool_)
    change, rest = np.empty(num_rows), np.empty(num_rows, np.int64)
    best_set = np.zeros(num_rows, np.bool_)
    for begin in range(num_rows):
        if pointer[begin] == pointer[begin + 1]:
            continue
        inside[:] = False
        odd[:] = False
        rest[:] = 0
        for r in range(num_rows):
            # change of f when the row enters or leaves
            change[r] = max(uncovered[r], 0.0)
            for k in range(pointer[r], pointer[r + 1]):
                change[r] += values[by_row[k]]
        f = 0.0
        size = 0
        best = _LARGEST
        row = begin
        for move in range(_MOVES):
            f += change[row]
            change[row] = -change[row]
            inside[row] = not inside[row]
            size += 1 if inside[row] else -1
            rest[row] = move + _REST
            for k in range(pointer[row], pointer[row + 1]):
                a = by_row[k]
                odd[a] = not odd[a]
                step = -2.0 * values[a] if odd[a] else 2.0 * values[a]
                for s in range(num_sensors):
                    r = cols[members[a], s]
                    if r >= 0 and r != row:
                        change[r] += step
            if size % 2 == 1 and f < best:
                best = f
                copy_to(best_set, inside)
            row = -1
            least = np.inf
            for r in range(num_rows):
                # the first row stays, or every search would end at the empty set
                if pointer[r] < pointer[r + 1] and rest[r] <= move and r != begin and change[r] < least:
                    least = change[r]
                    row = r
            if row < 0:
                break
        if best < _LARGEST:
            kept = _keep(sets, scores, kept, best_set, best)
    return sets[:kept].copy()


@inner_njit
def _by_row(cols: Ints, members: Ints, num_rows: int) -> Any:
    """Where each row begins in a list of indices of the columns that use it, and the list."""
    pointer = np.zeros(num_rows + 1, np.int64)
    for j in members:
        for s in range(cols.shape[1]):
            if cols[j, s] >= 0:
                pointer[cols[j, s] + 1] += 1
    for r in range(num_rows):
        pointer[r + 1] += pointer[r]
    by_row = np.empty(pointer[num_rows], np.int32)
    end = pointer[:num_rows].copy()
    for a in range(members.size):
        for s in range(cols.shape[1]):
            r = cols[members[a], s]
            if r >= 0:
                by_row[end[r]] = a
                end[r] += 1
    return pointer, by_row


@inner_njit
def _keep(sets: NDArray[np.bool_], scores: Floats, kept: int, new: NDArray[np.bool_], score: float) -> int:
    """Insert a set in order of f, unless it shares too many rows with a better one; return the number kept."""
    position = kept
    for i in range(kept):
        common, size, other = 0, 0, 0
        for r in range(new.size):
            common += new[r] and sets[i, r]
            size += new[r]
            other += sets[i, r]
        if common > _COMMON * min(size, other):
            if score >= scores[i] - 1e-9:
                return kept
            # the new one replaces it
            for k in range(i, kept - 1):
                copy_to(sets[k], sets[k + 1])
                scores[k] = scores[k + 1]
            return _keep_at(sets, scores, kept - 1, new, score)
    return _keep_at(sets, scores, position, new, score)


@inner_njit
def _keep_at(sets: NDArray[np.bool_], scores: Floats, kept: int, new: NDArray[np.bool_], score: float) -> int:
    position = kept
    if kept == scores.size:
        if score >= scores[kept - 1]:
            return kept
        position = kept - 1
    else:
        kept += 1
    while position > 0 and scores[position - 1] > score:
        copy_to(sets[position], sets[position - 1])
        scores[position] = scores[position - 1]
        position -= 1
    copy_to(sets[position], new)
    scores[position] = score
    return kept


def with_cuts(cols: Ints, weights: Floats, num_rows: int, sets: NDArray[np.bool_]) -> Program:
    """The linear program of columns over rows, with a further row for the cut of each set."""
    start, rows, sides = _entries(cols, num_rows, sets)
    return Program(weights, start, rows, sides, cols.shape[1])


@njit
def _entries(cols: Ints, num_rows: int, sets: NDArray[np.bool_]) -> Any:
    """Start of each column's rows, the rows, and the right-hand sides.

    A plain tuple: when Ctrl-C interrupts the conversion of a record, numba calls its class without having found it.
    """
    num, num_sensors = cols.shape
    start = np.zeros(num + 1, np.int64)
    for count in range(2):
        if count:
            rows = np.empty(start[num], np.int32)
        position = 0
        for j in range(num):
            for s in range(num_sensors):
                if cols[j, s] >= 0:
                    if count:
                        rows[position] = cols[j, s]
                    position += 1
            for c in range(len(sets)):
                uses = 0
                for s in range(num_sensors):
                    if cols[j, s] >= 0 and sets[c, cols[j, s]]:
                        uses += 1
                for _ in range(uses // 2):
                    if count:
                        rows[position] = num_rows + c
                    position += 1
            start[j + 1] = position
    sides = np.ones(num_rows + len(sets))
    for c in range(len(sets)):
        size = 0
        for r in range(num_rows):
            size += sets[c, r]
        sides[num_rows + c] = (size - 1) // 2
    return start, rows, sides
