"""Multipliers from the linear program itself, by HiGHS's simplex or interior point method.

Where the smoothed ascent (bounds.py) ends a little below the LP bound, as it does on scenes full of ghosts,
that little can be most of the gap, and everything that follows is paid for by it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from assoc._system.in_time import in_time
from assoc.packing.packing import Packing
from assoc.packing.run import Run

# columns from which the interior point method is quicker than the dual simplex method
_LARGE = 15_000


def linear_program_duals(packing: Packing, run: Run) -> NDArray[np.float64] | None:
    """Return optimal multipliers of the LP relaxation, shape (R,), or None if they cannot be had in time.

    Rounding may leave reduced costs a little negative: ``bounds.certified_bound`` charges for that.
    """
    from scipy import optimize
    from scipy.sparse import csr_array

    # its stubs cannot follow which of the optional arguments are None
    linprog: Any = optimize.linprog

    num, num_sensors = packing.cols.shape
    rows = packing.cols.ravel()
    used = rows >= 0
    columns = np.repeat(np.arange(num), num_sensors)[used]
    matrix = csr_array((np.ones(columns.size), (rows[used], columns)), shape=(packing.num_rows, num))
    slack = packing.slack
    free, must = np.flatnonzero(slack), np.flatnonzero(~slack)

    def solve() -> Any:
        left = run.remaining()
        return linprog(
            packing.weights,
            A_ub=matrix[free] if free.size else None,
            b_ub=np.ones(free.size) if free.size else None,
            A_eq=matrix[must] if must.size else None,
            b_eq=np.ones(must.size) if must.size else None,
            bounds=(0.0, None),
            method="highs-ipm" if num > _LARGE else "highs-ds",
            options={"time_limit": max(left, 0.0)} if left < np.inf else {},
        )

    # HiGHS looks at the clock so seldom that it was seen to be 2.4 s late
    answer = solve() if run.time_limit is None else in_time(solve, run.remaining(), "linear program")
    if answer is None or answer.status != 0:
        return None
    duals = np.zeros(packing.num_rows)
    if free.size:
        duals[free] = np.minimum(answer.ineqlin.marginals, 0.0)
    if must.size:
        duals[must] = answer.eqlin.marginals
    return duals
