"""Estimates of the probability of each tuple by Gibbs sampling: solutions drawn one from the other.

A move chooses up to five measurements near each other, takes the tuples that contain them apart, and draws tuples for
them anew, from all combinations that the rest of the solution allows, each with its conditional probability.
Insertions, ejections and exchanges between some tuples are such moves. Which measurements are chosen does not
depend on the solution, so that solutions are drawn with probabilities proportional to exp(-cost). A tuple's probability
is the mean of its conditional ones in the moves that began with one of its measurements, which varies less than how
often it was drawn (Gelfand and Smith). Half of the chains start from a good solution, the others from random ones, up
to as far from it as costs go; how far apart their means are says how far the estimates can be trusted.

References
----------
A. E. Gelfand, A. F. M. Smith, Sampling-based approaches to calculating marginal densities, J. American Statistical
Association 85, 1990.
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
_LEAST, _MOVES, _MOST, _AT_ONCE = 40_000, 140, 120_000, 1_000
# columns that all chains look at, after which they end: at most, and so many more for each measurement
_LOOKS, _MORE_LOOKS = 300_000_000, 300_000
# what a step from one combination to the next counts for, by its time
_STEP = 3
# share of the moves that a chain forgets
_FORGOTTEN = 0.2
# combinations of a move of several measurements; where there are more, fewer are taken
_ROOM = 256
# measurements that a move takes at most; each one more half as often
_TAKEN = 5
# a tuple is followed to the next measurement with its weight, relative to the best solution's, to this power
_FLATNESS = 0.3
# least mean of what is added to reduced costs where a chain begins with columns drawn, and how many of them are tried
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
    chance: Floats
    """Sum of each column's conditional probabilities, in the moves that began with one of its rows."""
    visits: Floats
    """Moves that began with each row."""
    moved: NDArray[np.bool_]
    """Whether the column of each row ever changed."""


def estimates(
    columns: AllColumns, which: NDArray[np.bool_], rows: NDArray[np.bool_], best: Array, run: Run, length: float = 1.0
) -> Floats | None:
    """Probabilities of the chosen n columns, and of the chosen m rows to be in none, and standard errors, (2, n + m).

    ``which`` (N,) and ``rows`` (R,) choose whole clusters. Of the chains, every other one begins with the solution
    ``best`` (columns), the others with columns drawn at random, each less by their costs than the one before.
    ``length`` multiplies the number of moves. None without time.
    """
    number = np.cumsum(rows) - 1
    cols = np.where(columns.rows >= 0, number[columns.rows], -1)[which].astype(np.int32)
    problem = _problem(cols, columns.weights[which], columns.reduced[which], ~columns.slack[rows])
    size, own = int(rows.sum()), np.cumsum(which) - 1
    moves = int(length * min(max(_LEAST, _MOVES * size), _MOST))
    begun = np.full((_CHAINS, size), -1, dtype=np.int32)
    chains = []
    for c, owner in enumerate(begun):
        start: Array | list[int] = own[best[which[best]]]
        if c % 2:
            rng, spread = np.random.default_rng(c), _spread(columns.reduced[which], c)
            if not problem.must.any():
                # the last one with nothing, which is far from all that is likely
                start = _drawn(cols, columns.reduced[which], spread, rng) if c < _CHAINS - 1 else []
            elif (other := _completed(columns, run, spread, rng)) is not None:
                start = own[other[which[other]]]
        for j in start:
            owner[cols[j][cols[j] >= 0]] = j
        counter, moved = np.array([c << 32], dtype=np.uint64), np.zeros(size, dtype=np.bool_)
        chains.append(_Chain(owner.copy(), counter, np.zeros(len(cols)), np.zeros(size), moved))
    made = forgotten = looks = 0
    most_looks = length * (_LOOKS + _MORE_LOOKS * size)
    while made < moves and looks < most_looks and not run.should_stop():
        ahead = min(_AT_ONCE, moves - made)
        for chain in chains:
            looks += _walk(problem, chain, ahead)
        made += ahead
        if forgotten == 0 and made >= _FORGOTTEN * moves:
            forgotten = made if made < moves else 0
            for chain in chains if forgotten else ():
                chain.chance[:], chain.visits[:] = 0.0, 0.0
    if made == forgotten:  # nothing, or no more than is forgotten
        return None
    visits = np.array([np.append(chain.visits, 0.0)[cols].sum(axis=1) for chain in chains])
    share = np.array([chain.chance for chain in chains]) / np.maximum(visits, 1.0)
    column, sensor = np.nonzero(cols >= 0)
    alone = np.ones((size, _CHAINS))
    np.subtract.at(alone, cols[column, sensor], share.T[column])
    share = np.concatenate([share, np.clip(alone.T, 0.0, 1.0)], axis=1)
    seen = np.any([chain.moved for chain in chains], axis=0) | (begun != begun[0]).any(axis=0)
    seen &= np.all([chain.visits > 0.0 for chain in chains], axis=0)
    ends = np.concatenate([cols, np.column_stack([np.arange(size), np.full((size, cols.shape[1] - 1), -1)])])
    return np.array([share.mean(axis=0), _errors(share, ends, seen, _CHAINS * (made - forgotten))])


def _errors(share: Floats, ends: Ints, seen: NDArray[np.bool_], moves: int) -> Floats:
    """Standard errors of the means of ``share`` (C, n) of C chains; ``ends`` (n, S) are the rows of each.

    The spread of few chains may be small by chance, and that of a rare tuple is 0: errors are at least those of as many
    independent solutions as the chains are worth, by the spread of all tuples together and by that of the tuples of
    each row alone, since some rows mix later than others, and no more than there were ``moves``. Of rows that no chain
    changed, and that all began with the same column, or with which some chain's moves never began (not ``seen``),
    nothing is known: that chains agree there is no sign of anything.
    """
    chains = len(share)
    mean, square = share.mean(axis=0), share.var(axis=0, ddof=1) / chains
    single = mean * (1.0 - mean)
    worth = max(float(single.sum() / square.sum()), 1.0) if square.any() else float(chains)
    worth = min(worth, float(moves))
    which, sensor = np.nonzero(ends >= 0)
    row = ends[which, sensor]
    over, under = (np.bincount(row, part[which], seen.size) for part in (single, square))
    of_row = np.divide(over, under, out=np.full(seen.size, worth), where=under > 0.0).clip(1.0, worth)
    least = np.full(len(ends), worth)
    np.minimum.at(least, which, of_row[row])
    near = (mean * least + 1.0) / (least + 2.0)
    error = np.sqrt(np.maximum(square, near * (1.0 - near) / least))
    error[which[~seen[row]]] = 1.0
    return np.asarray(error)


def _spread(reduced: Floats, chain: int) -> float:
    """Mean of what is added to reduced costs where a chain begins: from a little to the size of the costs themselves.

    Chains that began near each other, in a hollow that none can leave, would agree on what is wrong.
    """
    top = max(float(reduced.max(initial=0.0)) / _SPREAD, 1.0)
    return _SPREAD * top ** (chain / (_CHAINS - 1))


def _drawn(cols: Ints, reduced: Floats, spread: float, rng: np.random.Generator) -> list[int]:
    """Columns without common rows, cheap ones more likely."""
    key = reduced + rng.exponential(spread, len(reduced))
    used, chosen = np.zeros(int(cols.max(initial=-1)) + 2, dtype=np.bool_), []
    for j in np.argsort(key, kind="stable")[:_DRAWN].tolist():
        at = cols[j][cols[j] >= 0]
        if not used[at].any():
            used[at] = True
            chosen.append(j)
    return chosen


def _completed(columns: AllColumns, run: Run, spread: float, rng: np.random.Generator) -> Array | None:
    """Columns of a solution where rows must be covered, cheap ones more likely; None if none is found in the time.

    Chains may not pass from one solution to all others there: their spread shows it if they begin apart.
    """
    prices = columns.reduced + rng.exponential(spread, len(columns.reduced))
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
def _walk(problem: _Problem, chain: _Chain, moves: int) -> int:
    """Make so many moves; return at how many columns they looked."""
    cols, owner, num_sensors = problem.cols, chain.owner, problem.cols.shape[1]
    block, freed, old = np.empty(_TAKEN, np.int64), np.empty(_TAKEN * num_sensors, np.int64), np.empty(_TAKEN, np.int64)
    # a measurement alone can always be covered anew
    most = 0
    for r in range(owner.size):
        most = max(most, problem.row_ptr[r + 1] - problem.row_ptr[r])
    room = max(_ROOM, most + 1)
    choice, value, fitting = np.empty((room, _TAKEN), np.int64), np.empty(room), np.empty((_TAKEN, most), np.int64)
    looks = 0
    for _ in range(moves):
        taken = _take(problem, chain.counter, owner.size, block) + 1
        count, num_old = room + 1, 0
        # how many measurements are taken follows from those chosen and from the tuples that stay: it would be the same
        # on the way back
        while count > room:
            for i in range(num_old):
                _put(cols, owner, old[i], old[i])
            taken -= 1
            num_old, num_freed = _free(cols, owner, block[:taken], old, freed)
            count, seen = _combinations(problem, owner, block[:taken], freed[:num_freed], choice, value, fitting)
            looks += seen
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
        chain.visits[block[0]] += 1.0
        for i in range(count):
            if choice[i, 0] >= 0:
                chain.chance[choice[i, 0]] += value[i] / total
        for i in range(taken):
            j = choice[drawn, i]
            if j >= 0:
                _put(cols, owner, j, j)
                if not (old[:num_old] == j).any():
                    _put(cols, chain.moved, j, True)
        for j in old[:num_old]:
            if not (choice[drawn, :taken] == j).any():
                _put(cols, chain.moved, j, True)
    return looks


@inner_njit
def _free(cols: Ints, owner: Ints, block: Ints, old: Ints, freed: Ints) -> tuple[int, int]:
    """Take the columns of the rows of the block away; lists them and all rows that are free then, returns how many."""
    num_old = num_freed = 0
    for r in block:
        j = owner[r]
        if j < 0:
            # freed with a column, or alone
            free = False
            for f in range(num_freed):
                free = free or freed[f] == r
            if not free:
                freed[num_freed] = r
                num_freed += 1
            continue
        old[num_old] = j
        num_old += 1
        for s in range(cols.shape[1]):
            if cols[j, s] >= 0:
                owner[cols[j, s]] = -1
                freed[num_freed] = cols[j, s]
                num_freed += 1
    return num_old, num_freed


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
    for _ in range(_TAKEN - 1):
        if _random(counter) < 0.5:
            break
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
def _fitting(problem: _Problem, owner: Ints, block: Ints, level: int, fitting: Ints) -> int:
    """List the columns of a row of the block that the rest of the solution allows; return how many."""
    cols, count = problem.cols, 0
    for x in range(problem.row_ptr[block[level]], problem.row_ptr[block[level] + 1]):
        j, free = problem.row_cols[x], True
        for s in range(cols.shape[1]):
            free = free and (cols[j, s] < 0 or owner[cols[j, s]] < 0)
            # rows before that are uncovered stay so: their own turn listed what covers them
            for i in range(level):
                free = free and cols[j, s] != block[i]
        if free:
            fitting[level, count] = j
            count += 1
    return count


@inner_njit
def _combinations(
    problem: _Problem, owner: Ints, block: Ints, freed: Ints, choice: Ints, value: Floats, fitting: Ints
) -> tuple[int, int]:
    """List what can cover the rows of the block: columns or -1, and the logarithm of their weight.

    Returns how many, one more than there is room for where they are too many; and at how many columns it looked.
    """
    cols, num_sensors, last, count = problem.cols, problem.cols.shape[1], block.size - 1, 0
    entry, chosen, fits = np.full(_TAKEN, -1, np.int64), np.full(_TAKEN, -1, np.int64), np.zeros(_TAKEN, np.int64)
    before = np.zeros(_TAKEN)
    looks, need = 0, False
    for f in freed:
        need = need or problem.must[f]
    for level in range(block.size):
        fits[level] = _fitting(problem, owner, block, level, fitting)
        looks += problem.row_ptr[block[level] + 1] - problem.row_ptr[block[level]]
    level = 0
    while level >= 0:
        if chosen[level] >= 0:
            _put(cols, owner, chosen[level], -1)
            chosen[level] = -1
        x = entry[level]
        entry[level] += 1
        looks += _STEP
        if x >= fits[level]:
            level -= 1
            continue
        j, total = -1, before[level]
        if x >= 0:
            j, free = fitting[level, x], True
            for s in range(num_sensors):
                free = free and (cols[j, s] < 0 or owner[cols[j, s]] < 0)
            if not free:
                continue
            total += problem.log_weight[j]
            if level < last or need:
                chosen[level] = j
                _put(cols, owner, j, j)
        elif owner[block[level]] >= 0:
            # covered by a column of a row before
            entry[level] = fits[level]
        if level < last:
            level += 1
            entry[level], before[level] = -1, total
            continue
        complete = True
        for f in freed if need else freed[:0]:
            complete = complete and (owner[f] >= 0 or not problem.must[f])
        if complete and count == choice.shape[0]:
            for i in range(block.size):
                if chosen[i] >= 0:
                    _put(cols, owner, chosen[i], -1)
            return count + 1, looks
        if complete:
            for i in range(last):
                choice[count, i] = chosen[i]
            choice[count, last], value[count] = j, total
            count += 1
    return count, looks
