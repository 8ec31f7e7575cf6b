"""The greedy choice as a fallback at the time limit, made while there is time.

It is used by assign, kbest and marginals.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assoc.packing.packing import Packing
from assoc.packing.run import Run
from assoc.solvers.greedy.solve import greedy_choice

# share of the time that preparing took: about what a bound and the answer take at the end of a run
_RESERVE = 0.25
# columns from which the greedy choice takes some milliseconds, so that it must be made first and not last
LARGE = 20_000


def prepare_fallback(packing: Packing, run: Run) -> None:
    """Make the greedy choice first, if the time limit would leave no time for it later."""
    if run.time_limit is not None and run.fallback is None and packing.num_columns >= LARGE:
        run.fallback = greedy_choice(packing, run)
        run.reserve = min(_RESERVE * run.runtime(), 0.5 * run.time_limit)


def better_of(packing: Packing, columns: NDArray[np.integer], run: Run) -> NDArray[np.integer]:
    """Return a choice that the time limit has cut short, or the greedy one if it has less weight."""
    greedy = run.fallback
    if greedy is None and packing.num_columns < LARGE:
        greedy = greedy_choice(packing, run)
    if greedy is None or packing.weights[columns].sum() <= packing.weights[greedy].sum():
        return columns
    return greedy
