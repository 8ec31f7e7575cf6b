"""Random greedy covers, used by ants, breeding and tabu search.

Rows are visited in random order. For each uncovered row one of the columns that fit is drawn, or none if the row has
slack, with probability proportional to

    tau_j^alpha exp(-beta 2^(ant mod 10) rc_j / T)

with tau_j the pheromone, rc_j the reduced cost and T the temperature; the cover may then be improved by insertion.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from assoc._system.clock import now
from assoc._system.compiled import inner_njit, njit
from assoc._system.kernels.copying import copy_to
from assoc._types import Floats, Ints
from assoc.packing.bounds.priced import ReducedCosts
from assoc.packing.kernels.columns import choose, fits, sum_of_weights
from assoc.packing.neighbourhoods.insertion import insert_and_eject
from assoc.packing.packing import PackingArrays


class Trail(NamedTuple):
    """Pheromone and parameters of a walk's draws."""

    pheromone: Floats
    """Of the columns, (N,)."""
    slack_pheromone: Floats
    """Of leaving a row uncovered, (R,)."""
    alpha: float
    """Exponent of the pheromone."""
    beta: float
    """Exponent of the visibility."""
    temperature: float
    """Scale of the relevant reduced costs."""

    @classmethod
    def without_pheromone(cls, costs: ReducedCosts, strictness: float, temperature: float) -> Trail:
        """Return a trail in which only reduced costs count."""
        return cls(np.ones(costs.reduced.size), np.ones(costs.duals.size), 1.0, strictness, temperature)


@inner_njit
def _first_fitting(packing: PackingArrays, owner: Ints, r: int) -> int:
    """The first column of a row that fits; -1 if none does."""
    for k in range(packing.row_ptr[r], packing.row_ptr[r + 1]):
        if fits(packing.cols, owner, packing.row_cols[k]):
            return int(packing.row_cols[k])
    return -1


@inner_njit
def _cover_row(packing: PackingArrays, r: int, value: Floats, stay: float, owner: Ints, rng: Any) -> None:
    """Draw one of the columns of an open row that fit, or none, by their values and that of staying uncovered."""
    cols, row_ptr, row_cols = packing.cols, packing.row_ptr, packing.row_cols
    total = stay
    for k in range(row_ptr[r], row_ptr[r + 1]):
        j = row_cols[k]
        # most values are 0, which is quicker to test than whether a column fits
        if value[j] > 0.0 and fits(cols, owner, j):
            total += value[j]
    draw = rng.random() * total - stay
    if draw < 0.0:
        return
    chosen = -1
    for k in range(row_ptr[r], row_ptr[r + 1]):
        j = row_cols[k]
        if value[j] > 0.0 and fits(cols, owner, j):
            draw -= value[j]
            chosen = j
            if draw < 0.0:
                break
    if chosen < 0:
        chosen = _first_fitting(packing, owner, r)
    if chosen >= 0:
        choose(cols, chosen, owner)


@njit
def walk(
    packing: PackingArrays, costs: ReducedCosts, trail: Trail, ants: int, inserts: bool, rng: Any, deadline: float
) -> Any:
    """Let all ants build a cover, until time is over; return the best one and its weight.

    With ``inserts`` each cover is improved by insertion with ejection. An incomplete cover is returned only if no ant
    built a complete one.
    """
    cols, weights, slack = packing.cols, packing.weights, packing.slack
    reduced, duals = costs
    alpha, beta, temperature = trail.alpha, trail.beta, trail.temperature
    num, num_rows = weights.size, slack.size
    value = np.empty(num)
    # in loops: numpy's powers of arrays are rounded differently where this is interpreted
    trace, slack_trace = np.empty(num), np.empty(num_rows)
    for j in range(num):
        trace[j] = trail.pheromone[j] ** alpha
    for r in range(num_rows):
        slack_trace[r] = trail.slack_pheromone[r] ** alpha
    stay = np.zeros(num_rows)
    best = np.full(num_rows, -1, np.int32)
    best_weight = np.inf
    owner = np.empty(num_rows, np.int32)
    order, everything = np.empty(num_rows, np.int32), np.empty(num_rows, np.int32)
    for r in range(num_rows):
        order[r] = everything[r] = r
    timed = deadline < np.inf
    for ant in range(ants):
        if timed and now() > deadline:
            break
        # ants follow the visibility more or less strictly: some explore, some refine
        strictness = beta * 2.0 ** (ant % 10) / temperature
        for j in range(num):
            power = strictness * reduced[j]
            value[j] = trace[j] * math.exp(-power) if power < 40.0 else 0.0
        for r in range(num_rows):
            if slack[r]:
                stay[r] = slack_trace[r] * math.exp(strictness * min(duals[r], 0.0))
        owner[:] = -1
        for i in range(num_rows - 1, 0, -1):
            k = rng.integers(0, i + 1)
            order[i], order[k] = order[k], order[i]
        for i in range(num_rows):
            if owner[order[i]] < 0:
                _cover_row(packing, order[i], value, stay[order[i]], owner, rng)
        if inserts:
            insert_and_eject(packing, owner, everything, deadline)
        weight = sum_of_weights(cols, weights, owner)
        if weight < best_weight:
            best_weight = weight
            copy_to(best, owner)
    return best, best_weight
