"""The sum over all joint events of a cluster of tuples, by a sweep over its measurements.

Tuples are edges of a hypergraph whose vertices are measurements, and joint events are sets of edges without common
vertices. The sweep processes one edge after the other. A vertex is *open* while some of its edges are processed and
others are not. A table holds, for each set of used open vertices, the total weight of the partial events. Opening a
vertex doubles the table; processing its last edge halves it. A backward sweep gives for each set the weight of all
completions, and both sweeps together the probability of each edge. The work grows with two to the power of the open
vertices, not with the number of events: the order of vertices keeps few open.

Edges of one vertex are processed together. They change only entries in which this vertex is used, and their
probabilities need only the others, so that one copy of the table is enough for all of them.

Weights are to be reduced by multipliers of a good event, so that it weighs about 1 and each part of any event at most
about 1: whatever underflows is then negligible.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import inner_njit, njit
from assoc._types import Floats, Ints

OPEN, KEEP, USE, CLOSE = 0, 1, 2, 3
"""Kinds of steps."""
DONE = -1
"""Marks a closed vertex."""
_LARGE, _SMALL = 1e150, 1e-250


class Graph(NamedTuple):
    """V vertices and K edges, each listed at each of its vertices."""

    ends: Ints
    """Vertices of each edge, (K, S); -1 where it has fewer than S."""
    ptr: Ints
    """Vertex v is in the edges ``edge[ptr[v]:ptr[v + 1]]``."""
    edge: Ints


class Work(NamedTuple):
    """Buffers for planning a sweep, one number for each vertex, and one for each edge."""

    left: Ints
    """Edges not processed yet."""
    number: Ints
    """Of an open vertex: 1 + its bit in the table's index; 0 before it is opened, DONE after it is closed."""
    near: Ints
    """Whether the vertex or a neighbour is open."""
    shared: Ints
    """Zeros: edges in common with a vertex that is looked at."""
    processed: NDArray[np.bool_]
    rank: Ints
    """Where the cluster's list of members has the vertex: of equals, the first comes first."""
    border: Ints
    """The vertices that are near, and some that are closed; the last entry is their number, (V + 1,)."""


@inner_njit
def new_work(vertices: int, edges: int) -> Work:
    """Allocate buffers for graphs of this size."""
    return Work(
        np.zeros(vertices, np.int64),
        np.zeros(vertices, np.int64),
        np.zeros(vertices, np.int64),
        np.zeros(vertices, np.int64),
        np.zeros(edges, np.bool_),
        np.zeros(vertices, np.int64),
        np.zeros(vertices + 1, np.int64),
    )


@njit
def most_steps(vertices: int, edges: int) -> int:
    """Steps that a plan has at most."""
    return 4 * vertices + 2 * edges


@njit
def planned(graph: Graph, kept: NDArray[np.bool_], members: Ints, most: int, steps: Ints, work: Work) -> int:
    """Plan the sweep over a cluster: fill steps (kind, vertex or edge, its bits), return how many.

    -1 where more than `most` vertices would be open at a time.
    """
    left, number, near, _, processed, rank, border = work
    border[-1] = 0
    for i in range(members.size):
        v = members[i]
        left[v] = number[v] = near[v] = 0
        rank[v] = i
        for x in range(graph.ptr[v], graph.ptr[v + 1]):
            left[v] += kept[graph.edge[x]]
            processed[graph.edge[x]] = not kept[graph.edge[x]]
    count = width = 0
    while True:
        v = _next_vertex(graph, members, work)
        if v < 0:
            return count
        if number[v] == 0:
            width += 1
            count = _opened(graph, members, v, width, steps, count, work)
        new_table = True
        while True:
            e = _next_edge(graph, v, work)
            if e < 0:
                break
            for u in graph.ends[e]:
                if u >= 0 and number[u] == 0:
                    width += 1
                    count = _opened(graph, members, u, width, steps, count, work)
                    new_table = True
            if width > most:
                return -1
            if new_table:
                steps[count, 0], steps[count, 1], steps[count, 2] = KEEP, v, np.int64(1) << (number[v] - 1)
                count += 1
                new_table = False
            steps[count, 0], steps[count, 1], steps[count, 2] = USE, e, 0
            processed[e] = True
            for u in graph.ends[e]:
                if u >= 0:
                    steps[count, 2] |= np.int64(1) << (number[u] - 1)
                    left[u] -= 1
            count += 1
            for u in graph.ends[e]:
                if u >= 0 and u != v and left[u] == 0:
                    width -= 1
                    count = _closed(u, steps, count, work)
                    new_table = True
        width -= 1
        count = _closed(v, steps, count, work)


@inner_njit
def _next_edge(graph: Graph, v: int, work: Work) -> int:
    """The edge of a vertex that leaves the fewest vertices open; -1 if none is left."""
    best, least = -1, np.iinfo(np.int64).max
    for x in range(graph.ptr[v], graph.ptr[v + 1]):
        e = graph.edge[x]
        if work.processed[e]:
            continue
        cost = 0
        for u in graph.ends[e]:
            if u >= 0 and u != v:
                if work.number[u] == 0:
                    cost += 2 if work.left[u] > 1 else 0
                elif work.left[u] == 1:
                    cost -= 2
        if cost < least:
            best, least = e, cost
    return best


@njit
def _next_vertex(graph: Graph, members: Ints, work: Work) -> int:
    """The near vertex that leaves the fewest vertices open; -1 if none is left."""
    left, number, _, shared, processed, rank, border = work
    best, least, count = -1, np.iinfo(np.int64).max, 0
    for i in range(border[-1]):
        v = border[i]
        if number[v] == DONE:
            continue
        border[count] = v
        count += 1
        if left[v] == 0:
            continue
        cost = -2 if number[v] > 0 else 0
        for turn in range(2):
            for x in range(graph.ptr[v], graph.ptr[v + 1]):
                e = graph.edge[x]
                if processed[e]:
                    continue
                for u in graph.ends[e]:
                    if u < 0 or u == v:
                        continue
                    if turn == 0:
                        shared[u] += 1
                    elif shared[u] > 0:
                        if number[u] == 0:
                            cost += 2 if left[u] > shared[u] else 0
                        elif left[u] == shared[u]:
                            cost -= 2
                        shared[u] = 0
        if cost < least or (cost == least and rank[v] < rank[best]):
            best, least = v, cost
    border[-1] = count
    if best < 0:
        # at the start, when no vertex is near: one with few edges
        for v in members:
            if 0 < left[v] < least:
                best, least = v, left[v]
    return best


@njit
def _opened(graph: Graph, members: Ints, v: int, width: int, steps: Ints, count: int, work: Work) -> int:
    work.number[v] = width
    for x in range(graph.ptr[v], graph.ptr[v + 1]):
        for u in graph.ends[graph.edge[x]]:
            # edges that are not kept may lead to other clusters
            if u >= 0 and work.near[u] == 0 and work.rank[u] < members.size and members[work.rank[u]] == u:
                work.near[u] = 1
                work.border[work.border[-1]] = u
                work.border[-1] += 1
    steps[count, 0], steps[count, 1], steps[count, 2] = OPEN, v, np.int64(1) << (width - 1)
    return count + 1


@njit
def _closed(v: int, steps: Ints, count: int, work: Work) -> int:
    bit = work.number[v]
    for i in range(work.border[-1]):
        if work.number[work.border[i]] > bit:
            work.number[work.border[i]] -= 1
    work.number[v] = DONE
    steps[count, 0], steps[count, 1], steps[count, 2] = CLOSE, v, np.int64(1) << (bit - 1)
    return count + 1


@njit
def room(steps: Ints) -> int:
    """Numbers that a planned sweep holds at most: its table, and copies of it."""
    size, largest, total = 1, 1, 0
    for n in range(len(steps)):
        if steps[n, 0] == OPEN:
            size *= 2
            largest = max(largest, size)
        elif steps[n, 0] != USE:
            total += size // 2
        if steps[n, 0] == CLOSE:
            size //= 2
    return largest + total


@njit
def swept(steps: Ints, weights: Floats, free: Floats, probability: Floats, alone: Floats, buffer: Floats) -> None:
    """Do a planned sweep forwards and backwards: fill in the probabilities of its edges, and of unused vertices.

    ``steps`` is (N, 3); ``weights`` (K,) and ``free`` (V,) are reduced weights of the edges, and of leaving each vertex
    alone; ``probability`` (K,) and ``alone`` (V,) are not a number where the sum of all events is so small that digits
    are lost. ``buffer`` is room for ``room(steps)`` numbers, given so that its size tells how much work the call is.
    """
    size, largest = 1, 1
    for n in range(len(steps)):
        if steps[n, 0] == OPEN:
            size *= 2
            largest = max(largest, size)
        elif steps[n, 0] == CLOSE:
            size //= 2
    # copies hold the entries in which the vertex of the step is not used
    table, copies, divided = buffer[:largest], buffer[largest:], np.ones(len(steps))
    used = _forwards(steps, weights, free, table, copies, divided)
    _backwards(steps, (weights, free), table, copies, used, divided, (probability, alone))


@inner_njit
def _forwards(steps: Ints, weights: Floats, free: Floats, table: Floats, copies: Floats, divided: Floats) -> int:
    """Sum the partial events step by step; the first entry is the sum of all. Returns how much the copies take."""
    table[0], size, used = 1.0, 1, 0
    for n in range(len(steps)):
        kind, what, bits = steps[n, 0], steps[n, 1], steps[n, 2]
        if kind == OPEN:
            table[size : 2 * size] = 0.0
            size *= 2
        elif kind == USE:
            # entries without these bits, in stretches up to the lowest of them
            stretch, start, weight = bits & -bits, 0, weights[what]
            passed = bits | (stretch - 1)
            while start < size:
                for i in range(start, start + stretch):
                    table[i + bits] += weight * table[i]
                start = ((start | passed) + 1) & ~passed
        elif kind == KEEP or free[what] > 0.0:
            for i in range(size // 2):
                copies[used + i] = table[_without(i, bits)]
            used += size // 2
        if kind == CLOSE:
            size //= 2
            top = 0.0
            for i in range(size):
                # never below the index that is written
                j = _without(i, bits)
                table[i] = free[what] * table[j] + table[j | bits]
                top = max(top, table[i])
            divided[n] = _scale(table, size, top)
    return used


@inner_njit
def _backwards(
    steps: Ints, reduced: tuple[Floats, Floats], table: Floats, copies: Floats, used: int, divided: Floats,
    found: tuple[Floats, Floats],
) -> None:  # fmt: skip
    """Sum the completions of the sets, and fill in probabilities by these and the copies of the partial events."""
    weights, free = reduced
    probability, alone = found
    # the sum of all events, scaled as the tables are: forwards as before the step, backwards as after it
    total = table[0]
    table[0], size = 1.0, 1
    for n in range(len(steps) - 1, -1, -1):
        kind, what, bits = steps[n, 0], steps[n, 1], steps[n, 2]
        if kind == OPEN:
            size //= 2
        elif kind == USE:
            m = n - 1
            while steps[m, 0] == USE:
                m -= 1
            bit, weight = steps[m, 2], weights[what]
            stretch, start, by_it = bits & -bits, 0, 0.0
            passed = bits | (stretch - 1)
            while start < size:
                # where the copy has the entry: its vertex' bit is left out
                shift = used - size // 2 + ((start & (bit - 1)) | ((start >> 1) & ~(bit - 1))) - start
                for i in range(start, start + stretch):
                    value = table[i + bits]
                    by_it += copies[i + shift] * value
                    table[i] += weight * value
                start = ((start | passed) + 1) & ~passed
            probability[what] = min(weight * by_it / total, 1.0) if total > _SMALL else np.nan
        elif kind == KEEP:
            used -= size // 2
        else:
            total *= divided[n]
            if free[what] > 0.0:
                used -= size
            unused, top = 0.0, 0.0
            for i in range(size - 1, -1, -1):
                j = _without(i, bits)
                value = table[i]
                table[j | bits] = value
                table[j] = free[what] * value
                if free[what] > 0.0:
                    unused += copies[used + i] * value
                top = max(top, value)
            alone[what] = min(free[what] * unused / total, 1.0) if total > _SMALL else np.nan
            size *= 2
            total /= _scale(table, size, top)


@inner_njit
def _without(i: int, bit: int) -> int:
    """Insert a zero at this bit of an index."""
    return ((i & ~(bit - 1)) << 1) | (i & (bit - 1))


@njit
def _scale(table: Floats, size: int, top: float) -> float:
    """Keep a table's numbers far from overflow; return what they are divided by."""
    if top <= _LARGE:
        return 1.0
    for i in range(size):
        table[i] /= top
    return top


@njit
def cluster(graph: Graph, kept: NDArray[np.bool_], start: int, number: int, label: Ints, members: Ints) -> int:
    """Label the cluster of a vertex, connected by kept edges, and list its members; return how many."""
    members[0], label[start] = start, number
    size = 1
    at = 0
    while at < size:
        v = members[at]
        at += 1
        for x in range(graph.ptr[v], graph.ptr[v + 1]):
            if not kept[graph.edge[x]]:
                continue
            for u in graph.ends[graph.edge[x]]:
                if u >= 0 and label[u] < 0:
                    label[u] = number
                    members[size] = u
                    size += 1
    return size
