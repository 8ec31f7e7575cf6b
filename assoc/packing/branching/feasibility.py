"""Find any solution of a problem without dummies, or prove that there is none."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assoc.errors import LimitExceededError
from assoc.packing.bounds.dual_ascent import dual_bound
from assoc.packing.branching.search import BranchAndBound
from assoc.packing.packing import Packing
from assoc.packing.run import FIRST_NODES, Run


def first_solution(packing: Packing, run: Run, nodes: int = FIRST_NODES) -> NDArray[np.int32] | None:
    """Return the columns of a complete solution; None if there is none, or time or nodes are used up."""
    if bool((~packing.slack & (np.diff(packing.row_ptr) == 0)).any()):
        return None
    chosen = []
    for c in range(packing.num_components):
        part = packing.component(c)
        search = BranchAndBound(part, dual_bound(part, run=run), np.inf, 1e-9, run.deadline, run.memory_allows)
        while search.columns is None and not search.done and search.nodes < nodes and not run.should_stop():
            search.run(20)
        if search.columns is None and not search.done and not run.should_stop():
            run.stopped_by = "iterations"
        if search.columns is None:
            if search.out_of_memory:
                raise LimitExceededError("no memory to find out whether there is a solution; split the problem")
            return None
        chosen.append(part.origin[search.columns])
    return np.concatenate(chosen) if chosen else np.zeros(0, dtype=np.int32)
