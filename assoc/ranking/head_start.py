"""A good solution before the ranking begins: where enumeration is not enough.

A ranking meets its first solution late, when the excess that it allows has grown to that of the optimum. The exact
solver is there in a fraction of that time. What it finds is returned when nothing better is proved, and its excess is
where the ranking goes on: all that is less is contained in it.
"""

from __future__ import annotations

import numpy as np

from assoc.errors import InfeasibleError
from assoc.packing.packing import Packing
from assoc.packing.run import Run
from assoc.solvers.exact.search import search_to_the_end
from assoc.solvers.greedy.fallback import better_of

# share of the time that is left, where it is limited
_SHARE = 0.3
# nodes and patience of the exact solver
_NODES, _PATIENCE = 100_000_000, 10


class HeadStart:
    """What the exact solver knows of a packing, after a share of a run's time at the most.

    Attributes
    ----------
    weight : float
        Weight of the best solution known; it is kept as the run's fallback.
    bound : float
        No solution weighs less.
    taken : bool
        Whether that has been done.
    """

    def __init__(self, packing: Packing, run: Run) -> None:
        self._packing = packing
        self._run = run
        self.weight = np.inf
        self.bound = -np.inf
        self.taken = False

    def take(self) -> None:
        """Solve the packing, or spend a share of the time that is left; once."""
        self.taken = True
        run, packing = self._run, self._packing
        if run.should_stop() or packing.num_columns == 0:
            return
        limit = None if run.time_limit is None else run.elapsed() + _SHARE * run.remaining()
        ahead = Run(0, time_limit=limit, started=run.started)
        ahead.fallback = run.fallback
        try:
            outcome = search_to_the_end(packing, _NODES, _PATIENCE, ahead)
        except InfeasibleError:
            # none found in the share; whether there is none the ranking finds out
            return
        run.fallback = better_of(packing, outcome.columns, ahead)
        self.weight = float(packing.weights[run.fallback].sum())
        self.bound = outcome.lower_bound
