"""A choice of columns that share no row, changed in place."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import njit
from assoc._types import Floats, Ints
from assoc.packing.kernels.columns import choose_all, first_row
from assoc.packing.neighbourhoods.insertion import add_greedily, insert_and_eject, search_arrays
from assoc.packing.packing import Packing, find
from assoc.packing.run import Run

# seconds to complete a cover when time is over
_GRACE = 0.02


class Cover:
    """A choice of columns that share no row, changed in place.

    Attributes
    ----------
    owner : int32 array, shape (R,)
        The chosen column that uses each row, or -1.
    """

    def __init__(self, packing: Packing, owner: NDArray[np.int32]) -> None:
        self.packing = packing
        self.owner = owner

    @classmethod
    def empty(cls, packing: Packing) -> Cover:
        """Return the cover without any column."""
        return cls(packing, np.full(packing.num_rows, -1, dtype=np.int32))

    @classmethod
    def of(cls, packing: Packing, columns: NDArray[np.integer]) -> Cover:
        """Return the cover of columns that share no row."""
        cover = cls.empty(packing)
        choose_all(packing.arrays.cols, np.asarray(columns, dtype=np.int32), cover.owner)
        return cover

    def columns(self) -> NDArray[np.int32]:
        """Return the chosen columns, ascending."""
        return chosen_columns(self.packing.arrays.cols, self.owner)

    @property
    def weight(self) -> float:
        """Total weight of the chosen columns."""
        return weight_of(self.packing, self.owner)

    @property
    def is_complete(self) -> bool:
        """Whether all rows without slack are covered."""
        return is_complete(self.packing, self.owner)

    def add_greedily(self, order: NDArray[np.integer]) -> None:
        """Add columns in the given order while they fit; with slack only those of negative weight."""
        add_greedily(self.packing.arrays, order, self.owner)

    def improve(self, deadline: float = np.inf) -> None:
        """Insert with ejection until no insertion improves or time is over (clock.py)."""
        rows = np.arange(self.packing.num_rows, dtype=np.int32)
        insert_and_eject(search_arrays(self.packing), self.owner, rows, deadline)

    def complete(self, run: Run) -> bool:
        """Cover all rows without slack, by ejections and then by the run's last resort; return False if that fails.

        Raises
        ------
        InfeasibleError
            Never; the caller knows the problem's words for it.
        """
        if self.is_complete:
            return True
        # a moment beyond the time, if necessary: it usually suffices, and there is nothing else to return
        self.improve(max(run.deadline(), time.monotonic() + _GRACE))
        if self.is_complete:
            return True
        if run.fallback is not None and run.should_stop():
            # there is another solution to return
            return False
        last_resort = run.methods.first_solution
        columns = None if last_resort is None else last_resort(self.packing, run)
        if columns is None:
            return False
        self.owner[:] = Cover.of(self.packing, columns).owner
        return True


def weight_of(packing: Packing, owner: NDArray[np.int32]) -> float:
    """Return the weight of a cover."""
    return float(packing.weights[chosen_columns(packing.arrays.cols, owner)].sum())


def is_complete(packing: Packing, owner: NDArray[np.int32]) -> bool:
    """Return whether a cover covers all rows without slack."""
    return not bool((owner[~packing.slack] < 0).any())


@njit
def chosen_columns(cols: Ints, owner: Ints) -> Any:
    """The chosen columns, ascending, of the dtype of ``owner``."""
    chosen = np.zeros(cols.shape[0], np.bool_)
    count = 0
    for j in owner:
        if j >= 0 and not chosen[j]:
            chosen[j] = True
            count += 1
    result = np.empty(count, owner.dtype)
    count = 0
    for j in range(chosen.size):
        if chosen[j]:
            result[count] = j
            count += 1
    return result


@njit
def best_of_both(
    cols: NDArray[np.int32],
    weights: Floats,
    top: int,
    end: int,
    owner: NDArray[np.int32],
    other: NDArray[np.int32],
    parent: NDArray[np.int32],
    gain: Floats,
) -> float:
    """Take over from another complete cover of a component where that is lighter; returns the weight then.

    Where two covers differ, the columns of both form groups that share no row: each can be exchanged alone.
    """
    for r in range(top, end):
        parent[r] = r
        gain[r] = 0.0
    for r in range(top, end):
        for j in (owner[r], other[r]):
            if j >= 0:
                first, second = find(parent, r), find(parent, first_row(cols, j))
                parent[max(first, second)] = min(first, second)
    for r in range(top, end):
        root = find(parent, r)
        if owner[r] >= 0 and first_row(cols, owner[r]) == r:
            gain[root] += weights[owner[r]]
        if other[r] >= 0 and first_row(cols, other[r]) == r:
            gain[root] -= weights[other[r]]
    total = 0.0
    for r in range(top, end):
        root = find(parent, r)
        if gain[root] > 0.0:
            owner[r] = other[r]
        if owner[r] >= 0 and first_row(cols, owner[r]) == r:
            total += weights[owner[r]]
    return total
