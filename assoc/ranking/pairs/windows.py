"""Bounds on the probability of each pair of two lists: exact sums over clusters, or over windows of large ones.

Clusters that the sweep can sum (`assoc.ranking.sweep`) are summed. Elsewhere, let R be a set of vertices, a
window. With P(v; G) the probability that v is unmatched in a joint event of the graph G, a pair uv has the probability

    P(uv) = w_uv P(v; G - u) / (1 + sum over neighbours i of u of w_ui P(i; G - u)),

so that bounds on the terms w_ui P(i; G - u) bound it. The same equation applies to P(i; G - u), and so on along all
paths from u (`assoc.ranking.pairs.messages`). A path that leaves R by a pair bc, with c outside, is cut there: its term
w_bc P(c; H) is replaced by a bound that holds for all graphs H that the paths through R leave. P(i; G - u) rises with
the terms at the vertices b in the list of u, and falls with those in the list of i, because each step of a path changes
the list, and the right-hand side falls in each P. With the highest terms in the list of u and the lowest in the other,
the paths give an upper bound on P(i; G - u); the reverse gives a lower one. Both are sums over all events of R in which
a vertex b is unmatched with the weight 1 + its terms, so that sweeps compute them: with the probabilities p of these,

    w_ui P(i; R - u) = (1 + terms of u) p(ui) / p(u unmatched).

Two sweeps thus bound all pairs of a window. The bounds on w_bc P(c; H) come from two or three steps outside of R. For
the highest, P(c; H) is largest without the vertices of R in the list of b; for the lowest, without those in the list
of c.

References
----------
C. Godsil, Matchings and walks in graphs, J. Graph Theory 5, 1981: sums over events as sums over paths.
M. Bayati, D. Gamarnik, D. Katz, C. Nair, P. Tetali, Simple deterministic approximation algorithms for counting
matchings, STOC 2007.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import inner_njit, njit
from assoc._types import Array, Floats, Ints
from assoc.packing.kernels.heap import pop, push
from assoc.packing.run import Run
from assoc.ranking.pairs.events import reduced
from assoc.ranking.pairs.graph import PairGraph, pair_graph
from assoc.ranking.pairs.messages import log_beliefs
from assoc.ranking.sums import plan_clusters, sum_clusters
from assoc.ranking.sweep import most_steps, new_work, planned, room, swept

WIDTHS = (16, 12)
# vertices of the largest window tried, for each open one
_SIZE = 8
# a vertex whose bounds are this close needs no further window
_NARROW = 1e-3
# vertices between two checks of the time: some ten milliseconds
_AT_ONCE = 50
# entries of tables filled, after which no window is added: about a second
_WORK = 1e9
# reduced weights of unmatched vertices below this leave windows no digits; events of smaller probability may be lost
_LIGHTEST, _FAINT = 1e-100, 1e-50
_ROUNDING = 1e-11
_EPSILON = 4.0 * float(np.finfo(float).eps)


def window_bounds(
    first: Array,
    second: Array,
    log_weight: Floats,
    sizes: tuple[int, int],
    run: Run,
    widths: tuple[int, ...] = WIDTHS,
) -> tuple[Floats, Floats, Floats]:
    """Estimate and bounds, (K + V,), of the probabilities of K pairs, and of each of V = n1 + n2 members to be in none.

    Pairs are as for `assoc.ranking.pairs.events.pair_probabilities`; ``widths`` are the most open vertices of a sweep
    over a cluster, and over windows, one round each. What there is no time for has wider bounds.
    """
    num, vertices = len(first), sum(sizes)
    estimate, bounds = np.zeros(num + vertices), np.repeat([[0.0], [1.0]], num + vertices, axis=1)
    if not num:
        return estimate + 1.0, bounds[1], bounds[1]
    graph = pair_graph(first, second, sizes)
    weight = np.ascontiguousarray(log_weight, dtype=np.float64)
    weights, free = reduced(graph, weight, np.ones(num, dtype=bool), np.zeros(vertices), sizes[0])
    plan = plan_clusters(graph.graph, np.zeros(num), widths[0], False)
    estimate[num:] = 1.0
    summed = sum_clusters(plan, weights, free, run.deadline(), estimate[:num], estimate[num:])
    wide = (plan.label < 0) | (plan.label >= summed)
    exact = ~np.append(wide[graph.ends[:, 0]], wide)
    bounds[:, exact] = estimate[exact]
    if wide.any():
        believed = _believed(graph, weight, log_beliefs(graph, weight, wide[graph.ends[:, 0]]))
        estimate[~exact] = believed[~exact]
        centres, work = np.flatnonzero(wide), 0.0 if free.min() > _LIGHTEST else np.inf
        for most in widths[1:]:
            for at in range(0, len(centres), _AT_ONCE):
                if run.should_stop() or work > _WORK:
                    break
                work += _bound(graph, weights, free, believed, centres[at : at + _AT_ONCE], most, bounds)
    rounding = _ROUNDING + 8.0 * float(np.finfo(float).eps) * vertices * float(np.abs(weight).max())
    lower, upper = np.maximum(bounds[0] - rounding, 0.0), np.minimum(bounds[1] + rounding, 1.0)
    return np.clip(estimate, lower, upper), lower, upper


@njit
def _believed(graph: PairGraph, log_weight: Floats, beliefs: Floats) -> Floats:
    """Probabilities (K + V,) by belief propagation."""
    probability = np.ones(log_weight.size + graph.ptr.size - 1)
    for v in range(graph.ptr.size - 1):
        top, total = 0.0, 0.0
        for x in range(graph.ptr[v], graph.ptr[v + 1]):
            top = max(top, log_weight[graph.edge[x]] + beliefs[graph.mate[x]])
        for x in range(graph.ptr[v], graph.ptr[v + 1]):
            probability[graph.edge[x]] = math.exp(log_weight[graph.edge[x]] + beliefs[graph.mate[x]] - top)
            total += probability[graph.edge[x]]
        for x in range(graph.ptr[v], graph.ptr[v + 1]):
            probability[graph.edge[x]] /= total + math.exp(-top)
        probability[log_weight.size + v] = math.exp(-top) / (total + math.exp(-top))
    return probability


@njit
def _bound(
    graph: PairGraph, weights: Floats, free: Floats, believed: Floats, centres: Ints, most: int, bounds: Floats
) -> float:
    """Narrow the bounds (2, K + V) around each centre, by windows with at most ``most`` open vertices.

    Returns the work done, in entries of tables.
    """
    ptr, edge, ends = graph.ptr, graph.edge, graph.ends
    vertices = free.size
    inside, kept, work = (
        np.zeros(vertices, np.bool_),
        np.zeros(weights.size, np.bool_),
        new_work(vertices, weights.size),
    )
    members, steps = np.empty(_SIZE * most, np.int64), np.empty((most_steps(_SIZE * most, weights.size), 3), np.int64)
    # for each edge end bounds on the term of the edge there, in reduced weights
    low, high = np.empty(edge.size), np.empty(edge.size)
    # weights of unmatched vertices, and probabilities of pairs and unmatched vertices, where as much as possible of the
    # border in the first list has a partner outside and as little as possible of that in the second; and the reverse
    left, pair, alone = np.empty((2, vertices)), np.empty((2, weights.size)), np.empty((2, vertices))
    sums, at_b = _sums(graph, weights, free), np.zeros(vertices)
    done = 0.0
    for centre in centres:
        width = 0.0
        for x in range(ptr[centre], ptr[centre + 1]):
            width = max(width, bounds[1, edge[x]] - bounds[0, edge[x]])
        count = _grown(graph, believed, centre, members, inside) if width > _NARROW else 0
        length = -1
        while count > 1 and length < 0:
            window = members[:count]
            for v in window:
                for x in range(ptr[v], ptr[v + 1]):
                    kept[edge[x]] = inside[ends[edge[x], 0]] and inside[ends[edge[x], 1]]
            length = planned(graph.graph, kept, window, most, steps, work)
            if length < 0:
                smaller = 4 * count // 5
                for v in members[smaller:count]:
                    inside[v] = False
                    for x in range(ptr[v], ptr[v + 1]):
                        kept[edge[x]] = False
                count = smaller
        window = members[:count]
        if length >= 0:
            done += float(length << most)
            for v in window:
                side = 1 if v == ends[edge[ptr[v]], 1] else 0
                left[:, v] = free[v]
                for x in range(ptr[v], ptr[v + 1]):
                    at_b[ends[edge[x], 0] + ends[edge[x], 1] - v] = weights[edge[x]] / free[v]
                for x in range(ptr[v], ptr[v + 1]):
                    if not kept[edge[x]]:
                        low[x], high[x] = _outside(graph, weights, free, sums, inside, v, edge[x], at_b)
                        left[side, v] += high[x]
                        left[1 - side, v] += low[x]
                for x in range(ptr[v], ptr[v + 1]):
                    at_b[ends[edge[x], 0] + ends[edge[x], 1] - v] = 0.0
            buffer = np.empty(room(steps[:length]))
            for side in range(2):
                alone[side, window] = 1.0
                swept(steps[:length], weights, left[side], pair[side], alone[side], buffer)
            for v in window:
                side = 1 if v == ends[edge[ptr[v]], 1] else 0
                for x in range(ptr[v], ptr[v + 1]):
                    e = edge[x]
                    if kept[e]:
                        # not a number where the window's events vanish beside those of the whole graph
                        low[x], high[x] = 0.0, np.inf
                        if pair[1 - side, e] > _FAINT:
                            low[x] = (pair[1 - side, e] - _FAINT) / (alone[1 - side, v] + _FAINT) * left[1 - side, v]
                        if alone[side, v] > 2.0 * _FAINT:
                            high[x] = (pair[side, e] + _FAINT) / (alone[side, v] - _FAINT) * left[side, v]
                _bound_pairs(graph, v, free[v], low, high, bounds)
        for v in window:
            inside[v] = False
            for x in range(ptr[v], ptr[v + 1]):
                kept[edge[x]] = False
    return done


@inner_njit
def _sums(graph: PairGraph, weights: Floats, free: Floats) -> Floats:
    """At least the sum in 1 / P(v) of each vertex, whatever of the graph is gone."""
    total = free.copy()
    for v in range(free.size):
        for x in range(graph.ptr[v], graph.ptr[v + 1]):
            total[v] += weights[graph.edge[x]] / free[graph.ends[graph.edge[x], 0] + graph.ends[graph.edge[x], 1] - v]
        # rounding of the sum, and of the differences that `_outside` takes
        total[v] *= 1.0 + _EPSILON * (graph.ptr[v + 1] - graph.ptr[v] + 8)
    return total


@inner_njit
def _outside(
    graph: PairGraph, weights: Floats, free: Floats, sums: Floats, inside: NDArray[np.bool_], b: int, e: int,
    at_b: Floats,
) -> tuple[float, float]:  # fmt: skip
    """Bounds on the term of an edge from a window's vertex to a vertex outside, whatever else of the window is gone.

    ``sums`` are `_sums`, ``at_b`` the terms of b in them, of each vertex.
    """
    ptr, edge, ends = graph.ptr, graph.edge, graph.ends
    u = ends[e, 0] + ends[e, 1] - b
    # the sum in 1 / P(u), at least without the rest of the window in the list of b, and at most with it
    least = most = free[u]
    for y in range(ptr[u], ptr[u + 1]):
        k, weight = ends[edge[y], 0] + ends[edge[y], 1] - u, weights[edge[y]]
        if k == b:
            continue
        some = free[k]
        for z in range(ptr[k], ptr[k + 1]):
            m = ends[edge[z], 0] + ends[edge[z], 1] - k
            if m != u and not inside[m]:
                some += weights[edge[z]] / (sums[m] - weights[edge[z]] / free[k] - at_b[m])
        most += weight / some
        if not inside[k]:
            least += weight / (sums[k] - weight / free[u])
    return weights[e] / most, weights[e] / least


@inner_njit
def _grown(graph: PairGraph, believed: Floats, centre: int, members: Ints, inside: NDArray[np.bool_]) -> int:
    """Mark and list the vertices that the likeliest paths from a centre reach; return how many."""
    ptr, edge, ends = graph.ptr, graph.edge, graph.ends
    key, item = np.empty(edge.size + 1), np.empty(edge.size + 1, np.int64)
    push(key, item, 0, 0.0, centre)
    size, count = 1, 0
    while size > 0 and count < members.size:
        distance, v = key[0], item[0]
        size -= 1
        pop(key, item, size)
        if inside[v]:
            continue
        inside[v] = True
        members[count] = v
        count += 1
        for x in range(ptr[v], ptr[v + 1]):
            u = ends[edge[x], 0] + ends[edge[x], 1] - v
            if not inside[u]:
                push(key, item, size, distance - math.log(believed[edge[x]] + 1e-30), u)
                size += 1
    return count


@inner_njit
def _bound_pairs(graph: PairGraph, v: int, free: float, low: Floats, high: Floats, bounds: Floats) -> None:
    """Narrow the bounds of a vertex and of its pairs, from those of their terms."""
    all_low, all_high = free, free
    for x in range(graph.ptr[v], graph.ptr[v + 1]):
        all_low += low[x]
        all_high += high[x]
        others_low, others_high = free, free
        for y in range(graph.ptr[v], graph.ptr[v + 1]):
            if y != x:
                others_low += low[y]
                others_high += high[y]
        e = graph.edge[x]
        if others_high < np.inf:
            bounds[0, e] = max(bounds[0, e], low[x] / (low[x] + others_high))
        if high[x] < np.inf:
            bounds[1, e] = min(bounds[1, e], high[x] / (high[x] + others_low))
    alone = graph.edge.size // 2 + v
    bounds[0, alone] = max(bounds[0, alone], free / all_high)
    bounds[1, alone] = min(bounds[1, alone], free / all_low)
