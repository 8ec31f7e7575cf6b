"""Exact sub-steps in small doses: cluster search whose clusters grow while they can be solved."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assoc.packing.neighbourhoods.cluster import ClusterSearch
from assoc.packing.packing import Packing

# rows of a cluster: about twenty targets of three sensors are solved in a millisecond or less
_START, _LEAST, _MOST = 45, 24, 75


class ClusterSteps:
    """The cluster search of one part.

    Parameters
    ----------
    packing : Packing
        One component.
    duals : float array, shape (R,)
        Its multipliers.
    """

    def __init__(self, packing: Packing, duals: NDArray[np.float64]) -> None:
        self._search = ClusterSearch.of(packing, duals)
        # a cluster of all rows would be an exact solver, not a local search
        self._most = min(_MOST, max(6, 2 * packing.num_rows // 3))
        self._size = min(_START, self._most)

    def improve(
        self, owner: NDArray[np.int32], rng: np.random.Generator, steps: int, deadline: float = np.inf
    ) -> float:
        """Improve a complete cover in place, until time is over; return the change of its weight (<= 0)."""
        if steps == 0:
            return 0.0
        change, cut = self._search.run(owner, rng, steps, self._size, deadline=deadline)
        if cut > 0.2:
            self._size = max(self._size - 6, min(_LEAST, self._most))
        elif change == 0.0:
            self._size = min(self._size + 1, self._most)
        return change
