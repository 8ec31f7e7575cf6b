"""Exact sums over the clusters of a graph of tuples that sweeps can sum; of the others unlikely tuples are left out."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._system.clock import is_over
from assoc._system.compiled import njit
from assoc._types import Array, Floats, Ints
from assoc.ranking.sweep import CLOSE, KEEP, OPEN, Graph, cluster, most_steps, new_work, planned, room, swept

_LEAST, _STEP = math.log(1e-12), math.log(4.0)
"""Where too many vertices would be open, tuples below this probability are left out; then it rises by this factor."""
_MOST_NUMBERS, _FEWER = 2**26, 2**24
"""Numbers that a sweep holds at most, 8 bytes each, and where tuples are left out: there more of them gain little."""
_MOST_KEPT = 2**23
"""Numbers that all tables of a sweep in logarithms hold, which are kept for the way back; 8 bytes each."""


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


def is_short(steps: Ints) -> bool:
    """Whether the tables of these steps, (N, 3), are small enough to be kept."""
    width = np.cumsum((steps[:, 0] == OPEN) * 1 - (steps[:, 0] == CLOSE))
    return bool(np.ldexp(1.0, width).sum() <= _MOST_KEPT)


def swept_in_logarithms(steps: Ints, log_weights: Floats, log_free: Floats, probability: Floats, alone: Floats) -> None:
    """What `assoc.ranking.sweep.swept` does, of logarithms of weights; there must be an event of positive weight.

    It is slow, for clusters whose sums lose all digits where costs are huge: multipliers of a relaxation leave each
    solution a reduced cost of at least the relaxation's gap, which grows with the costs. Where it is in the hundreds,
    every weight underflows; logarithms do not.
    """
    table, before = np.zeros(1), []
    with np.errstate(invalid="ignore"):
        for kind, what, bits in steps.tolist():
            before.append(table)
            if kind == OPEN:
                table = np.append(table, np.full(len(table), -np.inf))
            elif kind == CLOSE:
                off, on = _halves(len(table), bits)
                table = np.logaddexp(log_free[what] + table[off], table[on])
            elif kind != KEEP:
                off, on = _halves(len(table), bits)
                table = table.copy()
                table[on] = np.logaddexp(table[on], log_weights[what] + table[off])
        total, rest = table[0], np.zeros(1)
        for (kind, what, bits), table in zip(steps[::-1].tolist(), reversed(before), strict=True):
            if kind == OPEN:
                rest = rest[: len(table)]
            elif kind == CLOSE:
                off, on = _halves(len(table), bits)
                alone[what] = np.exp(min(_sum(log_free[what] + table[off] + rest) - total, 0.0))
                completed = np.empty(len(table))
                completed[off], completed[on] = log_free[what] + rest, rest
                rest = completed
            elif kind != KEEP:
                off, on = _halves(len(table), bits)
                probability[what] = np.exp(min(_sum(log_weights[what] + table[off] + rest[on]) - total, 0.0))
                rest = rest.copy()
                rest[off] = np.logaddexp(rest[off], log_weights[what] + rest[on])


def _halves(size: int, bits: int) -> tuple[Array, Array]:
    """Entries in which none of the bits is set, and those with all of them, in the same order."""
    index = np.arange(size)
    off = index[index & bits == 0]
    return off, off | bits


def _sum(logarithms: Floats) -> float:
    """Logarithm of a sum."""
    top = logarithms.max()
    return float(top + np.log(np.exp(logarithms - top).sum())) if np.isfinite(top) else -np.inf
