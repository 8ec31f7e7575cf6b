"""Messages between the vertices of a pair graph: bounds on each pair's probability, and belief propagation.

With P(v; G) the probability that vertex v is in no pair of a joint event of the graph G,

    P(v; G) = 1 / ( 1 + sum over neighbours u of w_uv P(u; G - v) ),

and a pair is in the event with probability w_uv P(u; G) P(v; G - u). A message from v to u is a value for P(v; G - u).
The equation turns upper bounds on all messages into lower bounds, and lower into upper. Start from the upper bound 1:
the first round gives lower bounds, the second upper, the third lower. (A fourth round would return to vertices that
have been removed, so that it gives no bounds.) Rounds until convergence are belief propagation, exact on trees.

Messages of belief propagation are logarithms.

References
----------
M. Bayati, D. Gamarnik, D. Katz, C. Nair, P. Tetali, Simple deterministic approximation algorithms for counting
matchings, STOC 2007, section 2.
J. Williams, R. Lau, Approximate evaluation of marginal association probabilities with belief propagation, IEEE Trans.
Aerospace and Electronic Systems 50, 2014.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import inner_njit, njit
from assoc._system.kernels.sorting import sort_part
from assoc._types import Array, Floats, Ints
from assoc.ranking.pairs.graph import PairGraph
from assoc.ranking.sweep import cluster

_ROUNDS, _SETTLED = 400, 1e-6
"""Belief propagation ends after so many messages of each vertex of a cluster, or when they change by less than this."""
_FAINT = 1e-290
"""Sums relative to their largest term below this have lost digits."""
_FULL = 1e17
"""Odds above this are a probability of 1 in floats."""


@inner_njit
def _send(graph: PairGraph, log_weight: Floats, v: int, incoming: Floats, outgoing: Floats, term: Floats) -> None:
    """Compute the outgoing messages of a vertex: sums of all terms but one, from both ends of the list."""
    ptr, edge, mate = graph.ptr, graph.edge, graph.mate
    top = 0.0
    for x in range(ptr[v], ptr[v + 1]):
        term[x] = log_weight[edge[x]] + incoming[mate[x]]
        top = max(top, term[x])
    total = math.exp(-top)
    for x in range(ptr[v], ptr[v + 1]):
        outgoing[x] = total
        term[x] = math.exp(term[x] - top)
        total += term[x]
    total = 0.0
    for x in range(ptr[v + 1] - 1, ptr[v] - 1, -1):
        others = outgoing[x] + total
        total += term[x]
        if others > _FAINT:
            outgoing[x] = -(top + math.log(others))
        else:
            # beside the largest term the others are lost
            outgoing[x] = -_log_one_and(ptr[v], ptr[v + 1], x, edge, mate, log_weight, incoming)


@inner_njit
def _log_one_and(
    first: int, last: int, but: int, edge: Ints, mate: Ints, log_weight: Floats, incoming: Floats
) -> float:
    """ln(1 + sum of weight times incoming message) over a vertex' edges except ``but``."""
    top = 0.0
    for y in range(first, last):
        if y != but:
            top = max(top, log_weight[edge[y]] + incoming[mate[y]])
    total = math.exp(-top)
    for y in range(first, last):
        if y != but:
            total += math.exp(log_weight[edge[y]] + incoming[mate[y]] - top)
    return top + math.log(total)


@inner_njit
def _reply(graph: PairGraph, weights: Floats, v: int, free: float, incoming: Floats, outgoing: Floats) -> None:
    """Compute the outgoing messages of a vertex, not logarithms: 1 / (free + terms of the other edges)."""
    total = free
    for x in range(graph.ptr[v], graph.ptr[v + 1]):
        outgoing[x] = total
        total += weights[graph.edge[x]] * incoming[graph.mate[x]]
    total = 0.0
    for x in range(graph.ptr[v + 1] - 1, graph.ptr[v] - 1, -1):
        others = outgoing[x] + total
        total += weights[graph.edge[x]] * incoming[graph.mate[x]]
        outgoing[x] = 1.0 / others if others > 0.0 else np.inf


@njit
def bound_pairs(graph: PairGraph, weights: Floats, free: Floats, vertices: Ints, work: Floats, bounds: Floats) -> None:
    """Lower and upper bounds on pairs' probabilities, (2, K), those of some whole clusters.

    ``weights`` (K,) and ``free`` (V,) are reduced weights of the edges and of leaving each vertex alone, at most about
    1, which multiplies a vertex' messages by its ``free``. ``work`` has room for three values of each edge end.
    """
    incoming, low, high = work[0], work[1], work[2]
    # numbers that have lost digits are replaced by what they are at most, and at least
    most, least = np.empty(weights.size), np.empty(weights.size)
    for e in range(weights.size):
        most[e], least[e] = max(weights[e], _FAINT), weights[e] if weights[e] > _FAINT else 0.0
    for v in vertices:
        for x in range(graph.ptr[v], graph.ptr[v + 1]):
            incoming[x] = 1.0 / free[v] if free[v] > _FAINT else np.inf
    for v in vertices:
        _reply(graph, most, v, max(free[v], _FAINT), incoming, low)
    for v in vertices:
        _reply(graph, least, v, free[v] if free[v] > _FAINT else 0.0, low, high)
    for v in vertices:
        _reply(graph, most, v, max(free[v], _FAINT), high, low)
    last = incoming
    for v in vertices:
        _reply(graph, least, v, free[v] if free[v] > _FAINT else 0.0, low, last)
    for v in vertices:
        for x in range(graph.ptr[v], graph.ptr[v + 1]):
            bounds[0, graph.edge[x]], bounds[1, graph.edge[x]] = 0.0, 1.0
    for v in vertices:
        for x in range(graph.ptr[v], graph.ptr[v + 1]):
            e, y = graph.edge[x], graph.mate[x]
            # a message is the reciprocal of the terms of the other edges
            bounds[0, e] = max(bounds[0, e], _share(least[e] * low[y] * low[x]))
            bounds[1, e] = min(bounds[1, e], _share(most[e] * high[y] * last[x]))


@inner_njit
def _share(odds: float) -> float:
    """The probability with these odds, also if they are infinite."""
    return odds / (1.0 + odds) if odds < _FULL else 1.0


@njit
def log_beliefs(graph: PairGraph, log_weight: Floats, wanted: NDArray[np.bool_]) -> Floats:
    """Messages of belief propagation, one for each end of each edge; 0 in clusters without a wanted edge.

    A vertex sends again when a message to it has changed.
    """
    vertices, ends = graph.ptr.size - 1, graph.edge.size
    message, fresh, term = np.zeros(ends), np.empty(ends), np.empty(ends)
    every, label = np.ones(log_weight.size, np.bool_), np.full(vertices, -1, np.int64)
    members, waits = np.empty(vertices, np.int64), np.ones(vertices, np.bool_)
    for start in range(vertices):
        if label[start] >= 0:
            continue
        size = cluster(graph.graph, every, start, start, label, members)
        if not _any_of(graph, members[:size], wanted):
            continue
        queue, count, left = members[:size], size, _ROUNDS * size
        sort_part(queue, 0, size)
        at = 0
        while count > 0 and left > 0:
            v = queue[at]
            at, count, left = (at + 1) % size, count - 1, left - 1
            waits[v] = False
            _send(graph, log_weight, v, message, fresh, term)
            for x in range(graph.ptr[v], graph.ptr[v + 1]):
                changed = not abs(fresh[x] - message[x]) < _SETTLED
                message[x] = fresh[x]
                u = graph.ends[graph.edge[x], 0] + graph.ends[graph.edge[x], 1] - v
                if changed and not waits[u]:
                    waits[u] = True
                    queue[(at + count) % size] = u
                    count += 1
    return message


@inner_njit
def _any_of(graph: PairGraph, vertices: Ints, wanted: NDArray[np.bool_]) -> bool:
    for v in vertices:
        for x in range(graph.ptr[v], graph.ptr[v + 1]):
            if wanted[graph.edge[x]]:
                return True
    return False


def log_dropped(graph: PairGraph, log_weight: Floats, kept: Array, beliefs: Floats) -> tuple[Floats, Floats]:
    """Summarise the edges that are not kept, at both of their ends.

    Returns ln(1 + sum of weight times belief) of each vertex over its edges that are not kept, (V,), and the terms of
    these sums, (2 K,), -inf for edges that are kept.
    """
    part = np.where(kept[graph.edge], -np.inf, log_weight[graph.edge] + beliefs[graph.mate])
    free = np.zeros(graph.ptr.size - 1)
    vertex = np.repeat(np.arange(free.size), np.diff(graph.ptr))
    np.logaddexp.at(free, vertex, part)
    return free, part
