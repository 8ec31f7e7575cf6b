"""Large neighbourhoods: most rows of a solution are set free at random and covered anew, to the optimum.

Cluster search (cluster.py) solves what lies close together; what stands between a good solution and the
optimum is often a chain of exchanges across the whole component. Here the columns of a random choice of rows stay, the
others go, and branch and bound (branching/search.py) looks for a cover of the free rows that is lighter than the
one they had. Only columns whose reduced cost is below the solution's excess over the bound come into question; with
good multipliers most tries end at the root. The share of rows set free grows while tries end early, and shrinks
when they do not end at all.

References
----------
P. Shaw, "Using constraint programming and local search methods to solve vehicle routing problems", CP 1998,
417-431 (large neighbourhood search).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import njit
from assoc.packing.bounds.priced import Priced
from assoc.packing.branching.search import BranchAndBound
from assoc.packing.neighbourhoods.cover import chosen_columns, own_all, weight_of
from assoc.packing.packing import assemble

# shares of the rows that are set free: at first, at the least and at the most (all would be an exact solver)
_START, _LEAST, _MOST = 0.5, 0.2, 0.92
# nodes of one try, and those up to which it was easy
_NODES, _EASY = 8, 3
# columns for each row that come into question, those of least reduced cost
_CORE = 40
# tries on one cover: then only another one helps
_TRIES = 300


class LargeNeighbourhood:
    """Tries on the best covers of one component, and the share of rows that suits it."""

    def __init__(self, priced: Priced) -> None:
        self.share = _START
        self._tried = 0
        self._weight = np.inf

    def improve(
        self,
        priced: Priced,
        owner: NDArray[np.int32],
        weight: float,
        rng: np.random.Generator,
        tries: int,
        deadline: float = np.inf,
    ) -> float:
        """Try to improve a complete cover of this weight in place; return its weight then."""
        for _ in range(tries):
            if weight < self._weight:
                self._weight, self._tried = weight, 0
            if self._tried < _TRIES:
                self._tried += 1
                if self._try(priced, owner, weight, rng, deadline):
                    weight = weight_of(priced.packing, owner)
        return weight

    def _try(
        self, priced: Priced, owner: NDArray[np.int32], weight: float, rng: np.random.Generator, deadline: float
    ) -> bool:
        """Set rows free and cover them anew; whether something lighter was found."""
        packing = priced.packing
        # the present cover's own columns are within it, but for rounding
        limit = max(weight - priced.bound, 0.0) + priced.tolerance
        few = _CORE * packing.num_rows
        if packing.num_columns > few:
            limit = min(limit, float(np.partition(priced.reduced, few)[few]))
        free = _set_free(packing.cols, owner, rng.permutation(packing.num_rows), self.share)
        inside = np.flatnonzero(_inside(packing.cols, priced.reduced, free, limit)).astype(np.int32)
        # rows that are not free are covered as they should be
        smaller = assemble(
            packing.cols[inside], packing.weights[inside], packing.slack | ~free, inside, packing.granularity
        )
        found, done, nodes = False, True, 0
        # what falls apart is searched part by part: in one search the nodes of independent parts would multiply
        for c in range(smaller.num_components):
            part = smaller.component(c)
            rows = smaller.row_origin[part.row_origin]
            duals = priced.duals[rows]
            before = float(packing.weights[chosen_columns(packing.cols, owner[rows])].sum())
            if before - float(duals.sum()) <= priced.tolerance:
                continue
            search = BranchAndBound(part, duals, before, priced.tolerance, deadline)
            search.run(_NODES - nodes)
            nodes += search.nodes
            done = done and search.done
            if search.columns is not None:
                owner[rows] = -1
                own_all(packing.cols, smaller.origin[part.origin[search.columns]], owner)
                found = True
        if not done:
            self.share = max(0.9 * self.share, _LEAST)
        elif nodes <= _EASY:
            self.share = min(self.share + 0.005, _MOST)
        return found


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
