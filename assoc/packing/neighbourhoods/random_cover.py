"""A random greedy cover: the walk that ants, breeding and tabu search share."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from assoc._system.clock import now
from assoc._system.compiled import njit
from assoc._types import Floats
from assoc.packing.components.component import Part
from assoc.packing.neighbourhoods.insertion import _improve


def random_cover(part: Part, weights: Floats, strictness: float, rng: np.random.Generator) -> NDArray[np.int32]:
    """Return a random greedy cover, as one ant builds it where no pheromone lies; the larger the stricter."""
    packing = part.packing
    owner, _ = walk(
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
def walk(
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
                if fits(cols, owner, j):
                    total += value[j]
            draw = rng.random() * total - stay[r]
            if draw < 0.0:
                continue
            chosen = -1
            for k in range(row_ptr[r], row_ptr[r + 1]):
                j = row_cols[k]
                if fits(cols, owner, j):
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
def fits(cols: Any, owner: Any, j: int) -> bool:
    """Whether all rows of column j are free."""
    for s in range(cols.shape[1]):
        if cols[j, s] >= 0 and owner[cols[j, s]] >= 0:
            return False
    return True
