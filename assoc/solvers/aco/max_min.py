"""Max-min ant system on the rows of a packing.

An ant visits the rows in random order. For a row that is still uncovered it chooses among the columns that
fit, and staying uncovered where the row has slack, with the probability of eq. 8 of the ant colony paper,

    p_j = tau_j^alpha eta_j^beta / sum over what is allowed,    eta_j = exp(-rc_j / T)

The visibility eta is that of the reduced cost rc_j: what choosing j adds to the lower bound; T halves from
ant to ant over a range of 500. Pheromone lies
between tau_min and 1 (hyper-cube form of eq. 9: tau <- rho tau + (1 - rho) [j in the best]) and starts at 1.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from assoc._system.clock import now
from assoc._system.compiled import njit
from assoc.packing.components.component import Part, incomplete
from assoc.packing.neighbourhoods.insertion import _improve, penalised

if TYPE_CHECKING:
    from assoc.solvers.aco.solve import AcoParameters

Floats = NDArray[np.float64]

# cycles without improvement until the pheromone is laid anew
_RENEWAL = 15


class Colony:
    """The pheromone of one part and the ants that walk on it."""

    def __init__(self, part: Part, parameters: AcoParameters) -> None:
        self.parameters = parameters
        self.pheromone = np.ones(part.packing.num_columns)
        self.slack_pheromone = np.ones(part.packing.num_rows)
        self.weights = penalised(part.packing) if part.packing.is_axial else part.packing.weights
        # a tuple chosen nowhere keeps a chance of about 1 / (2 n) against all n rivals of a row together
        degree = part.packing.row_cols.size / max(part.packing.num_rows, 1)
        self.lowest = 1.0 / (2.0 * max(degree, 1.0))
        # the best since the pheromone was laid anew
        self.recent: NDArray[np.int32] | None = None
        self.least = np.inf
        if part.best is not None:
            self._deposit(part.packing.cols, part.best, 1.0 - parameters.rho)

    def iterate(self, part: Part, rng: np.random.Generator) -> None:
        """One cycle: all ants walk, the best is improved, the pheromone evaporates and is laid."""
        packing, p = part.packing, self.parameters
        owner, _ = _walk(
            packing.cols,
            self.weights,
            packing.slack,
            packing.row_ptr,
            packing.row_cols,
            part.reduced,
            part.duals,
            self.pheromone,
            self.slack_pheromone,
            p.alpha,
            p.beta,
            part.temperature,
            p.ants,
            rng,
            part.deadline,
        )
        weight = part.polish(owner)
        if weight - part.bound > part.tolerance:
            weight += part.improve(owner, rng, p.clusters)
        part.offer(owner, weight)
        if weight < self.least and not incomplete(part, owner):
            self.recent, self.least = owner, weight
        elite = self.recent if self.recent is not None and part.iterations % 3 == 2 else owner
        self._deposit(packing.cols, elite, 1.0 - p.rho)
        if part.stalled and part.stalled % _RENEWAL == 0:
            self.pheromone[:] = 1.0
            self.slack_pheromone[:] = 1.0
            self.recent, self.least = None, np.inf

    def _deposit(self, cols: NDArray[np.int32], owner: NDArray[np.int32], share: float) -> None:
        _update(self.pheromone, self.slack_pheromone, owner, share, self.lowest)


def random_cover(part: Part, weights: Floats, strictness: float, rng: np.random.Generator) -> NDArray[np.int32]:
    """Return a random greedy cover, as one ant builds it where no pheromone lies; the larger the stricter."""
    packing = part.packing
    owner, _ = _walk(
        packing.cols,
        weights,
        packing.slack,
        packing.row_ptr,
        packing.row_cols,
        part.reduced,
        part.duals,
        np.ones(packing.num_columns),
        np.ones(packing.num_rows),
        1.0,
        strictness,
        part.temperature,
        1,
        rng,
        part.deadline,
    )
    return owner


@njit
def _update(pheromone: Floats, slack_pheromone: Floats, owner: Any, share: float, lowest: float) -> None:
    """Eq. 9 in hyper-cube form with max-min limits."""
    for j in range(pheromone.size):
        pheromone[j] *= 1.0 - share
    for r in range(owner.size):
        j = owner[r]
        slack_pheromone[r] *= 1.0 - share
        if j >= 0:
            # a column is met once for each of its rows: setting, not adding
            pheromone[j] = -abs(pheromone[j])
        else:
            slack_pheromone[r] += share
        slack_pheromone[r] = max(slack_pheromone[r], lowest)
    for j in range(pheromone.size):
        if pheromone[j] < 0.0:
            pheromone[j] = share - pheromone[j]
        pheromone[j] = max(pheromone[j], lowest)


@njit
def _walk(
    cols: Any,
    weights: Floats,
    slack: Any,
    row_ptr: Any,
    row_cols: Any,
    reduced: Floats,
    duals: Floats,
    pheromone: Floats,
    slack_pheromone: Floats,
    alpha: float,
    beta: float,
    temperature: float,
    ants: int,
    rng: Any,
    deadline: float,
) -> Any:
    """Let all ants build a cover and improve it by insertion, until time is over; the best one and its weight."""
    num, num_sensors = cols.shape
    num_rows = slack.size
    value = np.empty(num)
    trail = pheromone**alpha
    slack_trail = slack_pheromone**alpha
    stay = np.zeros(num_rows)
    best = np.full(num_rows, -1, np.int32)
    best_weight = np.inf
    owner = np.empty(num_rows, np.int32)
    order = np.arange(num_rows).astype(np.int32)
    everything = np.arange(num_rows).astype(np.int32)
    timed = deadline < np.inf
    for ant in range(ants):
        if timed and now() > deadline:
            break
        # ants differ in how strictly they follow the visibility: some explore, some refine
        strictness = beta * 2.0 ** (ant % 10) / temperature
        for j in range(num):
            power = strictness * reduced[j]
            value[j] = trail[j] * np.exp(-power) if power < 40.0 else 0.0
        for r in range(num_rows):
            if slack[r]:
                stay[r] = slack_trail[r] * np.exp(strictness * min(duals[r], 0.0))
        owner[:] = -1
        for i in range(num_rows - 1, 0, -1):
            k = rng.integers(0, i + 1)
            order[i], order[k] = order[k], order[i]
        for i in range(num_rows):
            r = order[i]
            if owner[r] >= 0:
                continue
            total = stay[r]
            for k in range(row_ptr[r], row_ptr[r + 1]):
                j = row_cols[k]
                if _fits(cols, owner, j):
                    total += value[j]
            draw = rng.random() * total - stay[r]
            if draw < 0.0:
                continue
            chosen = -1
            for k in range(row_ptr[r], row_ptr[r + 1]):
                j = row_cols[k]
                if _fits(cols, owner, j):
                    draw -= value[j]
                    if value[j] > 0.0 or chosen < 0:
                        chosen = j
                    if draw < 0.0:
                        break
            if chosen >= 0:
                for s in range(num_sensors):
                    if cols[chosen, s] >= 0:
                        owner[cols[chosen, s]] = chosen
        _improve(cols, weights, row_ptr, row_cols, owner, everything, deadline)
        weight = 0.0
        for r in range(num_rows):
            j = owner[r]
            if j >= 0:
                for s in range(num_sensors):
                    if cols[j, s] >= 0:
                        if cols[j, s] == r:
                            weight += weights[j]
                        break
        if weight < best_weight:
            best_weight = weight
            best[:] = owner
    return best, best_weight


@njit
def _fits(cols: Any, owner: Any, j: int) -> bool:
    for s in range(cols.shape[1]):
        if cols[j, s] >= 0 and owner[cols[j, s]] >= 0:
            return False
    return True
