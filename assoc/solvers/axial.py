"""Dimensionwise search for dense axial problems: permutations, direct look-up, no memory allocated inside.

A solution is one permutation per dimension, ``perms[s, i]`` the index of dimension s in tuple i. Splitting
the dimensions into two parts splits every tuple into two halves; which halves belong together is a 2-D
assignment, solved to the optimum by ``match_dense``. Over all splits until none improves, this is the
dimensionwise local search of [1]_ and [2]_.

References
----------
.. [1] G. Huang and A. Lim, "A hybrid genetic algorithm for the three-index assignment problem", EJOR 172,
   249-257 (2006).
.. [2] D. Karapetyan and G. Gutin, "Local search heuristics for the multidimensional assignment problem",
   Journal of Heuristics 17, 201-249 (2011).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from assoc._compiled import njit
from assoc.solvers.assignment2d import match_dense

Floats = NDArray[np.float64]


@njit
def tuple_costs(costs: Floats, strides: Any, perms: Any, num: int, result: Floats) -> float:
    total = 0.0
    for i in range(num):
        place = 0
        for s in range(strides.size):
            place += perms[s, i] * strides[s]
        result[i] = costs[place]
        total += costs[place]
    return total


@njit
def rematch(
    costs: Floats, strides: Any, sizes: Any, perms: Any, split: int, noise: float, rng: Any, matrix: Floats, work: Any
) -> float:
    """Re-match the dimensions in ``split`` (a bit set) to the others; returns the change of (noisy) cost."""
    (column_of, row_of, v, distance, previous, queue, pending, left, right) = work
    num = sizes[0]
    num_dims = strides.size
    for s in range(num_dims):
        num = min(num, sizes[s])
    columns = num
    members = 0
    for s in range(num_dims):
        if split >> s & 1:
            members += 1
            columns = sizes[s]
    if members > 1:
        columns = num
    for i in range(num):
        left[i] = 0
    for j in range(columns):
        right[j] = 0
    for s in range(num_dims):
        if split >> s & 1:
            for j in range(columns):
                right[j] += perms[s, j] * strides[s]
        else:
            for i in range(num):
                left[i] += perms[s, i] * strides[s]
    before = 0.0
    if noise > 0.0:
        for i in range(num):
            for j in range(columns):
                matrix[i, j] = costs[left[i] + right[j]] + noise * rng.random()
            before += matrix[i, i]
    else:
        for i in range(num):
            a = left[i]
            for j in range(columns):
                matrix[i, j] = costs[a + right[j]]
            before += matrix[i, i]
    match_dense(matrix, num, columns, column_of, row_of, v, distance, previous, queue, pending)
    after = 0.0
    for i in range(num):
        after += matrix[i, column_of[i]]
    if after >= before - 1e-9:
        return 0.0
    # unused indices keep the places behind
    place = num
    for j in range(columns):
        if row_of[j] < 0:
            queue[place] = j
            place += 1
    for i in range(num):
        queue[i] = column_of[i]
    for s in range(num_dims):
        if split >> s & 1:
            for j in range(columns):
                previous[j] = perms[s, queue[j]]
            for j in range(columns):
                perms[s, j] = previous[j]
    return after - before


@njit
def axial_local_search(costs, strides, sizes, perms, splits, rng, matrix, work) -> None:
    quiet = 0
    at = 0
    while quiet < splits.size:
        if rematch(costs, strides, sizes, perms, splits[at], 0.0, rng, matrix, work) < 0.0:
            quiet = 1
        else:
            quiet += 1
        at += 1
        if at == splits.size:
            at = 0
