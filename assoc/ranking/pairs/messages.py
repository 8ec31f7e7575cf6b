"""Messages between the vertices of a pair graph: bounds on each pair's probability, and belief propagation.

With P(v; G) the probability that vertex v is in no pair of a joint event of the graph G,

    P(v; G) = 1 / ( 1 + sum over neighbours u of w_uv P(u; G - v) ),

and a pair is in the event with probability w_uv P(u; G) P(v; G - u). A message from v to u is a value for P(v; G - u).
The equation turns upper bounds on all messages into lower bounds, and lower into upper. Start from the upper bound 1:
the first round gives lower bounds, the second upper, the third lower. (A fourth round would return to vertices that
have been removed, so that it gives no bounds.) Rounds until convergence are belief propagation, exact on trees.

Messages are logarithms.

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
from assoc._types import Array, Floats, Ints
from assoc.ranking.pairs.graph import PairGraph
from assoc.ranking.sweep import cluster

_ROUNDS, _SETTLED = 400, 1e-10
"""Belief propagation ends after so many messages of each vertex of a cluster, or when they change by less than this."""
_FAINT = 1e-290
"""Sums relative to their largest term below this have lost digits."""


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


@njit
def log_bounds(graph: PairGraph, log_weight: Floats, vertices: Ints, work: Floats, bounds: Floats) -> None:
    """Lower and upper bounds on the logarithms of pairs' probabilities, (2, K), those of some whole clusters.

    ``work`` has room for five values of each edge end, (5, 2 K).
    """
    incoming, low, high, last, term = work[0], work[1], work[2], work[3], work[4]
    for v in vertices:
        incoming[graph.ptr[v] : graph.ptr[v + 1]] = 0.0
    for here, there in ((incoming, low), (low, high), (high, low), (low, last)):
        for v in vertices:
            _send(graph, log_weight, v, here, there, term)
    for v in vertices:
        for x in range(graph.ptr[v], graph.ptr[v + 1]):
            bounds[0, graph.edge[x]], bounds[1, graph.edge[x]] = -np.inf, 0.0
    for v in vertices:
        for x in range(graph.ptr[v], graph.ptr[v + 1]):
            e, y = graph.edge[x], graph.mate[x]
            # a message is minus the logarithm of one and the terms of the other edges
            bounds[0, e] = max(bounds[0, e], _log_share(log_weight[e] + low[y], -low[x]))
            bounds[1, e] = min(bounds[1, e], _log_share(log_weight[e] + high[y], -last[x]))


@inner_njit
def _log_share(own: float, others: float) -> float:
    """Logarithm of exp(own) / (exp(own) + exp(others))."""
    top = max(own, others)
    return own - top - math.log(math.exp(own - top) + math.exp(others - top))


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
        queue, count, left = np.sort(members[:size]), size, _ROUNDS * size
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
