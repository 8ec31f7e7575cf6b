"""Bounds of what a metaheuristic leaves open."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assoc._types import Floats
from assoc.packing.bounds.dual_ascent import dual_bound
from assoc.packing.branching.search import BranchAndBound
from assoc.packing.components.component import Part
from assoc.packing.components.splitting import _columns, split_components
from assoc.packing.neighbourhoods.cover import Cover
from assoc.packing.packing import Packing
from assoc.packing.run import Run

_PROOF_NODES = 2000


def bound_of_part(part: Part, run: Run) -> float:
    """Raise the bound of an open part by a short branch and bound."""
    if part.closed:
        # whole-numbered weights: nothing fits between the bound and the cover
        return part.weight if part.packing.granularity else min(part.bound, part.weight)
    if run.should_stop():
        return part.bound
    search = BranchAndBound(part.packing, part.duals, part.weight, part.tolerance, run.deadline(), run.memory_allows)
    while not search.done and search.nodes < _PROOF_NODES and not run.should_stop():
        search.run(50)
    return min(max(part.bound, search.lower_bound), part.weight)


def bound_of_choice(packing: Packing, columns: NDArray[np.integer], run: Run) -> tuple[float, Floats]:
    """Return a valid bound, made tight enough to prove this choice of columns where it is optimal.

    Parameters
    ----------
    packing : Packing
        The problem.
    columns : int array
        A complete choice of columns.
    run : Run
        Clock.

    Returns
    -------
    float, float array
        The bound and the multipliers that give its dual part.
    """
    duals = dual_bound(packing, run=run)
    owner = Cover.of(packing, columns).owner
    total = 0.0
    for c, part in enumerate(split_components(packing, duals, np.arange(packing.num_columns))):
        own = owner[packing.row_start[c] : packing.row_start[c + 1]]
        part.best = np.where(own >= 0, own - packing.col_start[c], -1).astype(np.int32)
        part.weight = float(part.packing.weights[_columns(part)].sum())
        total += bound_of_part(part, run)
    return total, duals
