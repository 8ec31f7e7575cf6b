"""Max-min ant system on the rows of a packing.

An ant visits the rows in random order. For a row that is still uncovered it chooses among the columns that
fit, and staying uncovered where the row has slack, with the probability of eq. 8 of the ant colony paper,

    p_j = tau_j^alpha eta_j^beta / sum over the allowed choices,    eta_j = exp(-rc_j / T)

That walk is `packing/neighbourhoods/random_cover.py`; here are the cycle and the pheromone.
The visibility eta uses the reduced cost rc_j, which is what choosing j adds to the lower bound. T is halved from ant to
ant, over a range of 500. Pheromone lies between tau_min and 1 and starts at 1 (hyper-cube form of eq. 9:
tau <- rho tau + (1 - rho) [j in the best]).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import njit
from assoc._types import Floats
from assoc.packing.component import Component
from assoc.packing.local_search import LocalSearch
from assoc.packing.neighbourhoods.random_cover import Trail
from assoc.packing.packing import Packing

if TYPE_CHECKING:
    from assoc.solvers.aco.parameters import AcoParameters


# cycles without improvement after which the pheromone is reset
_RENEWAL = 15


class Colony:
    """The pheromone of one component and its ants."""

    def __init__(
        self, component: Component, parameters: AcoParameters, report: Callable[[Component, Colony], object]
    ) -> None:
        self.parameters = parameters
        self._report = report
        self.pheromone = np.ones(component.packing.num_columns)
        self.slack_pheromone = np.ones(component.packing.num_rows)
        # an unchosen tuple keeps a chance of about 1 / (2 n) against all n rivals of a row together
        degree = component.packing.row_cols.size / max(component.packing.num_rows, 1)
        self.lowest = 1.0 / (2.0 * max(degree, 1.0))
        # the best solution since the pheromone was reset
        self.recent: NDArray[np.int32] | None = None
        self.least = np.inf
        # the least weight known after the last cycle
        self.least_before = component.weight
        if component.best is not None:
            self._deposit(component.best, 1.0 - parameters.rho)

    def iterate(self, search: LocalSearch) -> None:
        """One cycle: all ants walk, the best is improved, the pheromone evaporates and is laid."""
        component, p = search.component, self.parameters
        if component.best is not None and component.weight < min(self.least_before, self.least) - component.tolerance:
            # a better solution came from refinement or another worker since the last cycle
            self.recent, self.least = component.best.copy(), component.weight
        trail = Trail(self.pheromone, self.slack_pheromone, float(p.alpha), float(p.beta), component.temperature)
        owner = search.walk(trail, p.ants)
        owner, weight = search.settle_best(owner, p.divers, self.pheromone**p.alpha, p.beta)
        if weight < self.least and component.is_complete(owner):
            self.recent, self.least = owner, weight
        elite = self.recent if self.recent is not None and component.iterations % 3 == 2 else owner
        self._deposit(elite, 1.0 - p.rho)
        if component.stalled and component.stalled % _RENEWAL == 0:
            self.pheromone[:] = 1.0
            self.slack_pheromone[:] = 1.0
            self.recent, self.least = None, np.inf
        self.least_before = component.weight
        self._report(component, self)

    def _deposit(self, owner: NDArray[np.int32], share: float) -> None:
        _update(self.pheromone, self.slack_pheromone, owner, share, self.lowest)


@njit
def _update(pheromone: Floats, slack_pheromone: Floats, owner: NDArray[np.int32], share: float, lowest: float) -> None:
    """Eq. 9 in hyper-cube form with max-min limits."""
    for j in range(pheromone.size):
        pheromone[j] *= 1.0 - share
    for r in range(owner.size):
        j = owner[r]
        slack_pheromone[r] *= 1.0 - share
        if j >= 0:
            # set, not added: the loop meets a column once for each of its rows
            pheromone[j] = -abs(pheromone[j])
        else:
            slack_pheromone[r] += share
        slack_pheromone[r] = max(slack_pheromone[r], lowest)
    for j in range(pheromone.size):
        if pheromone[j] < 0.0:
            pheromone[j] = share - pheromone[j]
        pheromone[j] = max(pheromone[j], lowest)


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

    def with_tuples(self, tuples: NDArray[np.int32], sizes: NDArray[np.integer], packing: Packing) -> Cycle:
        """Return the cycle with the tuple of each node; ``tuples``, ``sizes`` as in `tuples_of`."""
        return self._replace(tuples=tuples_of(tuples, sizes, packing, self.columns, self.rows))


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
