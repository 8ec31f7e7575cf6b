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

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import njit
from assoc.packing.branching.nodes import Node


class Doubts(NamedTuple):
    """The pairs of rows that are most in doubt, the most doubtful first, and room for finding them."""

    pairs: NDArray[np.int32]
    # how much the two seem to belong together, from 0 to 1, and how doubtful that is
    values: NDArray[np.float64]
    doubts: NDArray[np.float64]
    together: NDArray[np.float64]
    partners: NDArray[np.int32]


@njit
def new_doubts(count: int, num_rows: int) -> Doubts:
    """Room for so many pairs."""
    return Doubts(
        np.zeros((count, 2), np.int32),
        np.empty(count),
        np.empty(count),
        np.zeros(num_rows),
        np.empty(num_rows, np.int32),
    )


@njit
def doubtful_pairs(cols: Any, node: Node, found: Doubts) -> int:
    """Find the pairs of which it is least clear whether they belong together; how many there are."""
    active, slack, primal = node.active, node.slack, node.primal
    row_ptr, row_cols = node.row_ptr, node.row_cols
    pairs, values, doubts, together, partners = found
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
