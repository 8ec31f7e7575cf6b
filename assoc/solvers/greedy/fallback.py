"""What is returned when time is over and nothing better is known: the greedy choice, made while there is time.

It stands at the doors (assign, kbest, marginals).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assoc.packing.packing import Packing
from assoc.packing.run import Run
from assoc.solvers.greedy.solve import greedy_choice

# of the time that preparing took: about what ends a run takes, a bound and the answer
_RESERVE = 0.25
# columns from which the choice takes so long that it must be made first, not last: some milliseconds
LARGE = 20_000


def prepare_fallback(packing: Packing, run: Run) -> None:
    """Make the greedy choice first, where a time limit would leave no time for it afterwards."""
    if run.time_limit is not None and run.fallback is None and packing.num_columns >= LARGE:
        run.fallback = greedy_choice(packing, run)
        run.reserve = min(_RESERVE * run.runtime(), 0.5 * run.time_limit)


def better_of(packing: Packing, columns: NDArray[np.integer], run: Run) -> NDArray[np.integer]:
    """Return a choice that time has cut short, or the greedy one where that is lighter."""
    greedy = run.fallback
    if greedy is None and packing.num_columns < LARGE:
        greedy = greedy_choice(packing, run)
    if greedy is None or packing.weights[columns].sum() <= packing.weights[greedy].sum():
        return columns
    return greedy
