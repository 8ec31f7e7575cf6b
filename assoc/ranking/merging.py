"""The lightest combinations of one solution from each of several ranked lists."""

from __future__ import annotations

from typing import Any

import numpy as np

from assoc._system.compiled import inner_njit, njit
from assoc._types import Array, Floats, Ints
from assoc.packing.kernels.heap import pop, push


@njit
def merge(start: Ints, weights: Floats, k: int) -> Any:
    """Combine the ranked lists of independent components into the k lightest choices of one of each.

    List c is ``weights[start[c]:start[c + 1]]``, ascending and not empty. Returns m <= k weights, ascending, and the
    index into each component's list, (m, C).
    """
    num_lists = start.size - 1
    total = np.zeros(1)
    steps = 0
    for c in range(num_lists):
        if start[c + 1] - start[c] > 1:
            steps += 1
    # one level for each list of two or more: the combination of the lists before, and the index in this one
    before = np.empty((steps, 1), np.int32)
    which = np.empty((steps, 1), np.int32)
    level = 0
    for c in range(num_lists):
        first = start[c]
        length = start[c + 1] - first
        if length == 1:
            total += weights[first]
            continue
        room = min(k, total.size * length)
        if room > before.shape[1]:
            before = _wider(before, room)
            which = _wider(which, room)
        result = np.empty(room)
        heap = np.empty(total.size)
        item = np.empty(total.size, np.int64)
        index = np.zeros(total.size, np.int64)
        size = 0
        # combination t of the lists before enters once t - 1 has been used with this list's first solution
        push(heap, item, size, total[0] + weights[first], 0)
        size += 1
        for n in range(room):
            value = heap[0]
            t = item[0]
            size -= 1
            pop(heap, item, size)
            result[n] = value
            before[level, n] = t
            which[level, n] = index[t]
            if index[t] == 0 and t + 1 < total.size:
                push(heap, item, size, total[t + 1] + weights[first], t + 1)
                size += 1
            index[t] += 1
            if index[t] < length:
                push(heap, item, size, total[t] + weights[first + index[t]], t)
                size += 1
        total = result
        level += 1
    choice = np.zeros((total.size, num_lists), np.int32)
    for n in range(total.size):
        t = n
        level = steps
        for c in range(num_lists - 1, -1, -1):
            if start[c + 1] - start[c] > 1:
                level -= 1
                choice[n, c] = which[level, t]
                t = before[level, t]
    return total, choice


@inner_njit
def _wider(array: Array, columns: int) -> Any:
    result = np.empty((array.shape[0], columns), np.int32)
    for i in range(array.shape[0]):
        for k in range(array.shape[1]):
            result[i, k] = array[i, k]
    return result
