"""A binary heap of (key, item) in arrays."""

from __future__ import annotations

from typing import Any

import numpy as np

from assoc._system.compiled import inner_njit
from assoc._types import Array, Floats, Ints


@inner_njit
def doubled(array: Array) -> Any:
    """Return a copy of twice the size."""
    larger = np.empty(2 * array.size, array.dtype)
    for i in range(array.size):
        larger[i] = array[i]
    return larger


@inner_njit
def doubled_rows(table: Array) -> Any:
    """Return a copy of a table with twice as many rows."""
    num, width = table.shape
    larger = np.empty((2 * num, width), table.dtype)
    for i in range(num):
        for k in range(width):
            larger[i, k] = table[i, k]
    return larger


@inner_njit
def push(key: Floats, item: Ints, size: int, value: float, thing: int) -> None:
    """Add an item under a key; ``size`` is the number of items before."""
    index = size
    while index > 0:
        parent = (index - 1) >> 1
        if key[parent] <= value:
            break
        key[index] = key[parent]
        item[index] = item[parent]
        index = parent
    key[index] = value
    item[index] = thing


@inner_njit
def pop(key: Floats, item: Ints, size: int) -> None:
    """Remove the root; ``size`` is the number of items left."""
    value = key[size]
    thing = item[size]
    index = 0
    while True:
        child = 2 * index + 1
        if child >= size:
            break
        if child + 1 < size and key[child + 1] < key[child]:
            child += 1
        if key[child] >= value:
            break
        key[index] = key[child]
        item[index] = item[child]
        index = child
    key[index] = value
    item[index] = thing
