"""The guard against more candidate tuples than memory has room for."""

from __future__ import annotations

from assoc.errors import LimitExceededError

MAX_TUPLES = 5_000_000
"""Default limit on the candidate tuples of one scan."""


def refuse(scan: int, expected: float, limit: int) -> LimitExceededError:
    """Make the error that says how many tuples were to be expected and what to change."""
    return LimitExceededError(
        f"scan {scan}: about {expected:.3g} candidate tuples, more than max_tuples = {limit}; "
        "lower gate_probability, split the scan, or raise max_tuples"
    )
