"""Sort a million weights in hundredths of a second, for greedy choices.

Kernels call `order_of` and `sort_part`: for each ``np.argsort`` and ``np.sort`` numba would compile another sort into
the kernel.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import inner_njit, lean_inner_njit, njit
from assoc._system.kernels.copying import copy_to
from assoc._types import Array, Floats

# bits of a digit; for fewer numbers radix sort does not pay
_BITS = 11
_FEW = 5000
# length up to which runs are sorted by insertion
_RUN = 16


def ascending(values: Floats) -> NDArray[np.int32]:
    """Return a stable argsort of floats."""
    if values.size < _FEW:
        return np.argsort(values, kind="stable").astype(np.int32)
    # adding 0 turns -0.0 into 0.0, so that equal numbers have equal bits
    return _by_digits((values + 0.0).view(np.int64))


def _order_by_numpy(values: Array) -> Any:
    return np.argsort(values, kind="stable")


@partial(njit, stand_in=_order_by_numpy)
def order_of(values: Array) -> Any:
    """Return a stable argsort, for kernels; the more the values are in order already, the faster."""
    num = values.size
    order, left = np.empty(num, np.int64), np.empty(num, np.int64)
    for i in range(num):
        order[i] = i
    # runs that ascend by themselves; shorter ones are sorted by insertion up to a length of their own
    runs = np.empty(num // _RUN + 2, np.int64)
    count = begin = 0
    while begin < num:
        end = begin + 1
        while end < num and values[end - 1] <= values[end]:
            end += 1
        if end - begin < _RUN:
            end = min(begin + _RUN, num)
            _insert(order, values, begin, end)
        runs[count] = begin
        count += 1
        begin = end
    runs[count] = num
    while count > 1:
        pairs = count // 2
        for p in range(pairs):
            _merge(order, left, values, runs[2 * p], runs[2 * p + 1], runs[2 * p + 2])
            runs[p] = runs[2 * p]
        if count % 2:
            runs[pairs] = runs[count - 1]
        count -= pairs
        runs[count] = num
    return order


@inner_njit
def sort_by(rows: Array, values: Array, begin: int, end: int) -> None:
    """Sort a part of rows, mostly few, in place by their values; those of one value stay in order."""
    if end - begin > _RUN:
        part = rows[begin:end]
        copy_to(part, part[order_of(values[part])])
    else:
        _insert(rows, values, begin, end)


@lean_inner_njit
def sort_part(values: Array, begin: int, end: int) -> None:
    """Sort a part of an array in place: by insertion, first of numbers far apart (Shell's way)."""
    gap = 1
    while 2.25 * gap + 1.0 < end - begin:
        gap = int(2.25 * gap) + 1
    while gap > 0:
        for k in range(begin + gap, end):
            value, at = values[k], k
            while at >= begin + gap and values[at - gap] > value:
                values[at] = values[at - gap]
                at -= gap
            values[at] = value
        gap = int(gap / 2.25)


@lean_inner_njit
def _insert(rows: Array, values: Array, begin: int, end: int) -> None:
    for i in range(begin + 1, end):
        moved, k = rows[i], i
        while k > begin and values[rows[k - 1]] > values[moved]:
            rows[k] = rows[k - 1]
            k -= 1
        rows[k] = moved


@lean_inner_njit
def _merge(order: Array, left: Array, values: Array, begin: int, middle: int, end: int) -> None:
    """Merge two sorted runs of rows side by side, in place; `left` is working space."""
    # what is in its place already stays there
    while begin < middle and values[order[begin]] <= values[order[middle]]:
        begin += 1
    size = middle - begin
    for i in range(size):
        left[i] = order[begin + i]
    i, j = 0, middle
    for k in range(begin, end):
        if i == size:
            break
        if j == end or values[left[i]] <= values[order[j]]:
            order[k] = left[i]
            i += 1
        else:
            order[k] = order[j]
            j += 1


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
        equal = False
        for b in range(base):
            equal = equal or counts[d, b + 1] == num
        if equal:
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
