"""The smallest and the largest of many numbers that are not negative, several at a time.

Such numbers are ordered as their bits are, read as whole numbers. Of whole numbers compilers find the smallest without
a branch, for several at a time; of floating point they may not, as among these there can be what is no number.
"""

from __future__ import annotations

import numpy as np

from assoc._system.compiled import inner_njit
from assoc._types import Floats


@inner_njit
def smallest(values: Floats, count: int) -> float:
    """The smallest of the first ``count`` numbers, none of them negative; ``inf`` where there are none."""
    bits = values.view(np.int64)
    found = np.full(1, np.inf)
    least = found.view(np.int64)[0]
    for a in range(count):
        least = min(least, bits[a])
    found.view(np.int64)[0] = least
    return float(found[0])


@inner_njit
def place_of_largest(values: Floats, count: int) -> int:
    """The first place of the largest of the first ``count`` numbers, none of them negative; -1 where all are 0."""
    bits = values.view(np.int64)
    most = np.int64(0)
    for a in range(count):
        most = max(most, bits[a])
    place = count
    for a in range(count):
        place = min(place, a if bits[a] == most else count)
    return place if most > 0 else -1
