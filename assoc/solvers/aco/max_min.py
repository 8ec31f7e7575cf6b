"""Max-min ant system on the rows of a packing.

An ant visits the rows in random order. For a row that is still uncovered it chooses among the columns that
fit, and staying uncovered where the row has slack, with the probability of eq. 8 of the ant colony paper,

    p_j = tau_j^alpha eta_j^beta / sum over the allowed choices,    eta_j = exp(-rc_j / T)

The visibility eta uses the reduced cost rc_j, which is what choosing j adds to the lower bound. T is halved from ant to
ant, over a range of 500. Pheromone lies between tau_min and 1 and starts at 1 (hyper-cube form of eq. 9:
tau <- rho tau + (1 - rho) [j in the best]).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import njit
from assoc._types import Floats
from assoc.packing.components.component import Component
from assoc.packing.neighbourhoods.random_cover import Trail, walk

if TYPE_CHECKING:
    from assoc.solvers.aco.parameters import AcoParameters


# cycles without improvement after which the pheromone is reset
_RENEWAL = 15


class Colony:
    """The pheromone of one component and its ants."""

    def __init__(
        self,
        component: Component,
        parameters: AcoParameters,
        report: Callable[[Component, Colony], object],
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
        self.dives = 0
        # the least weight known after the last cycle
        self.known = component.weight
        if component.best is not None:
            self._deposit(component.packing.cols, component.best, 1.0 - parameters.rho)

    def iterate(self, component: Component, rng: np.random.Generator) -> None:
        """One cycle: all ants walk, the best is improved, the pheromone evaporates and is laid."""
        packing, p = component.packing, self.parameters
        if component.best is not None and component.weight < min(self.known, self.least) - component.tolerance:
            # a better solution came from refinement or another worker since the last cycle
            self.recent, self.least = component.best.copy(), component.weight
        trail = Trail(self.pheromone, self.slack_pheromone, float(p.alpha), float(p.beta), component.temperature)
        inserts, deadline = component.inserts, component.deadline
        owner, _ = walk(component.arrays, component.prices, trail, p.ants, inserts, rng, deadline)
        weight = component.settle(owner, rng, p.clusters)
        for _ in range(p.divers):
            if not component.dives:
                break
            other = component.dive(self.dives, rng, self.pheromone**p.alpha, p.beta)
            self.dives += 1
            reached = component.settle(other, rng, p.clusters)
            if reached < weight and component.is_complete(other):
                owner, weight = other, reached
        if weight < self.least and component.is_complete(owner):
            self.recent, self.least = owner, weight
        elite = self.recent if self.recent is not None and component.iterations % 3 == 2 else owner
        self._deposit(packing.cols, elite, 1.0 - p.rho)
        if component.stalled and component.stalled % _RENEWAL == 0:
            self.pheromone[:] = 1.0
            self.slack_pheromone[:] = 1.0
            self.recent, self.least = None, np.inf
        self.known = component.weight
        self._report(component, self)

    def _deposit(self, cols: NDArray[np.int32], owner: NDArray[np.int32], share: float) -> None:
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
