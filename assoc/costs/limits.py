"""The guard against more candidate tuples than memory has room for."""

from __future__ import annotations

import math
from collections.abc import Iterable

from assoc._system import memory
from assoc.errors import LimitExceededError

MAX_TUPLES = 5_000_000
"""Default limit on the candidate tuples of tracks in one step."""

# bytes at the peak for each candidate tuple while a problem of three sensors is built and solved
_BYTES = 300.0


def fitting(sizes: Iterable[int]) -> int:
    """Return how many candidate tuples of lists of these sizes the available memory has room for."""
    return memory.at_most(min(math.prod(size + 1 for size in sizes), 2**31 - 1), _BYTES)


def too_many(found: int, share: float, limit: int) -> bool:
    """Whether more than `limit` tuples were found, or clearly will be after this `share` of the search."""
    return found > limit or (found > 0.05 * limit and found > 2.0 * share * limit)


def refuse(scan: int, expected: float, limit: int) -> LimitExceededError:
    """Make the error with the expected number of tuples and what to change."""
    return LimitExceededError(
        f"scan {scan}: about {expected:.3g} candidate tuples ({memory.in_words(_BYTES * expected)}), more than "
        f"max_tuples = {limit}; lower gate_probability, split the scan, or raise max_tuples"
    )


def refuse_of_tracks(expected: float, limit: int) -> LimitExceededError:
    """The same for tuples of tracks and measurements."""
    return LimitExceededError(
        f"about {expected:.3g} candidate tuples of tracks and measurements, more than max_tuples = {limit}; "
        "lower gate_probability or raise max_tuples"
    )
