"""The sum over all joint events of a cluster, by a sweep over its graph.

A joint event is a matching. The sweep processes the edges one after the other. A vertex is *open* while some of its
edges are processed and others are not. A table holds, for each set of matched open vertices, the total weight of the
partial events. Opening a vertex doubles the table; processing its last edge halves it. A backward sweep gives for each
set the weight of all completions, and both sweeps together the probability of each edge. The work grows with two to
the power of the open vertices, not with the number of events: the order of vertices keeps few open.

Weights are reduced by the multipliers of the best event (`assoc.packing.kernels.matching`): it weighs 1 and each part
of any event at most 1, so that whatever underflows is negligible.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import inner_njit, njit
from assoc._types import Floats, Ints
from assoc.packing.kernels.copying import copy_to
from assoc.ranking.pairs.graph import PairGraph

OPEN, PAIR, CLOSE = 0, 1, 2
"""Kinds of steps."""
DONE = -1
"""Marks a closed vertex."""
_LARGE, _SMALL = 1e150, 1e-250


class Work(NamedTuple):
    """Buffers for planning a sweep, one number for each vertex."""

    left: Ints
    """Edges not processed yet."""
    place: Ints
    """1 + the bit of an open vertex in the table's index; 0 before it is opened, DONE after it is closed."""
    near: Ints
    """Whether the vertex or a neighbour is open."""


@njit
def new_work(vertices: int) -> Work:
    """Allocate buffers for graphs of this many vertices."""
    return Work(np.zeros(vertices, np.int64), np.zeros(vertices, np.int64), np.zeros(vertices, np.int64))


@njit
def planned(graph: PairGraph, kept: NDArray[np.bool_], members: Ints, most: int, steps: Ints, work: Work) -> int:
    """Plan the sweep over a cluster: fill steps (kind, vertex or edge, bit, second bit), return how many.

    -1 where more than `most` vertices would be open at a time.
    """
    left, place, near = work
    for v in members:
        left[v] = place[v] = near[v] = 0
        for x in range(graph.ptr[v], graph.ptr[v + 1]):
            left[v] += kept[graph.edge[x]]
    count = width = 0
    while True:
        v = _next_vertex(graph, kept, members, work)
        if v < 0:
            return count
        if place[v] == 0:
            width += 1
            count = _opened(graph, v, width, steps, count, work)
        # first what closes vertices, then what opens none for long, then the rest
        for turn in range(3):
            for x in range(graph.ptr[v], graph.ptr[v + 1]):
                e = graph.edge[x]
                u = graph.ends[e, 0] + graph.ends[e, 1] - v
                if not kept[e] or place[u] == DONE:
                    continue
                if turn == 0 and (place[u] == 0 or left[u] > 1):
                    continue
                if turn == 1 and left[u] > 1:
                    continue
                if place[u] == 0:
                    width += 1
                    count = _opened(graph, u, width, steps, count, work)
                if width > most:
                    return -1
                steps[count, 0], steps[count, 1], steps[count, 2], steps[count, 3] = PAIR, e, place[v] - 1, place[u] - 1
                count += 1
                left[u] -= 1
                left[v] -= 1
                if left[u] == 0:
                    width -= 1
                    count = _closed(members, u, steps, count, work)
        width -= 1
        count = _closed(members, v, steps, count, work)


@njit
def _next_vertex(graph: PairGraph, kept: NDArray[np.bool_], members: Ints, work: Work) -> int:
    """The vertex that leaves the fewest vertices open, preferably next to an open one; -1 if none is left."""
    left, place, near = work
    best, least = -1, np.iinfo(np.int64).max
    for v in members:
        if place[v] == DONE or left[v] == 0:
            continue
        # vertices that are not next to an open one come last, those with few edges first
        cost = (np.int64(1) << 40) + left[v]
        if near[v]:
            cost = -2 if place[v] > 0 else 0
            for x in range(graph.ptr[v], graph.ptr[v + 1]):
                e = graph.edge[x]
                u = graph.ends[e, 0] + graph.ends[e, 1] - v
                if not kept[e] or place[u] == DONE:
                    continue
                if place[u] == 0:
                    cost += 2 if left[u] > 1 else 0
                elif left[u] == 1:
                    cost -= 2
        if cost < least:
            best, least = v, cost
    return best


@njit
def _opened(graph: PairGraph, v: int, width: int, steps: Ints, count: int, work: Work) -> int:
    work.place[v] = width
    work.near[v] = 1
    for x in range(graph.ptr[v], graph.ptr[v + 1]):
        e = graph.edge[x]
        work.near[graph.ends[e, 0] + graph.ends[e, 1] - v] = 1
    steps[count, 0], steps[count, 1], steps[count, 2], steps[count, 3] = OPEN, v, width - 1, 0
    return count + 1


@njit
def _closed(members: Ints, v: int, steps: Ints, count: int, work: Work) -> int:
    bit = work.place[v]
    for u in members:
        if work.place[u] > bit:
            work.place[u] -= 1
    work.place[v] = DONE
    steps[count, 0], steps[count, 1], steps[count, 2], steps[count, 3] = CLOSE, v, bit - 1, 0
    return count + 1


@njit
def swept(steps: Ints, weights: Floats, free: Floats, probability: Floats, alone: Floats) -> None:
    """Do a planned sweep forwards and backwards: fill in the probabilities of its edges, and of unmatched vertices.

    Parameters
    ----------
    steps : int64 array (N, 4)
    weights, free : arrays (K,), (V,)
        Reduced weights of the edges, and of leaving each vertex alone.
    probability, alone : arrays (K,), (V,)
        Not a number where the sum of all events is so small that digits are lost.
    """
    size, largest, room = 1, 1, 0
    for n in range(len(steps)):
        if steps[n, 0] == OPEN:
            size *= 2
            largest = max(largest, size)
            continue
        room += size
        if steps[n, 0] == CLOSE:
            size //= 2
    table, before = np.zeros(largest), np.empty(room)
    table[0], size, used = 1.0, 1, 0
    for n in range(len(steps)):
        kind, what = steps[n, 0], steps[n, 1]
        low, high = np.int64(1) << steps[n, 2], np.int64(1) << steps[n, 3]
        if kind == OPEN:
            table[size : 2 * size] = 0.0
            size *= 2
            continue
        copy_to(before[used : used + size], table[:size])
        used += size
        if kind == PAIR:
            for i in range(size):
                if not i & low and not i & high:
                    table[i | low | high] += weights[what] * table[i]
        else:
            size //= 2
            top = 0.0
            for i in range(size):
                # the index without the removed bit; it is never below the index that is written
                with_it = ((i & ~(low - 1)) << 1) | (i & (low - 1))
                table[i] = free[what] * table[with_it] + table[with_it | low]
                top = max(top, table[i])
            _scale(table, size, top)
    table[0], size = 1.0, 1
    for n in range(len(steps) - 1, -1, -1):
        kind, what = steps[n, 0], steps[n, 1]
        low, high = np.int64(1) << steps[n, 2], np.int64(1) << steps[n, 3]
        if kind == OPEN:
            size //= 2
        elif kind == PAIR:
            used -= size
            without = pair = 0.0
            for i in range(size):
                without += before[used + i] * table[i]
                if not i & low and not i & high:
                    pair += before[used + i] * table[i | low | high]
                    table[i] += weights[what] * table[i | low | high]
            pair *= weights[what]
            probability[what] = _share(pair, without)
        else:
            used -= 2 * size
            top = matched = unmatched = 0.0
            for i in range(size - 1, -1, -1):
                with_it = ((i & ~(low - 1)) << 1) | (i & (low - 1))
                value = table[i]
                table[with_it | low] = value
                table[with_it] = free[what] * value
                matched += before[used + (with_it | low)] * value
                unmatched += before[used + with_it] * (free[what] * value)
                top = max(top, value)
            alone[what] = _share(unmatched, matched)
            size *= 2
            _scale(table, size, top)


@inner_njit
def _share(part: float, rest: float) -> float:
    return part / (part + rest) if part + rest > _SMALL else np.nan


@njit
def _scale(table: Floats, size: int, top: float) -> None:
    """Keep a table's numbers far from overflow; only their ratios count."""
    if top > _LARGE:
        for i in range(size):
            table[i] /= top
