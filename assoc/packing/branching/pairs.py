"""Choose the pair of measurements to branch on: strong branching with pseudo-costs.

Branching decides whether two measurements of different sensors have the same source (the rule of Ryan and Foster for
set partitioning). *Together* drops the columns with only one of them, and both must be covered; *apart* drops those
with both. Both are masks on the columns, without new rows. A pair is fractional where the LP values of the columns
with both rows add up to something between 0 and 1. The most fractional pairs are tried on both sides by some steps of
the simplex method. Gains are kept for each pair: pairs that were tried often enough elsewhere in the tree are judged
by their mean gain (pseudo-costs).

References
----------
D. M. Ryan and B. A. Foster, "An integer programming approach to scheduling", in Computer Scheduling of Public
Transport (1981), 269-280.
T. Achterberg, T. Koch, A. Martin, "Branching rules revisited", Operations Research Letters 33 (2005), 42-54.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._system.clock import is_over
from assoc._system.compiled import inner_njit, lean_inner_njit, njit
from assoc._system.kernels.copying import copy_to
from assoc._types import Floats, Ints
from assoc.packing.simplex.basis import Basis
from assoc.packing.simplex.dual import CUT, INFEASIBLE, Effort, bound_of
from assoc.packing.simplex.program import Allowed, Program, certified, make_feasible
from assoc.packing.simplex.trial import Trial, begin_trials, new_trial, try_dual

# most pairs tried at a node, and in a row without a better one; steps of the simplex method for each side
_CANDIDATES = 16
_IN_VAIN = 5
_EXCHANGES = 25
# trials of a pair after which its mean gain is used instead
_RELIABLE = 2
# an LP value this near to a whole number is one
WHOLE = 1e-6
# answers of `decide`: branch on the pair, or only the side together or apart can have a better solution
NEITHER, TOGETHER, APART = -1, -2, -3


class Trials(NamedTuple):
    """Buffers for trials of pairs, and the gains so far."""

    mass: NDArray[np.float64]
    """Buffer: sum of the LP values of the columns with both rows, (R, R); 0 between calls."""
    gain: NDArray[np.float32]
    """Mean gain of the bound for each unit of LP value that a side (0: apart, 1: together) forbids, (2, R, R)."""
    tried: NDArray[np.uint8]
    """Number of trials, (2, R, R)."""
    pairs: NDArray[np.int64]
    """The fractional pairs, the most fractional first, (K, 2)."""
    values: Floats
    """Their mass, (K,)."""
    trial: Trial
    """The trial of a side."""
    side: Allowed
    """What that side allows; ``active`` is a buffer."""
    duals: Floats
    """Multipliers of that side, (rows of the program,)."""


def new_trials(program: Program, num_rows: int) -> Trials:
    """Allocate trials of pairs of measurements, the program's first rows."""
    num, size = program.weights.size, program.sides.size
    rows = num_rows
    return Trials(
        np.zeros((rows, rows)), np.zeros((2, rows, rows), np.float32), np.zeros((2, rows, rows), np.uint8),
        np.zeros((_CANDIDATES, 2), np.int64), np.zeros(_CANDIDATES), new_trial(program, _EXCHANGES),
        Allowed(np.empty(num, np.int32), np.zeros(num, np.bool_), np.zeros(size, np.bool_)), np.empty(size),
    )  # fmt: skip


@lean_inner_njit
def is_dropped(cols: Ints, j: int, row: int, other: int, joined: bool) -> bool:
    """Whether column j is forbidden where two rows are together (no column has only one) or apart (none has both)."""
    uses = 0
    for s in range(cols.shape[1]):
        if cols[j, s] == row or cols[j, s] == other:
            uses += 1
    return uses == 1 if joined else uses == 2


@njit
def answer(cols: Ints, allowed: Allowed, pair: tuple[int, int], joined: bool, side: Allowed) -> int:
    """Fill ``side`` with what is allowed where the pair is together or apart; the number of columns allowed."""
    active, columns, slack = side.active, side.columns, side.slack
    columns[:] = False
    copy_to(slack, allowed.slack)
    row, other = pair
    if joined:
        slack[row] = False
        slack[other] = False
    count = 0
    for j in allowed.active:
        if not is_dropped(cols, j, row, other, joined):
            active[count] = j
            columns[j] = True
            count += 1
    return count


@lean_inner_njit
def doubtful_pairs(cols: Ints, basis: Basis, trials: Trials) -> int:
    """Find the most fractional pairs of rows of the LP's solution; return their number."""
    mass, pairs, values = trials.mass, trials.pairs, trials.values
    num, num_sensors = cols.shape
    count = 0
    for clear in range(2):
        for i in range(basis.variable.size):
            j = basis.variable[i]
            if j >= num or not WHOLE < basis.values[i] < 1.0 - WHOLE:
                continue
            for s in range(num_sensors):
                for t in range(s + 1, num_sensors):
                    row, other = cols[j, s], cols[j, t]
                    if row < 0 or other < 0:
                        continue
                    if row > other:
                        row, other = other, row
                    if not clear:
                        mass[row, other] += basis.values[i]
                        continue
                    value = mass[row, other]
                    # each pair once
                    mass[row, other] = 0.0
                    if not WHOLE < value < 1.0 - WHOLE:
                        continue
                    variance = value * (1.0 - value)
                    position = count
                    if count < values.size:
                        count += 1
                    elif variance <= values[count - 1] * (1.0 - values[count - 1]):
                        continue
                    else:
                        position = count - 1
                    while position > 0 and values[position - 1] * (1.0 - values[position - 1]) < variance:
                        values[position] = values[position - 1]
                        pairs[position, 0], pairs[position, 1] = pairs[position - 1, 0], pairs[position - 1, 1]
                        position -= 1
                    values[position] = value
                    pairs[position, 0], pairs[position, 1] = row, other
    return count


@lean_inner_njit
def _try(
    program: Program,
    cols: Ints,
    allowed: Allowed,
    basis: Basis,
    trials: Trials,
    which: tuple[Any, bool],
    effort: Effort,
) -> tuple[int, float]:
    """Try one side of a pair; how it ended, and the bound from the multipliers (but for rounding)."""
    pair, joined = which
    count = answer(cols, allowed, pair, joined, trials.side)
    side = Allowed(trials.side.active[:count], trials.side.columns, trials.side.slack)
    status = try_dual(program, side, basis, trials.trial, effort)
    if status == CUT or status == INFEASIBLE:
        # this bound excludes the side, so it must be valid
        copy_to(trials.duals, trials.trial.basis.duals)
        make_feasible(program, side, trials.duals)
        return status, certified(program, side, trials.duals)
    return status, bound_of(program, trials.trial.basis)


@inner_njit
def decide(
    program: Program, cols: Ints, allowed: Allowed, basis: Basis, trials: Trials, count: int, effort: Effort
) -> Any:
    """Choose one of the fractional pairs, by its index.

    With it comes `NEITHER` (branch), or `TOGETHER` or `APART`: the only side that can have a better solution.
    """
    bound = bound_of(program, basis)
    gap = effort.cutoff - bound
    begin_trials(program, allowed, basis, trials.trial)
    pick, best, in_vain = 0, -1.0, 0
    gains = np.empty(2)
    trial = Effort(effort.cutoff, _EXCHANGES, effort.deadline)
    for i in range(count):
        if in_vain >= _IN_VAIN or (i > 0 and is_over(effort.deadline)):
            break
        row, other = trials.pairs[i]
        value = trials.values[i]
        for joined in range(2):
            share = 1.0 - value if joined else value
            known = trials.tried[joined, row, other]
            if known >= _RELIABLE:
                gains[joined] = trials.gain[joined, row, other] * share
                continue
            status, reached = _try(program, cols, allowed, basis, trials, ((row, other), joined == 1), trial)
            if reached >= effort.cutoff:
                return i, APART if joined else TOGETHER
            gain = max(reached - bound, 0.0)
            gains[joined] = gain
            mean = trials.gain[joined, row, other]
            trials.gain[joined, row, other] = mean + (gain / share - mean) / (known + 1.0)
            trials.tried[joined, row, other] = known + 1
        score = min(max(gains[0], 1e-4 * gap), gap) * min(max(gains[1], 1e-4 * gap), gap)
        if score > best:
            pick, best, in_vain = i, score, 0
        else:
            in_vain += 1
    return pick, NEITHER


@lean_inner_njit
def any_open_pair(cols: Ints, allowed: Allowed, counts: Ints) -> tuple[int, int]:
    """Return two rows that some columns have together and others do not; -1, -1 if there are none.

    Without such a pair columns that share a row are equal, and the lightest of each kind can be taken.
    """
    counts[:] = 0
    for j in allowed.active:
        for s in range(cols.shape[1]):
            if cols[j, s] >= 0:
                counts[cols[j, s]] += 1
    for j in allowed.active:
        for s in range(cols.shape[1]):
            for t in range(s + 1, cols.shape[1]):
                row, other = cols[j, s], cols[j, t]
                if row >= 0 and other >= 0 and (counts[row] > 1 or counts[other] > 1):
                    both = 0
                    for i in allowed.active:
                        both += is_dropped(cols, i, row, other, False)
                    if both < counts[row] or both < counts[other]:
                        return int(row), int(other)
    return -1, -1


@lean_inner_njit
def certain_pairs(cols: Ints, allowed: Allowed, basis: Basis, trials: Trials, counts: Ints) -> int:
    """Find pairs that the whole-numbered LP solution has together, those in most other columns; return their number."""
    pairs, values = trials.pairs, trials.values
    num, num_sensors = cols.shape
    counts[:] = 0
    for j in allowed.active:
        for s in range(num_sensors):
            if cols[j, s] >= 0:
                counts[cols[j, s]] += 1
    found = 0
    for i in range(basis.variable.size):
        j = basis.variable[i]
        if j >= num or basis.values[i] <= WHOLE:
            continue
        for s in range(num_sensors):
            for t in range(s + 1, num_sensors):
                row, other = cols[j, s], cols[j, t]
                # if no other column has one of the rows and both must be covered, the pair is decided
                if (
                    row < 0
                    or other < 0
                    or not (counts[row] > 1 or counts[other] > 1 or allowed.slack[row] or allowed.slack[other])
                ):
                    continue
                others = float(counts[row] + counts[other])
                position = found
                if found < values.size:
                    found += 1
                elif others <= values[found - 1]:
                    continue
                else:
                    position = found - 1
                while position > 0 and values[position - 1] < others:
                    values[position] = values[position - 1]
                    pairs[position, 0], pairs[position, 1] = pairs[position - 1, 0], pairs[position - 1, 1]
                    position -= 1
                values[position] = others
                pairs[position, 0], pairs[position, 1] = row, other
    return found


@lean_inner_njit
def part_certain(
    program: Program, cols: Ints, allowed: Allowed, basis: Basis, trials: Trials, count: int, effort: Effort
) -> tuple[int, int]:
    """Choose the certain pair that costs the most to have apart; return as `decide`.

    -1 if every pair is decided: columns with one of its rows have the other one, too.
    """
    begin_trials(program, allowed, basis, trials.trial)
    pick, best = -1, -np.inf
    trial = Effort(effort.cutoff, _EXCHANGES, effort.deadline)
    for i in range(count):
        if pick >= 0 and is_over(effort.deadline):
            break
        row, other = trials.pairs[i]
        open_question = allowed.slack[row] or allowed.slack[other]
        for j in allowed.active:
            open_question = open_question or is_dropped(cols, j, row, other, True)
        if not open_question:
            continue
        _, reached = _try(program, cols, allowed, basis, trials, ((row, other), False), trial)
        if reached >= effort.cutoff:
            return i, TOGETHER
        if reached > best:
            pick, best = i, reached
    return pick, NEITHER
