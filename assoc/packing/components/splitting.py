"""A packing taken apart into its components, and a component after its columns became fewer."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assoc._types import Floats
from assoc.packing.bounds.dual_ascent import component_bounds, hard_pass, reduced_costs
from assoc.packing.branching.feasibility import infeasible
from assoc.packing.components.component import Part
from assoc.packing.neighbourhoods.cover import chosen_columns
from assoc.packing.packing import Packing


def split_components(packing: Packing, duals: Floats, origin: NDArray[np.int64]) -> list[Part]:
    """Return the components as parts without a cover.

    Raises
    ------
    InfeasibleError
        A row that must be covered has no column.
    """
    bounds = component_bounds(packing, duals)
    if np.isposinf(bounds).any():
        raise infeasible(packing)
    reduced = reduced_costs(packing, duals)
    parts: list[Part] = []
    for c in range(packing.num_components):
        piece = packing.component(c) if packing.num_components > 1 else packing
        top, end = packing.row_start[c], packing.row_start[c + 1]
        first, last = packing.col_start[c], packing.col_start[c + 1]
        parts.append(Part(piece, duals[top:end], reduced[first:last], float(bounds[c]), origin[first:last]))
    return parts


def split_part(part: Part, share: float = 2 / 3) -> list[Part] | None:
    """Drop the columns that no better solution can use; None unless at most ``share`` of them are left."""
    if part.best is None:
        return None
    keep = part.reduced <= part.weight - part.bound - (part.tolerance if part.packing.granularity else 0.0)
    keep[chosen_columns(part.packing.cols, part.best)] = True
    if np.count_nonzero(keep) > share * keep.size:
        return None
    smaller = part.packing.restrict(keep)
    duals = np.where(smaller.slack, np.minimum(part.duals[smaller.row_origin], 0.0), part.duals[smaller.row_origin])
    duals = np.ascontiguousarray(duals)
    hard_pass(smaller, duals, np.empty(smaller.num_columns), 1)
    place = np.full(part.packing.num_columns, -1, dtype=np.int32)
    place[smaller.origin] = np.arange(smaller.num_columns, dtype=np.int32)
    owner = part.best[smaller.row_origin]
    owner = np.where(owner >= 0, place[owner], -1).astype(np.int32)
    pieces = split_components(smaller, duals, part.origin[smaller.origin])
    for c, piece in enumerate(pieces):
        own = owner[smaller.row_start[c] : smaller.row_start[c + 1]]
        piece.best = np.where(own >= 0, own - smaller.col_start[c], -1).astype(np.int32)
        piece.weight = float(piece.packing.weights[_columns(piece)].sum())
        piece.iterations, piece.stalled, piece.deadline = part.iterations, part.stalled, part.deadline
    return pieces


def _columns(part: Part) -> NDArray[np.int64]:
    assert part.best is not None
    return np.asarray(chosen_columns(part.packing.cols, part.best), dtype=np.int64)
