"""Exact sums over the clusters of a graph of tuples that sweeps can sum; of the others unlikely tuples are left out."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._system.clock import is_over
from assoc._system.compiled import njit
from assoc._types import Floats, Ints
from assoc.ranking.sweep import Graph, cluster, most_steps, new_work, planned, room, swept

_LEAST, _STEP = math.log(1e-12), math.log(4.0)
"""Where too many vertices would be open, tuples below this probability are left out; then it rises by this factor."""
_MOST_NUMBERS, _FEWER = 2**26, 2**24
"""Numbers that a sweep holds at most, 8 bytes each, and where tuples are left out: there more of them gain little."""


class Plan(NamedTuple):
    """Which of K edges over V vertices are summed, and how."""

    kept: NDArray[np.bool_]
    """Edges that are summed, (K,)."""
    steps: Ints
    """Steps of the sweeps over all clusters, one after the other."""
    ends: Ints
    """Where the steps of each cluster end."""
    label: Ints
    """Cluster of each vertex, (V,); -1: too wide to be summed."""
    room: int
    """Numbers that the largest sweep holds."""


def plan_clusters(graph: Graph, log_upper: Floats, most: int, drop: bool) -> Plan:
    """Plan the sweeps over all clusters that have at most ``most`` vertices open.

    With ``drop``, tuples whose probability is known to be small (``log_upper``, (K,)) are left out where needed,
    the least likely ones first, until every cluster can be summed.
    """
    return Plan(*_planned(graph, log_upper, most, drop))


@njit
def _planned(graph: Graph, log_upper: Floats, most: int, drop: bool) -> tuple[NDArray[np.bool_], Ints, Ints, Ints, int]:
    """The fields of a `Plan`."""
    vertices, edges = graph.ptr.size - 1, log_upper.size
    kept, label = np.ones(edges, np.bool_), np.full(vertices, -1, np.int64)
    wide = np.zeros(vertices, np.bool_)
    steps, ends = np.empty((most_steps(vertices, edges), 3), np.int64), np.empty(vertices, np.int64)
    limit = np.full(vertices, _LEAST)
    members, work = np.empty(vertices, np.int64), new_work(vertices, edges)
    count = clusters = 0
    largest, most_numbers = 1, _FEWER if drop else _MOST_NUMBERS
    for v in range(vertices):
        while label[v] < 0 and not wide[v]:
            inside = members[: cluster(graph, kept, v, clusters, label, members)]
            added = planned(graph, kept, inside, most, steps[count:], work)
            needed = room(steps[count : count + added]) if added >= 0 else 0
            if added >= 0 and needed <= most_numbers:
                count += added
                largest = max(largest, needed)
                ends[clusters] = count
                clusters += 1
                continue
            for u in inside:
                label[u] = -1
                wide[u] = not drop
            if not drop:
                continue
            # no step at which nothing would be left out
            level, least = -np.inf, np.inf
            for u in inside:
                level = max(level, limit[u])
                for x in range(graph.ptr[u], graph.ptr[u + 1]):
                    if kept[graph.edge[x]]:
                        least = min(least, log_upper[graph.edge[x]])
            while level <= least and level < 0.0:
                level += _STEP
            for u in inside:
                limit[u] = level + _STEP
                for x in range(graph.ptr[u], graph.ptr[u + 1]):
                    if log_upper[graph.edge[x]] < level or level >= 0.0:
                        kept[graph.edge[x]] = False
    return kept, steps[:count], ends[:clusters], label, largest


def sum_clusters(plan: Plan, weights: Floats, free: Floats, deadline: float, probability: Floats, alone: Floats) -> int:
    """Sum the planned clusters (`swept`) until time is over; return how many."""
    return int(_sum_clusters(plan, weights, free, deadline, probability, alone, np.empty(plan.room)))


@njit
def _sum_clusters(
    plan: Plan, weights: Floats, free: Floats, deadline: float, probability: Floats, alone: Floats, buffer: Floats
) -> int:
    begin = 0
    for c in range(plan.ends.size):
        if is_over(deadline):
            return c
        swept(plan.steps[begin : plan.ends[c]], weights, free, probability, alone, buffer)
        begin = plan.ends[c]
    return plan.ends.size
