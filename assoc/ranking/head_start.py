"""A good solution before the ranking begins: where time is limited and enumeration is not enough.

A ranking meets its first solution late, when the excess that it allows has grown to that of the optimum. The exact
solver's heuristics are near the optimum in a fraction of that time. What they find is returned when nothing better is
proved, and its excess is where the ranking goes on: all that is less is contained in it.
"""

from __future__ import annotations

import numpy as np

from assoc.errors import InfeasibleError
from assoc.packing.packing import Packing
from assoc.packing.run import Run
from assoc.solvers.exact.proof import prove
from assoc.solvers.greedy.fallback import better_of

# share of the time that is left
_SHARE = 0.3
# nodes and patience of the exact solver
_NODES, _PATIENCE = 100_000_000, 10


class HeadStart:
    """What the exact solver knows of a packing after a share of a run's time.

    Attributes
    ----------
    weight : float
        Weight of the best solution known; it is kept as the run's fallback.
    bound : float
        No solution weighs less.
    taken : bool
        Whether that has been done; without a time limit it never is.
    """

    def __init__(self, packing: Packing, run: Run) -> None:
        self._packing = packing
        self._run = run
        self.weight = np.inf
        self.bound = -np.inf
        self.taken = run.time_limit is None

    def take(self) -> None:
        """Spend a share of the time that is left, once."""
        self.taken = True
        run, packing = self._run, self._packing
        if run.should_stop() or packing.num_columns == 0:
            return
        ahead = Run(0, time_limit=run.elapsed() + _SHARE * run.remaining(), started=run.started)
        ahead.fallback = run.fallback
        try:
            outcome = prove(packing, _NODES, _PATIENCE, ahead)
        except InfeasibleError:
            # none found in the share; whether there is none the ranking finds out
            return
        run.fallback = better_of(packing, outcome.columns, ahead)
        self.weight = float(packing.weights[run.fallback].sum())
        self.bound = outcome.lower_bound
