"""The guard against more candidate tuples than memory has room for."""

from __future__ import annotations

from assoc.errors import LimitExceededError

MAX_TUPLES = 5_000_000
"""Default limit on the candidate tuples of one scan."""


def too_many(found: int, share: float, limit: int) -> bool:
    """Whether more than `limit` tuples were found, or clearly will be after this `share` of the search."""
    return found > limit or (found > 0.05 * limit and found > 2.0 * share * limit)


def refuse(scan: int, expected: float, limit: int) -> LimitExceededError:
    """Make the error with the expected number of tuples and what to change."""
    return LimitExceededError(
        f"scan {scan}: about {expected:.3g} candidate tuples, more than max_tuples = {limit}; "
        "lower gate_probability, split the scan, or raise max_tuples"
    )
