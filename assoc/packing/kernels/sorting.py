"""Sort a million weights in hundredths of a second, for greedy choices.

Kernels call `order_of`: for each ``np.argsort`` numba would compile another sort into the kernel.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import njit
from assoc._types import Array, Floats

# bits of a digit; for fewer numbers radix sort does not pay
_BITS = 11
_FEW = 5000
# length of the runs sorted by insertion before they are merged
_RUN = 16


def ascending(values: Floats) -> NDArray[np.int32]:
    """Return a stable argsort of floats."""
    if values.size < _FEW:
        return np.argsort(values, kind="stable").astype(np.int32)
    # adding 0 turns -0.0 into 0.0, so that equal numbers have equal bits
    return _by_digits((values + 0.0).view(np.int64))


def ascending_whole(values: NDArray[np.int64]) -> NDArray[np.int32]:
    """Return a stable argsort of integers >= 0."""
    if values.size < _FEW:
        return np.argsort(values, kind="stable").astype(np.int32)
    # as floats, these bits have the same order
    return _by_digits(np.ascontiguousarray(values))


def _order_by_numpy(values: Array) -> Any:
    return np.argsort(values, kind="stable")


@partial(njit, stand_in=_order_by_numpy)
def order_of(values: Array) -> Any:
    """Return a stable argsort, for kernels."""
    num = values.size
    order, other = np.empty(num, np.int64), np.empty(num, np.int64)
    for i in range(num):
        order[i] = i
    for begin in range(0, num, _RUN):
        for i in range(begin + 1, min(begin + _RUN, num)):
            moved = order[i]
            index = i
            while index > begin and values[order[index - 1]] > values[moved]:
                order[index] = order[index - 1]
                index -= 1
            order[index] = moved
    width = _RUN
    while width < num:
        for begin in range(0, num, 2 * width):
            middle, end = min(begin + width, num), min(begin + 2 * width, num)
            i, j = begin, middle
            for index in range(begin, end):
                if i < middle and (j == end or values[order[i]] <= values[order[j]]):
                    other[index] = order[i]
                    i += 1
                else:
                    other[index] = order[j]
                    j += 1
        order, other = other, order
        width *= 2
    return order


@njit
def _by_digits(bits: Array) -> Any:
    """Radix sort of floats by their bits, eleven at a time from the lowest; digits equal in all are skipped."""
    num = bits.size
    digits = 6
    base = 1 << _BITS
    counts = np.zeros((digits, base + 1), np.int64)
    keys = np.empty(num, np.uint64)
    order = np.empty(num, np.int32)
    for i in range(num):
        order[i] = i
        # negative floats: invert all bits; others: set the sign bit
        key = np.uint64(~bits[i] if bits[i] < 0 else bits[i] ^ np.int64(-9223372036854775808))
        keys[i] = key
        for d in range(digits):
            counts[d, np.int64((key >> np.uint64(_BITS * d)) & np.uint64(base - 1)) + 1] += 1
    other = np.empty(num, np.int32)
    other_keys = np.empty(num, np.uint64)
    for d in range(digits):
        shift = np.uint64(_BITS * d)
        if counts[d].max() == num:
            continue
        for b in range(base):
            counts[d, b + 1] += counts[d, b]
        for i in range(num):
            digit = np.int64((keys[i] >> shift) & np.uint64(base - 1))
            at = counts[d, digit]
            counts[d, digit] += 1
            other[at] = order[i]
            other_keys[at] = keys[i]
        order, other = other, order
        keys, other_keys = other_keys, keys
    return order
