"""Large neighbourhoods: most rows of a solution are set free at random and covered anew, to the optimum.

Cluster search (cluster_search.py) solves what lies close together; what stands between a good solution and the
optimum is often a chain of exchanges across the whole part. Here the columns of a random choice of rows stay, the
others go, and branch and bound (branch_and_bound.py) looks for a cover of the free rows that is lighter than the
one they had. Only columns whose reduced cost is below the solution's excess over the bound come into question; with
good multipliers most tries end at the root. The share of rows set free grows while tries end early, and shrinks
when they do not end at all.

References
----------
P. Shaw, "Using constraint programming and local search methods to solve vehicle routing problems", CP 1998,
417-431 (large neighbourhood search).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import njit
from assoc.packing.branching.search import BranchAndBound
from assoc.packing.neighbourhoods.cover import chosen_columns, own
from assoc.packing.packing import assemble

if TYPE_CHECKING:
    from assoc.packing.components.component import Part

# shares of the rows that are set free: at first, at the least and at the most (all would be an exact solver)
_START, _LEAST, _MOST = 0.5, 0.2, 0.92
# nodes of one try, and those up to which it was easy
_NODES, _EASY = 50, 5


class LargeNeighbourhood:
    """Tries on the solutions of one part, and the share of rows that suits it."""

    def __init__(self) -> None:
        self.share = _START

    def improve(self, part: Part, owner: NDArray[np.int32], weight: float, rng: np.random.Generator) -> float:
        """Try once to improve a complete cover of this weight in place; return the change of its weight (<= 0)."""
        packing = part.packing
        limit = max(weight - part.bound, 0.0)
        free = _set_free(packing.cols, owner, rng.permutation(packing.num_rows), self.share)
        inside = np.flatnonzero(_inside(packing.cols, part.reduced, free, limit)).astype(np.int32)
        # rows that are not free are covered as they should be
        smaller = assemble(
            packing.cols[inside], packing.weights[inside], packing.slack | ~free, inside, packing.granularity
        )
        old = chosen_columns(packing.cols, np.where(free, owner, -1))
        before = float(packing.weights[old].sum())
        search = BranchAndBound(smaller, part.duals[smaller.row_origin], before, part.tolerance, part.deadline)
        search.run(_NODES)
        if not search.done:
            self.share = max(self.share - 0.02, _LEAST)
        elif search.nodes <= _EASY:
            self.share = min(self.share + 0.005, _MOST)
        if search.columns is None:
            return 0.0
        owner[free] = -1
        own(packing.cols, smaller.origin[search.columns], owner)
        return search.weight - before


@njit
def _set_free(cols: Any, owner: Any, order: Any, share: float) -> Any:
    """Rows of the first columns in the order of rows, until they are a share of all."""
    free = np.zeros(owner.size, np.bool_)
    count = 0
    for r in order:
        if count >= share * owner.size:
            break
        if free[r]:
            continue
        j = owner[r]
        if j < 0:
            free[r] = True
            count += 1
            continue
        for s in range(cols.shape[1]):
            if cols[j, s] >= 0:
                free[cols[j, s]] = True
                count += 1
    return free


@njit
def _inside(cols: Any, reduced: Any, free: Any, limit: float) -> Any:
    """Columns on free rows alone, of a reduced cost up to ``limit``."""
    keep = np.empty(reduced.size, np.bool_)
    for j in range(keep.size):
        keep[j] = reduced[j] <= limit
        for s in range(cols.shape[1]):
            if cols[j, s] >= 0 and not free[cols[j, s]]:
                keep[j] = False
    return keep
