"""Estimates of the probabilities of a cluster's tuples by truncated sweeps, where few sets of measurements matter."""

from __future__ import annotations

import numpy as np

from assoc._types import Floats
from assoc.ranking.columns import AllColumns
from assoc.ranking.estimates.mean_field import mean_field
from assoc.ranking.estimates.row_order import row_order
from assoc.ranking.estimates.truncated_sweep import truncated_sweep

_MOST, _IMPROVED = 22.0, 4.0
"""Logarithm of the states that matter, over all turns, at most; by how much moves of rows may lower it."""
_DROPPED = 0.02
"""Share of the weight that may be dropped at a turn, on average: among ghosts it is more, and estimates are wrong."""
_FEWER = 0.25
"""Share of the states that the sweep compared with keeps."""
_MUST = 0.05
"""Weight of leaving a row alone, where it must not be, in the first estimates."""


def swept(columns: AllColumns, deadline: float, states: float = 1.0) -> Floats | None:
    """Estimate the probability of each of a cluster's N columns by two truncated sweeps, the second with fewer states.

    Shape (2, N); how far they are apart says how far they can be trusted. ``states`` multiplies the states kept. None
    where too many states matter, or too much weight is dropped, or without time.
    """
    rows = columns.slack.size
    # weights reduced by multipliers are at most 1
    weights, alone = np.exp(-columns.reduced), np.exp(-columns.slack_reduced)
    share, _ = mean_field(columns.rows, weights, np.where(columns.slack, alone, _MUST))
    order, doubt = row_order(columns.rows, share, rows, _MOST + _IMPROVED)
    if doubt > _MOST:
        return None
    found = []
    for part in (1.0, _FEWER):
        estimate = truncated_sweep(columns.rows, order, weights, alone, deadline, states * part)
        if estimate is None or (part == 1.0 and estimate[1] > _DROPPED):
            return None
        found.append(estimate[0])
    return np.array(found)
