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

from assoc._system.compiled import njit
from assoc._types import Array, Floats, Ints
from assoc.ranking.pairs.graph import PairGraph

_ROUNDS, _SETTLED = 200, 1e-10
"""Belief propagation ends after this many rounds, or when messages change by less than this."""
_FAINT = 1e-290
"""Sums relative to their largest term below this have lost digits."""


@njit
def next_round(graph: PairGraph, log_weight: Floats, incoming: Floats, outgoing: Floats) -> None:
    """Compute all outgoing messages from the incoming ones: sums of all terms but one, from both ends of the list."""
    ptr, edge, mate = graph.ptr, graph.edge, graph.mate
    for v in range(ptr.size - 1):
        top = 0.0
        for x in range(ptr[v], ptr[v + 1]):
            top = max(top, log_weight[edge[x]] + incoming[mate[x]])
        total = math.exp(-top)
        for x in range(ptr[v], ptr[v + 1]):
            outgoing[x] = total
            total += math.exp(log_weight[edge[x]] + incoming[mate[x]] - top)
        total = 0.0
        for x in range(ptr[v + 1] - 1, ptr[v] - 1, -1):
            others = outgoing[x] + total
            total += math.exp(log_weight[edge[x]] + incoming[mate[x]] - top)
            if others > _FAINT:
                outgoing[x] = -(top + math.log(others))
            else:
                # beside the largest term the others are lost
                outgoing[x] = -_log_one_and(ptr[v], ptr[v + 1], x, edge, mate, log_weight, incoming)


@njit
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
def log_bounds(graph: PairGraph, log_weight: Floats) -> tuple[Floats, Floats]:
    """Lower and upper bounds on the logarithm of each pair's probability."""
    incoming = np.zeros(graph.edge.size)
    low, high = np.empty(incoming.size), np.empty(incoming.size)
    next_round(graph, log_weight, incoming, low)
    next_round(graph, log_weight, low, high)
    next_round(graph, log_weight, high, low)
    lower, upper = np.full(log_weight.size, -np.inf), np.zeros(log_weight.size)
    for v in range(graph.ptr.size - 1):
        for x in range(graph.ptr[v], graph.ptr[v + 1]):
            e, y = graph.edge[x], graph.mate[x]
            lower[e] = max(lower[e], _log_share(graph, v, x, log_weight, low[y], high))
            upper[e] = min(upper[e], _log_share(graph, v, x, log_weight, high[y], low))
    return lower, upper


@njit
def _log_share(graph: PairGraph, v: int, x: int, log_weight: Floats, incoming_here: float, incoming: Floats) -> float:
    """Log probability of the pair at index x of vertex v, from its incoming message and those of v's other edges."""
    others = _log_one_and(graph.ptr[v], graph.ptr[v + 1], x, graph.edge, graph.mate, log_weight, incoming)
    own = log_weight[graph.edge[x]] + incoming_here
    top = max(own, others)
    return own - top - math.log(math.exp(own - top) + math.exp(others - top))


@njit
def log_beliefs(graph: PairGraph, log_weight: Floats) -> Floats:
    """Messages of belief propagation, one for each end of each edge."""
    incoming, outgoing = np.zeros(graph.edge.size), np.zeros(graph.edge.size)
    for _ in range(_ROUNDS):
        next_round(graph, log_weight, incoming, outgoing)
        next_round(graph, log_weight, outgoing, incoming)
        if np.abs(incoming - outgoing).max() < _SETTLED:
            break
    return incoming


def log_dropped(graph: PairGraph, log_weight: Floats, kept: Array, beliefs: Floats) -> tuple[Floats, Floats]:
    """Summarise the edges that are not kept, at both of their ends.

    Returns
    -------
    log_free : array (V,)
        ln(1 + sum of weight times belief), of each vertex over its edges that are not kept.
    log_part : array (2 K,)
        The terms of these sums, -inf for edges that are kept.
    """
    part = np.where(kept[graph.edge], -np.inf, log_weight[graph.edge] + beliefs[graph.mate])
    free = np.zeros(graph.ptr.size - 1)
    vertex = np.repeat(np.arange(free.size), np.diff(graph.ptr))
    np.logaddexp.at(free, vertex, part)
    return free, part
