"""A good solution before the ranking begins: where enumeration is not enough.

A ranking finds its first solution late, when the allowed excess has grown to that of the optimum. The exact solver
finds one in a fraction of that time. It is returned when nothing better is proved, and the ranking continues with its
excess.
"""

from __future__ import annotations

import numpy as np

from assoc.errors import InfeasibleError
from assoc.packing.packing import Packing
from assoc.packing.run import Run
from assoc.solvers.exact.search import search_to_the_end
from assoc.solvers.greedy.fallback import better_of

# share of the remaining time, where it is limited
_SHARE = 0.3
# nodes and patience of the exact solver
_NODES, _PATIENCE = 100_000_000, 10


class HeadStart:
    """The exact solver's solution and bound of a packing, found in a share of a run's time.

    ``weight`` is that of the best known solution, which is kept as the run's fallback, ``bound`` a lower bound on all;
    ``taken``: `take` was called.
    """

    def __init__(self, packing: Packing, run: Run) -> None:
        self._packing = packing
        self._run = run
        self.weight = np.inf
        self.bound = -np.inf
        self.taken = False

    def take(self) -> None:
        """Solve the packing within a share of the remaining time; only the first call does."""
        self.taken = True
        run, packing = self._run, self._packing
        if run.should_stop() or packing.num_columns == 0:
            return
        limit = None if run.time_limit is None else run.runtime() + _SHARE * run.remaining()
        ahead = run.part(0, limit)
        ahead.fallback = run.fallback
        try:
            outcome = search_to_the_end(packing, _NODES, _PATIENCE, ahead)
        except InfeasibleError:
            # no solution found in this time; the ranking decides whether there is one
            return
        run.fallback = better_of(packing, outcome.columns, ahead)
        self.weight = float(packing.weights[run.fallback].sum())
        self.bound = outcome.lower_bound
