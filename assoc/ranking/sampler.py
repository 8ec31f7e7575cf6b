"""Estimates of the probability of each tuple by Gibbs sampling: solutions drawn one from the other.

A move chooses up to three measurements near each other, takes the tuples that contain them apart, and draws tuples for
them anew, from all combinations that the rest of the solution allows, each with its conditional probability.
Insertions, ejections and exchanges between two or three tuples are such moves. Which measurements are chosen does not
depend on the solution, so that solutions are drawn with probabilities proportional to exp(-cost). Some chains start
from a good solution, others from random ones; how far apart their frequencies are says how far the estimates can be
trusted.

References
----------
S. Oh, S. Russell, S. Sastry, Markov chain Monte Carlo data association for multi-target tracking, IEEE Trans. Automatic
Control 54, 2009.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import inner_njit, njit
from assoc._types import Array, Floats, Ints
from assoc.packing.packing import assemble
from assoc.packing.run import Run
from assoc.ranking.columns import AllColumns
from assoc.solvers.greedy.solve import greedy_choice

_CHAINS = 8
# moves of a chain: a few, some more for each measurement, and at most; those between two checks of the time
_LEAST, _MOVES, _MOST, _AT_ONCE = 40_000, 400, 400_000, 5_000
# share of the moves that a chain forgets
_FORGOTTEN = 0.2
# combinations of a move; where there are more, the solution stays
_ROOM = 1024
# measurements that a move takes
_TAKEN = 3
# a tuple is followed to the next measurement with its weight, relative to the best solution's, to this power
_FLATNESS = 0.3
# mean of what is added to reduced costs where a chain begins with columns drawn, and how many of them are tried
_SPREAD, _DRAWN = 3.0, 50_000


class _Problem(NamedTuple):
    """Columns over rows, as kernels take them."""

    cols: NDArray[np.int32]
    log_weight: Floats
    must: NDArray[np.bool_]
    row_ptr: Ints
    row_cols: Ints
    chance: Floats
    """Of each entry of ``row_cols``: the chance that its row is left by it or by an entry before."""


class _Chain(NamedTuple):
    """Where a chain is: the column of each row (-1: none), and the counter of its random numbers."""

    owner: NDArray[np.int32]
    counter: NDArray[np.uint64]
    since: Floats
    """The move that chose each column that is chosen."""
    spent: Floats
    """Moves for which each column was chosen before."""


def estimates(
    columns: AllColumns, which: NDArray[np.bool_], rows: NDArray[np.bool_], best: Array, run: Run, length: float = 1.0
) -> Floats | None:
    """Probabilities of the chosen n columns, and of the chosen m rows to be in none, and standard errors, (2, n + m).

    ``which`` (N,) and ``rows`` (R,) choose whole clusters. Of the chains, every other one begins with the solution
    ``best`` (columns), the others, where rows may stay alone, with columns drawn at random. ``length`` multiplies the
    number of moves. None without time.
    """
    number = np.cumsum(rows) - 1
    cols = np.where(columns.rows >= 0, number[columns.rows], -1)[which].astype(np.int32)
    problem = _problem(cols, columns.weights[which], columns.reduced[which], ~columns.slack[rows])
    size, own = int(rows.sum()), np.cumsum(which) - 1
    moves = int(length * min(max(_LEAST, _MOVES * size), _MOST))
    chains = []
    for c in range(_CHAINS):
        owner = np.full(size, -1, dtype=np.int32)
        start: Array | list[int] = own[best[which[best]]]
        if c % 2:
            rng = np.random.default_rng(c)
            other = _completed(columns, run, rng) if problem.must.any() else None
            if other is not None:
                start = own[other[which[other]]]
            elif not problem.must.any():
                start = _drawn(cols, columns.reduced[which], rng)
        for j in start:
            owner[cols[j][cols[j] >= 0]] = j
        chains.append(_Chain(owner, np.array([c << 32], dtype=np.uint64), np.zeros(len(cols)), np.zeros(len(cols))))
    made = forgotten = 0
    while made < moves and not run.should_stop():
        ahead = min(_AT_ONCE, moves - made)
        for chain in chains:
            _walk(problem, chain, made, made + ahead)
        made += ahead
        if forgotten == 0 and made >= _FORGOTTEN * moves:
            forgotten = made if made < moves else 0
            for chain in chains if forgotten else ():
                chain.spent[:], chain.since[:] = 0.0, made
    if made == forgotten:  # nothing, or no more than is forgotten
        return None
    for chain in chains:
        there = np.unique(chain.owner[chain.owner >= 0])
        chain.spent[there] += made - chain.since[there]
    share = np.array([chain.spent for chain in chains]) / (made - forgotten)
    column, sensor = np.nonzero(cols >= 0)
    alone = np.ones((size, _CHAINS))
    np.subtract.at(alone, cols[column, sensor], share.T[column])
    return np.array(_with_errors(np.concatenate([share, np.clip(alone.T, 0.0, 1.0)], axis=1)))


def _with_errors(share: Floats) -> tuple[Floats, Floats]:
    """Mean and standard error of frequencies in C chains, (C, n).

    The spread of few chains may be small by chance, and that of a rare tuple is 0: errors are at least those of as many
    independent solutions as the spread of all tuples together says the chains are worth.
    """
    chains = len(share)
    mean, square = share.mean(axis=0), share.var(axis=0, ddof=1) / chains
    worth = chains if not square.any() else max(float((mean * (1.0 - mean)).sum() / square.sum()), 1.0)
    near = (mean * worth + 1.0) / (worth + 2.0)
    return mean, np.sqrt(np.maximum(square, near * (1.0 - near) / worth))


def _drawn(cols: Ints, reduced: Floats, rng: np.random.Generator) -> list[int]:
    """Columns without common rows, cheap ones more likely."""
    key = reduced + rng.exponential(_SPREAD, len(reduced))
    used, chosen = np.zeros(int(cols.max(initial=-1)) + 2, dtype=np.bool_), []
    for j in np.argsort(key, kind="stable")[:_DRAWN].tolist():
        at = cols[j][cols[j] >= 0]
        if not used[at].any():
            used[at] = True
            chosen.append(j)
    return chosen


def _completed(columns: AllColumns, run: Run, rng: np.random.Generator) -> Array | None:
    """Columns of a solution where rows must be covered, cheap ones more likely; None if none is found in the time.

    Chains may not pass from one solution to all others there: their spread shows it if they begin apart.
    """
    prices = columns.reduced + rng.exponential(_SPREAD, len(columns.reduced))
    packing = assemble(columns.rows, prices, columns.slack, np.arange(len(prices), dtype=np.int32))
    chosen = greedy_choice(packing, run.part(0, run.time_limit))
    return None if chosen is None else packing.origin[chosen].astype(np.int64)


def _problem(cols: NDArray[np.int32], weights: Floats, reduced: Floats, must: NDArray[np.bool_]) -> _Problem:
    column, sensor = np.nonzero(cols >= 0)
    of = cols[column, sensor]
    order = np.argsort(of, kind="stable")
    row, row_cols = of[order], column[order]
    row_ptr = np.append(0, np.cumsum(np.bincount(row, minlength=must.size)))
    chance = np.exp(-_FLATNESS * reduced[row_cols]) + 1e-12
    sums = np.append(0.0, np.cumsum(chance))
    begin = sums[row_ptr[row]]
    chance = (sums[1:] - begin) / (sums[row_ptr[row + 1]] - begin)
    return _Problem(cols, -weights, must, row_ptr, row_cols, chance)


@njit
def _walk(problem: _Problem, chain: _Chain, first: int, last: int) -> None:
    """Make the moves from this one to before that one."""
    cols, owner, num_sensors = problem.cols, chain.owner, problem.cols.shape[1]
    block, freed, old = np.empty(_TAKEN, np.int64), np.empty(_TAKEN * num_sensors, np.int64), np.empty(_TAKEN, np.int64)
    choice, value = np.empty((_ROOM, _TAKEN), np.int64), np.empty(_ROOM)
    for move in range(first, last):
        taken = _take(problem, chain.counter, owner.size, block)
        num_old = num_freed = 0
        for i in range(taken):
            j = owner[block[i]]
            if j < 0:
                # freed with a column, or alone
                seen = False
                for f in range(num_freed):
                    seen = seen or freed[f] == block[i]
                if not seen:
                    freed[num_freed] = block[i]
                    num_freed += 1
                continue
            old[num_old] = j
            num_old += 1
            for s in range(num_sensors):
                if cols[j, s] >= 0:
                    owner[cols[j, s]] = -1
                    freed[num_freed] = cols[j, s]
                    num_freed += 1
        count = _combinations(problem, owner, block[:taken], freed[:num_freed], choice, value)
        if count > _ROOM:
            for i in range(num_old):
                _put(cols, owner, old[i], old[i])
            continue
        top, total = -np.inf, 0.0
        for i in range(count):
            top = max(top, value[i])
        for i in range(count):
            value[i] = math.exp(value[i] - top)
            total += value[i]
        left = total * _random(chain.counter)
        drawn = 0
        while drawn < count - 1 and left >= value[drawn]:
            left -= value[drawn]
            drawn += 1
        for i in range(num_old):
            chain.spent[old[i]] += move - chain.since[old[i]]
        for i in range(taken):
            j = choice[drawn, i]
            if j >= 0:
                _put(cols, owner, j, j)
                chain.since[j] = move


@inner_njit
def _put(cols: Ints, owner: Ints, j: int, value: int) -> None:
    """Write a value at the rows of a column."""
    for s in range(cols.shape[1]):
        if cols[j, s] >= 0:
            owner[cols[j, s]] = value


@inner_njit
def _random(counter: NDArray[np.uint64]) -> float:
    """Uniform in [0, 1), by splitmix64."""
    counter[0] += np.uint64(0x9E3779B97F4A7C15)
    z = counter[0]
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return float((z ^ (z >> np.uint64(31))) >> np.uint64(11)) * 2.0**-53


@inner_njit
def _take(problem: _Problem, counter: NDArray[np.uint64], rows: int, block: Ints) -> int:
    """Choose measurements near each other, whatever the solution; return how many."""
    block[0] = min(int(_random(counter) * rows), rows - 1)
    taken = 1
    for _ in range(int(_random(counter) * _TAKEN)):
        r = block[taken - 1]
        for _ in range(2):
            low, high = problem.row_ptr[r], problem.row_ptr[r + 1]
            if low == high:
                break
            u = _random(counter)
            while low < high - 1 and problem.chance[low] <= u:
                low += 1
            j = problem.row_cols[low]
            s = min(int(_random(counter) * problem.cols.shape[1]), problem.cols.shape[1] - 1)
            while problem.cols[j, s] < 0:
                s = (s + 1) % problem.cols.shape[1]
            r = problem.cols[j, s]
        new = True
        for i in range(taken):
            new = new and block[i] != r
        if new:
            block[taken] = r
            taken += 1
    return taken


@inner_njit
def _combinations(problem: _Problem, owner: Ints, block: Ints, freed: Ints, choice: Ints, value: Floats) -> int:
    """List what can cover the rows of the block: columns or -1, and the logarithm of their weight.

    Returns how many; one more than there is room for where they are too many.
    """
    cols, row_ptr, row_cols = problem.cols, problem.row_ptr, problem.row_cols
    num_sensors, taken, count = cols.shape[1], block.size, 0
    entry, chosen = np.empty(_TAKEN, np.int64), np.full(_TAKEN, -1, np.int64)
    level = 0
    entry[0] = -1
    while level >= 0:
        if level == taken and count == choice.shape[0]:
            for i in range(taken):
                if chosen[i] >= 0:
                    _put(cols, owner, chosen[i], -1)
            return count + 1
        if level == taken:
            complete, total = True, 0.0
            for f in freed:
                complete = complete and (owner[f] >= 0 or not problem.must[f])
            if complete:
                for i in range(taken):
                    choice[count, i] = chosen[i]
                    if chosen[i] >= 0:
                        total += problem.log_weight[chosen[i]]
                value[count] = total
                count += 1
            level -= 1
            continue
        r = block[level]
        if chosen[level] >= 0:
            _put(cols, owner, chosen[level], -1)
            chosen[level] = -1
        x = entry[level]
        entry[level] += 1
        if x < 0:
            # uncovered, or covered by a column of a row before
            if owner[r] >= 0:
                entry[level] = row_ptr[r + 1] - row_ptr[r]
        elif x < row_ptr[r + 1] - row_ptr[r]:
            j = row_cols[row_ptr[r] + x]
            fits = True
            for s in range(num_sensors):
                fits = fits and (cols[j, s] < 0 or owner[cols[j, s]] < 0)
                # rows before that are uncovered stay so: their own turn listed what covers them
                for i in range(level):
                    fits = fits and cols[j, s] != block[i]
            if not fits:
                continue
            chosen[level] = j
            _put(cols, owner, j, j)
        else:
            level -= 1
            continue
        level += 1
        if level < taken:
            entry[level] = -1
    return count
