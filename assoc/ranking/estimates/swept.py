"""Estimates of the probabilities of a cluster's tuples by truncated sweeps, where few sets of measurements matter."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assoc._types import Floats
from assoc.packing.run import Run
from assoc.problem import AssignmentProblem
from assoc.ranking.clusters import cluster_problems
from assoc.ranking.columns import AllColumns, price_all_columns
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


def swept(columns: AllColumns, deadline: float, states: float = 1.0, dropped: float = _DROPPED) -> Floats | None:
    """Estimate the probability of each of a cluster's N columns by two truncated sweeps, the second with fewer states.

    Shape (2, N); how far they are apart says how far they can be trusted. ``states`` multiplies the states kept. None
    where too many states matter, or more than ``dropped`` of the weight is dropped at a turn, or without time.
    """
    rows = columns.slack.size
    # weights reduced by multipliers are at most 1
    weights, alone = np.exp(-columns.reduced), np.exp(-columns.slack_reduced)
    share, _ = mean_field(columns.rows, weights, np.where(columns.slack, alone, _MUST))
    order, work = row_order(columns.rows, share, rows, _MOST + _IMPROVED)
    if work > _MOST:
        return None
    found = []
    for part in (1.0, _FEWER):
        estimate = truncated_sweep(columns.rows, order, weights, alone, deadline, states * part)
        if estimate is None or (part == 1.0 and estimate[1] > dropped):
            return None
        found.append(estimate[0])
    return np.array(found)


def of_tuples(columns: AllColumns, found: Floats, num: int) -> Floats:
    """Probabilities of tuples (C, num), singletons among them, from those of columns (C, N)."""
    share = np.zeros((len(found), num))
    share[:, columns.origin] = found
    if columns.single.size:
        share[:, columns.single] = 1.0
        column, sensor = np.nonzero(columns.rows >= 0)
        np.subtract.at(share.T, columns.single[columns.rows[column, sensor]], found.T[column])
    return share


def swept_where(problem: AssignmentProblem, wide: NDArray[np.bool_], estimate: Floats, states: float) -> Floats:
    """Estimates of the M tuples of a problem with dummies, by sweeps in clusters that have a ``wide`` tuple, (M,).

    Elsewhere, and where too many states matter, they are those given (``estimate``). ``states`` multiplies the states
    kept. Also where much weight is dropped a sweep is nearer than mean-field equations, which are what else there is.
    """
    estimate = estimate.copy()
    for cluster, which in cluster_problems(problem):
        if wide[which].any():
            columns = price_all_columns(cluster, Run(0))
            found = swept(columns, np.inf, states, np.inf)
            if found is not None:
                estimate[which] = of_tuples(columns, found[:1], cluster.num_tuples)[0][: len(which)]
    return estimate
