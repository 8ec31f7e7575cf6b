"""Bounds on the probability of each tuple by exact sums over clusters, where these are narrow enough.

Where a cluster is too wide for a sweep (`assoc.ranking.sweep`), the tuples known to be least likely are left out until
the rest can be summed. Let D be those left out that touch a remaining cluster. In solutions without D the cluster is
independent of all else, hence

    | P(t) - P(t among the tuples that remain) |  <=  P(any of D)  <=  sum over D of bounds on their probabilities,

with the bounds of `assoc.ranking.block_prices`.
"""

from __future__ import annotations

import numpy as np

from assoc._types import Array, Floats
from assoc.packing.run import Run
from assoc.ranking.block_prices import ROUNDING, block_bounds
from assoc.ranking.columns import AllColumns
from assoc.ranking.sums import Plan, plan_clusters, sum_clusters
from assoc.ranking.sweep import Graph

WIDEST = 22
"""Measurements that may be open at a time."""


def sums_and_bounds(columns: AllColumns, run: Run, widest: int, bounded: bool) -> tuple[Floats, Floats, Floats]:
    """Estimate and bound the probabilities of the N columns, and that of the R rows to be in none of them.

    ``widest`` is the most measurements open at a time; where clusters are wider they are ``bounded``, or bounds are 0
    and 1.
    """
    num = len(columns.weights)
    graph = _graph(columns)
    # the reduced costs of a solution add up to its cost but for a constant, whatever the multipliers
    priced = np.append(columns.duals, 0.0)[columns.rows].sum(axis=1)
    with np.errstate(over="ignore"):
        weights, free = np.exp(priced - columns.weights), np.exp(np.where(columns.slack, columns.duals, -np.inf))
    plan = plan_clusters(graph, np.zeros(num), widest, False)
    # a measurement that must be covered and is in no tuple
    if (~columns.slack & (np.diff(graph.ptr) == 0)).any():
        plan.label[:] = -1
    estimate, lower, upper = _summed(graph, plan, weights, free, run)
    wide = np.isnan(estimate)
    if wide.any():
        if not bounded or not columns.slack.all():
            estimate[wide], lower[wide], upper[wide] = 0.5, 0.0, 1.0
            return estimate, lower, upper
        found = block_bounds(columns, np.flatnonzero(wide[:num]), widest, run)
        estimate[wide], lower[wide], upper[wide] = found[0][wide], found[1][wide], found[2][wide]
        if not run.should_stop():
            with np.errstate(divide="ignore"):
                plan = plan_clusters(graph, np.log(upper[:num]), widest, True)
            closer = _summed(graph, plan, weights, free, run, upper[:num])
            narrower = closer[2] - closer[1] < upper - lower
            estimate[narrower] = closer[0][narrower]
            lower, upper = np.fmax(lower, closer[1]), np.fmin(upper, closer[2])
    return np.clip(estimate, lower, upper), lower, upper


def _graph(columns: AllColumns) -> Graph:
    """Rows as vertices, columns as edges."""
    column, sensor = np.nonzero(columns.rows >= 0)
    row = columns.rows[column, sensor]
    ptr = np.append(0, np.cumsum(np.bincount(row, minlength=columns.slack.size)))
    return Graph(columns.rows.astype(np.int64), ptr, column[np.argsort(row, kind="stable")])


def _summed(
    graph: Graph, plan: Plan, weights: Floats, free: Floats, run: Run, most_likely: Floats | None = None
) -> tuple[Floats, Floats, Floats]:
    """Estimates and bounds by a plan, not a number where a cluster is not summed.

    ``most_likely`` are upper bounds on the probabilities of the columns that the plan leaves out.
    """
    num, rows = len(weights), len(free)
    estimate = np.ones(num + rows)
    summed = sum_clusters(plan, weights, free, run.deadline(), estimate[:num], estimate[num:])
    label = np.append(_label(graph, plan), plan.label)
    estimate[(label < 0) | (label >= summed)] = np.nan
    lost: Floats = np.zeros(max(len(plan.ends), 1))
    if most_likely is not None:
        out = np.flatnonzero(~plan.kept)
        estimate[out] = np.nan
        column, sensor = np.nonzero(graph.ends[out] >= 0)
        touched = np.unique(np.stack([out[column], plan.label[graph.ends[out[column], sensor]]]), axis=1)
        np.add.at(lost, touched[1], most_likely[touched[0]])
    around = np.where(label >= 0, lost[label], 1.0) + ROUNDING
    return estimate, np.maximum(estimate - around, 0.0), np.minimum(estimate + around, 1.0)


def _label(graph: Graph, plan: Plan) -> Array:
    """Cluster of each edge, of its first vertex."""
    first = np.argmax(graph.ends >= 0, axis=1)
    return plan.label[graph.ends[np.arange(len(first)), first]]
