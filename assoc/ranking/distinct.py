"""Sorting of distinct tuples, for problems of a million tuples."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import njit
from assoc._types import Ints
from assoc.packing.kernels.sorting import ascending_whole


def distinct(tuples: NDArray[np.int32]) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
    """Return the distinct tuples in lexicographic order, and the index of each tuple among them."""
    sides = _largest(tuples) + 1
    order = np.arange(len(tuples), dtype=np.int32)
    if float(np.prod(sides, dtype=float)) < 2.0**62:
        order = ascending_whole(_as_numbers(tuples, sides))
    else:
        for column in tuples.T[::-1]:
            order = order[ascending_whole(column[order].astype(np.int64))]
    new, index = _indices(tuples, order)
    return tuples[order[new]], index


@njit
def _largest(tuples: Ints) -> Any:
    """Each sensor's largest measurement number."""
    num, num_sensors = tuples.shape
    largest = np.zeros(num_sensors, np.int64)
    for j in range(num):
        for s in range(num_sensors):
            largest[s] = max(largest[s], tuples[j, s])
    return largest


@njit
def _as_numbers(tuples: Ints, sides: Ints) -> Any:
    """Numbers that order the tuples lexicographically."""
    num, num_sensors = tuples.shape
    numbers = np.zeros(num, np.int64)
    for j in range(num):
        for s in range(num_sensors):
            numbers[j] = numbers[j] * sides[s] + tuples[j, s]
    return numbers


@njit
def _indices(tuples: Ints, order: Ints) -> Any:
    """Mask of the sorted tuples that differ from the one before, and each tuple's index among the distinct ones."""
    num, num_sensors = tuples.shape
    new = np.ones(num, np.bool_)
    index = np.empty(num, np.int64)
    count = -1
    for i in range(num):
        j = order[i]
        if i > 0:
            before = order[i - 1]
            same = True
            for s in range(num_sensors):
                same = same and tuples[j, s] == tuples[before, s]
            new[i] = not same
        if new[i]:
            count += 1
        index[j] = count
    return new, index
