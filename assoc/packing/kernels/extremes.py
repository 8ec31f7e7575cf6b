"""The smallest and the largest of many numbers that are not negative, several at a time.

Such numbers are ordered as their bits are, read as whole numbers. Of whole numbers compilers find the smallest without
a branch, for several at a time; of floating point they may not, as among these there can be what is no number.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import inner_njit


@inner_njit
def place_of_smallest(bits: NDArray[np.int64], count: int) -> int:
    """The first place of the smallest of the first ``count`` numbers, given as their bits; ``count`` where it is 0."""
    least = np.int64(2**63 - 1)
    for a in range(count):
        least = min(least, bits[a])
    place = count
    for a in range(count):
        place = min(place, a if bits[a] == least else count)
    return place


@inner_njit
def place_of_largest(bits: NDArray[np.int64], count: int) -> int:
    """The first place of the largest of the first ``count`` numbers, given as their bits; -1 where all are 0."""
    most = np.int64(0)
    for a in range(count):
        most = max(most, bits[a])
    place = count
    for a in range(count):
        place = min(place, a if bits[a] == most else count)
    return place if most > 0 else -1
