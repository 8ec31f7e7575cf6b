"""Which pair of measurements to branch on: the two whose belonging together is most in doubt.

Branching asks of two measurements of different sensors whether they have the same source (the rule of Ryan and
Foster for set partitioning). The smoothed primal values tell for which pairs the answer is in doubt; a few passes on
both sides tell which of these pairs raises the bound most.

References
----------
D. M. Ryan and B. A. Foster, "An integer programming approach to scheduling", in Computer Scheduling of Public
Transport (1981), 269-280.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from assoc._system.compiled import njit
from assoc._types import Floats
from assoc.packing.branching.nodes import hard_sweeps


@njit
def doubtful_pairs(
    cols: Any, active: Any, slack: Any, row_ptr: Any, row_cols: Any, primal: Floats, together: Floats, partners: Any,
    pairs: Any, doubts: Floats, values: Floats
) -> int:  # fmt: skip
    """Fill ``pairs`` with those of which it is least clear whether they belong together; how many there are."""
    num_sensors = cols.shape[1]
    doubts[:] = -1.0
    counts = np.zeros(slack.size, np.int64)
    for r in range(slack.size):
        num = 0
        for k in range(row_ptr[r], row_ptr[r + 1]):
            a = row_cols[k]
            for s in range(num_sensors):
                q = cols[active[a], s]
                if q > r:
                    if counts[q] == 0:
                        partners[num] = q
                        num += 1
                    counts[q] += 1
                    together[q] += primal[a]
        degree = row_ptr[r + 1] - row_ptr[r]
        for i in range(num):
            q = partners[i]
            y = min(together[q], 1.0)
            doubt = y * (1.0 - y)
            # where both rows always appear together and must be covered there is nothing to decide
            open_question = slack[r] or slack[q] or counts[q] < degree or counts[q] < row_ptr[q + 1] - row_ptr[q]
            if open_question and doubt > doubts[-1]:
                place = doubts.size - 1
                while place > 0 and doubts[place - 1] < doubt:
                    doubts[place] = doubts[place - 1]
                    values[place] = values[place - 1]
                    pairs[place] = pairs[place - 1]
                    place -= 1
                doubts[place] = doubt
                values[place] = y
                pairs[place, 0], pairs[place, 1] = r, q
            together[q] = 0.0
            counts[q] = 0
    count = 0
    while count < doubts.size and doubts[count] >= 0.0:
        count += 1
    return count


@njit
def child_bound(
    cols: Any, active: Any, num: int, slack: Any, row_ptr: Any, row_cols: Any, parent_duals: Floats,
    parent_reduced: Floats, duals: Floats, reduced: Floats, primal: Floats, slack_primal: Floats,
    one: int, two: int, joined: bool, temperature: float
) -> float:  # fmt: skip
    """Estimate the bound of a child by a few passes; ``inf`` when it has no solution."""
    num_sensors = cols.shape[1]
    duals[:] = parent_duals
    for a in range(num):
        uses = 0
        for s in range(num_sensors):
            r = cols[active[a], s]
            if r == one or r == two:
                uses += 1
        dropped = uses == 1 if joined else uses == 2
        reduced[a] = np.inf if dropped else parent_reduced[a]
    if joined:
        slack[one] = False
        slack[two] = False
    for a in range(num):
        primal[a] = math.exp(-reduced[a] / temperature)
    for r in range(slack.size):
        slack_primal[r] = math.exp(duals[r] / temperature) if slack[r] else 0.0
    possible = True
    for _ in range(6):
        for r in range(slack.size):
            if row_ptr[r] == row_ptr[r + 1]:
                continue
            total = slack_primal[r]
            for k in range(row_ptr[r], row_ptr[r + 1]):
                total += primal[row_cols[k]]
            if not 1e-200 < total < 1e200:
                continue
            step = math.log(total)
            factor = 1.0 / total
            duals[r] -= temperature * step
            slack_primal[r] *= factor
            for k in range(row_ptr[r], row_ptr[r + 1]):
                primal[row_cols[k]] *= factor
    for a in range(num):
        if reduced[a] < np.inf:
            value = parent_reduced[a]
            for s in range(num_sensors):
                r = cols[active[a], s]
                if r >= 0:
                    value += parent_duals[r] - duals[r]
            reduced[a] = value
    possible = hard_sweeps(slack, row_ptr, row_cols, duals, reduced, 1)
    if not possible:
        return np.inf
    bound = 0.0
    for r in range(slack.size):
        bound += duals[r]
    return bound
