"""A partial matching with multipliers, as the steps of `match_sparse` hand it on."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from assoc._system.compiled import inner_njit
from assoc._types import Floats, Ints


class Costs(NamedTuple):
    """The problem as the steps take it; see `match`."""

    indptr: Ints
    indices: Ints
    unsigned: Ints
    """The same: numba does not ask whether such an index is negative."""
    costs: Floats
    row_slack: Floats
    above: Floats
    """Costs less the base of the column, the cost of leaving it unmatched: high, but finite, where that must not be."""


class State(NamedTuple):
    """A partial matching and its duals; a column's dual is ``base + v``."""

    row_edge: Ints
    u: Floats
    v: Floats
    owner: Ints
    """Row that each column is matched to, or -1."""
    pending: Ints
    """Rows that are not matched yet; their number is kept separately."""


@inner_njit
def unmatch_loose(problem: Costs, state: State) -> int:
    """Set the rows' duals for the columns' and unmatch rows above theirs; return how many rows are not matched."""
    indptr, indices, unsigned, _, _, above = problem
    row_edge, u, v, owner, pending = state
    for i in range(u.size):
        least = np.inf
        for k in range(indptr[i], indptr[i + 1]):
            least = min(least, above[k] - v[unsigned[k]])
        u[i] = least
        e = row_edge[i]
        if e >= 0 and above[e] - v[unsigned[e]] > least:
            owner[indices[e]], row_edge[i] = -1, -1
    count = 0
    for i in range(u.size):
        if row_edge[i] >= 0:
            continue
        for k in range(indptr[i], indptr[i + 1]):
            if owner[unsigned[k]] < 0 and above[k] - v[unsigned[k]] <= u[i]:
                row_edge[i], owner[unsigned[k]] = k, i
                break
        if row_edge[i] < 0:
            pending[count] = i
            count += 1
    return count
