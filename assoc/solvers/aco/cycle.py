"""State of a colony after a cycle: pheromone, visibility and probability of every node."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._types import Floats
from assoc.packing.components.component import Component
from assoc.packing.packing import Packing

if TYPE_CHECKING:
    from assoc.solvers.aco.max_min import Colony


class Cycle(NamedTuple):
    """The state of a colony after a cycle; a node is a column of the packing, or a row that may stay uncovered.

    Attributes
    ----------
    number : int
        Number of the cycle, from 1; mode mmas counts for each component.
    columns : int array, shape (n,)
        Columns of the packing that are nodes of this colony.
    rows : int array, shape (r,)
        Rows of the packing that may stay uncovered, as nodes; these are the last r nodes.
    pheromone, visibility, probability : float arrays, shape (n + r,)
        tau_j, eta_j, and p_j of eq. 8, for the first ant of the next cycle (a better solution found in between makes
        ants stricter). Mode paper: while all nodes are allowed. Mode mmas: at a row whose columns all still fit; for a
        column the mean over its rows.
    tuples : int32 array, shape (n + r, S), or None
        The tuple of each node, set by ``assign``; None inside solvers, which know only columns.
    """

    number: int
    columns: NDArray[np.int64]
    rows: NDArray[np.int64]
    pheromone: Floats
    visibility: Floats
    probability: Floats
    tuples: NDArray[np.int32] | None = None


def tuples_of(
    tuples: NDArray[np.int32],
    sizes: NDArray[np.integer],
    packing: Packing,
    columns: NDArray[np.int64],
    rows: NDArray[np.int64],
) -> NDArray[np.int32]:
    """Return the tuples of nodes: of columns, and of rows that stay uncovered (false alarms).

    ``tuples`` (M, S) and ``sizes`` (S,) are those of the problem from which the packing was made.
    """
    starts = np.cumsum(sizes) - sizes
    through = packing.row_origin[rows]
    # a sensor without measurements starts at the same index as the next sensor
    sensor = np.searchsorted(starts, through, side="right") - 1
    alone = np.zeros((rows.size, sizes.size), dtype=np.int32)
    alone[np.arange(rows.size), sensor] = through - starts[sensor] + 1
    return np.concatenate([tuples[packing.origin[columns]], alone])


def cycle_of(whole: Packing, component: Component, colony: Colony) -> Cycle:
    """Return the state of a max-min colony on a component of a packing."""
    packing, parameters = component.packing, colony.parameters
    used = packing.cols >= 0
    row_of = np.full(packing.num_rows, -1, dtype=np.int64)
    row_of[packing.cols[used]] = whole.cols[component.origin][used]
    free = np.flatnonzero(packing.slack & (row_of >= 0))
    # a column adds its reduced cost to the bound, an uncovered row minus its multiplier
    seen = np.exp(-component.reduced / component.temperature)
    seen_alone = np.where(packing.slack, np.exp(np.minimum(component.duals, 0.0) / component.temperature), 0.0)
    value = colony.pheromone**parameters.alpha * seen**parameters.beta
    alone = colony.slack_pheromone**parameters.alpha * seen_alone**parameters.beta
    row = np.repeat(np.arange(packing.num_rows), np.diff(packing.row_ptr))
    total = alone + np.bincount(row, value[packing.row_cols], packing.num_rows)
    total[total <= 0.0] = 1.0
    shares = np.bincount(packing.row_cols, value[packing.row_cols] / total[row], packing.num_columns)
    return Cycle(
        component.iterations + 1,
        component.origin,
        row_of[free],
        np.concatenate([colony.pheromone, colony.slack_pheromone[free]]),
        np.concatenate([seen, seen_alone[free]]),
        np.concatenate([shares / used.sum(axis=1), (alone / total)[free]]),
    )
