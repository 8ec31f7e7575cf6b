"""Vectorised minimum and maximum of non-negative floats.

Non-negative floats have the same order as their bits read as integers. Compilers vectorise the minimum of integers
without branches; for floats they may not, because of NaN.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import inner_njit


@inner_njit
def position_of_smallest(bits: NDArray[np.int64], count: int) -> int:
    """Index of the smallest of the first ``count`` numbers, given as their bits; ``count`` if that is 0."""
    least = np.int64(2**63 - 1)
    for a in range(count):
        least = min(least, bits[a])
    index = count
    for a in range(count):
        index = min(index, a if bits[a] == least else count)
    return index


@inner_njit
def position_of_largest(bits: NDArray[np.int64], count: int) -> int:
    """Index of the largest of the first ``count`` numbers, given as their bits; -1 if all are 0."""
    most = np.int64(0)
    for a in range(count):
        most = max(most, bits[a])
    index = count
    for a in range(count):
        index = min(index, a if bits[a] == most else count)
    return index if most > 0 else -1
