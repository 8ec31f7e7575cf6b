"""A backend's answer in the packing's units, and checks of it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc.packing.packing import Packing


class Answer(NamedTuple):
    """A backend's answer."""

    columns: NDArray[np.int64] | None
    """The chosen columns, where there is a solution."""
    bound: float
    """No solution has less weight; -inf where the backend has no bound."""
    proven: bool
    """Whether the columns are optimal."""
    infeasible: bool
    """Whether there is no solution."""
    nodes: int
    """Nodes of the search."""


def solution_or_none(packing: Packing, columns: NDArray[np.int64]) -> NDArray[np.int64] | None:
    """Return the columns if they are a solution of the packing, else None."""
    rows = packing.cols[columns]
    covered = np.bincount(rows[rows >= 0], minlength=packing.num_rows)
    wrong = (covered > 1).any() or (covered[~packing.slack] != 1).any()
    return None if wrong else columns


def most_columns(packing: Packing) -> int:
    """Return the largest number of columns that a solution can have."""
    sizes = np.count_nonzero(packing.cols >= 0, axis=1)
    return packing.num_rows // max(int(sizes.min()), 1)
