"""The m best children of a cluster's hypotheses by one sensor's measurements: Murty's algorithm with one queue.

A child assigns each measurement to a false alarm, a new target, or one of its parent's tracks, each track at most once:
a two-dimensional assignment problem for each parent. All parents share one queue, so that for a parent whose best child
is not among the m best of all only a bound is computed (Cox and Miller). A solved child is partitioned by its
measurements: node j keeps the choices of the measurements before j and forbids that of j. A node is solved when it
reaches the head of the queue.

References
----------
I. J. Cox, M. L. Miller, On finding ranked assignments with application to multitarget tracking and motion
correspondence, IEEE Trans. Aerospace and Electronic Systems 31, 1995.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import inner_njit, njit
from assoc._system.kernels.copying import copy_to
from assoc._types import Array, Floats
from assoc.packing.kernels.heap import doubled, doubled_rows, pop, push
from assoc.packing.kernels.matching import match_sparse

NEW, FALSE = -1, -2
"""Choices of a measurement besides the pairs."""


class Meanings(NamedTuple):
    """Possible choices of n measurements."""

    first: Array
    """The pairs of measurement j are ``first[j]:first[j + 1]``, int64 (n + 1,)."""
    track: Array
    """Track of each pair, int64 (K,)."""
    gain: Array
    """Log-probability of a pair, relative to the track missed and the measurement a false alarm, (K,)."""
    birth: Array
    """The same of a new target; -inf where none is possible, (n,)."""


class _Nodes(NamedTuple):
    """Nodes of the partition, in the queue or taken from it, one a row."""

    parent: NDArray[np.int64]
    above: NDArray[np.int64]
    """Node whose partition it is part of, -1: none."""
    turn: NDArray[np.int64]
    """Measurement whose choice in that node is forbidden; those before it keep their choices."""
    choice: NDArray[np.int32]
    cost: Floats
    """Infinite while only a bound on it is known."""
    rise: Floats
    """Lower bound on the cost of changing each measurement's choice."""


class _Work(NamedTuple):
    """Buffers of one assignment problem; its columns are the tracks, then a new target for each measurement."""

    indptr: NDArray[np.int64]
    columns: NDArray[np.int64]
    costs: Floats
    choice: NDArray[np.int32]
    row_slack: Floats
    column_slack: Floats
    edge: NDArray[np.int64]
    u: Floats
    v: Floats
    taken: NDArray[np.bool_]


@njit
def next_hypotheses(
    holds: NDArray[np.bool_], weight: Floats, missed: Floats, meanings: Meanings, most: int, drop: float
) -> Any:
    """Generate the next hypotheses of a cluster, in one compiled call.

    Before the measurements there are H hypotheses of T tracks, `holds` (H, T) and `weight` (H,); `missed` (T,) is the
    log-probability that a miss of each track adds; the rest as for `best_children`.

    Returns the rows, (U,), among the missed tracks, the pairs and the new targets in this order, that some hypothesis
    contains; and hypotheses (C, U), the best first, with log-probability 0, and their weights (C,).
    """
    tracks, pairs = missed.size, meanings.track.size
    alone = weight.copy()
    for h in range(weight.size):
        for b in range(tracks):
            if holds[h, b]:
                alone[h] += missed[b]
    parent, choice, after = best_children(holds, alone, meanings, most, drop)
    held = np.zeros((parent.size, tracks + pairs + meanings.birth.size), np.bool_)
    for c in range(parent.size):
        copy_to(held[c, :tracks], holds[parent[c]])
        for j in range(choice.shape[1]):
            if choice[c, j] == NEW:
                held[c, tracks + pairs + j] = True
            elif choice[c, j] >= 0:
                held[c, meanings.track[choice[c, j]]] = False
                held[c, tracks + choice[c, j]] = True
    used, size = np.empty(held.shape[1], np.int64), 0
    for column in range(held.shape[1]):
        for c in range(parent.size):
            if held[c, column]:
                used[size] = column
                size += 1
                break
    found = np.empty((parent.size, size), np.bool_)
    for c in range(parent.size):
        for i in range(size):
            found[c, i] = held[c, used[i]]
    return used[:size], found, after - after[0]


@inner_njit
def best_children(holds: NDArray[np.bool_], weight: Floats, meanings: Meanings, most: int, drop: float) -> Any:
    """Rank the children of all parents: parent (C,), choice (C, n) and weight (C,), the largest first.

    `holds` (H, T) says which tracks each parent contains; `weight` (H,) is its log-probability if all its tracks are
    missed and all measurements are false alarms. The choice is the pair of each measurement, or `NEW`, or `FALSE`;
    weights are log-probabilities. There are `most` children; those `drop` below the best are left out.
    """
    count, room = meanings.birth.size, weight.size + 64
    nodes = _Nodes(
        np.empty(room, np.int64), np.empty(room, np.int64), np.empty(room, np.int64),
        np.empty((room, count), np.int32), np.full(room, np.inf), np.empty((room, count)),
    )  # fmt: skip
    work = _room(holds.shape[1], count, meanings.track.size)
    key, item = np.empty(room), np.empty(room, np.int64)
    made, waiting = 0, 0
    for h in range(weight.size):
        nodes.parent[made], nodes.above[made], nodes.turn[made] = h, -1, 0
        push(key, item, waiting, _bound(holds, weight, meanings, h), made)
        made, waiting = made + 1, waiting + 1
    found = np.empty(min(most, 64), np.int64)
    size, limit = 0, np.inf
    while waiting > 0 and size < most and key[0] <= limit:
        value, node = key[0], item[0]
        waiting -= 1
        pop(key, item, waiting)
        if nodes.cost[node] == np.inf:
            _solve(holds, weight, meanings, nodes, work, node)
            if nodes.cost[node] < np.inf:
                push(key, item, waiting, nodes.cost[node], node)
                waiting += 1
            continue
        if size == 0:
            limit = value + drop
        if size == found.size:
            found = doubled(found)
        found[size] = node
        size += 1
        while made + count > key.size:
            nodes = _Nodes(
                doubled(nodes.parent), doubled(nodes.above), doubled(nodes.turn), doubled_rows(nodes.choice),
                doubled(nodes.cost), doubled_rows(nodes.rise),
            )  # fmt: skip
            nodes.cost[made:] = np.inf
            key, item = doubled(key), doubled(item)
        for j in range(nodes.turn[node], count):
            bound = value + nodes.rise[node, j]
            if bound <= limit:
                nodes.parent[made], nodes.above[made], nodes.turn[made] = nodes.parent[node], node, j
                push(key, item, waiting, bound, made)
                made, waiting = made + 1, waiting + 1
    found = found[:size]
    return nodes.parent[found], nodes.choice[found], -nodes.cost[found]


@inner_njit
def _room(tracks: int, count: int, pairs: int) -> Any:
    return _Work(
        np.zeros(count + 1, np.int64), np.empty(pairs + count, np.int64), np.empty(pairs + count),
        np.empty(pairs + count, np.int32), np.empty(count), np.zeros(tracks + count), np.empty(count, np.int64),
        np.empty(count), np.empty(tracks + count), np.zeros(tracks, np.bool_),
    )  # fmt: skip


@inner_njit
def _bound(holds: NDArray[np.bool_], weight: Floats, meanings: Meanings, h: int) -> float:
    """Lower bound on the cost of a parent's best child: each measurement takes its best choice."""
    cost = -weight[h]
    for j in range(meanings.birth.size):
        most = max(0.0, meanings.birth[j])
        for k in range(meanings.first[j], meanings.first[j + 1]):
            if holds[h, meanings.track[k]]:
                most = max(most, meanings.gain[k])
        cost -= most
    return cost


@inner_njit
def _solve(holds: NDArray[np.bool_], weight: Floats, meanings: Meanings, nodes: _Nodes, work: _Work, node: int) -> None:
    """Find the best child of a node, and lower bounds on the cost of changing it; infinite where there is none."""
    first, track, gain, birth = meanings
    above, turn = nodes.above[node], nodes.turn[node]
    choice, h = nodes.choice[node], nodes.parent[node]
    count, tracks = birth.size, work.taken.size
    cost = -weight[h]
    work.taken[:] = False
    for j in range(turn):
        chosen = nodes.choice[above, j]
        choice[j] = chosen
        if chosen == NEW:
            cost -= birth[j]
        elif chosen >= 0:
            cost -= gain[chosen]
            work.taken[track[chosen]] = True
    edges = 0
    for j in range(turn, count):
        may_be_false = True
        if birth[j] > -np.inf:
            work.columns[edges], work.costs[edges], work.choice[edges] = tracks + j, -birth[j], NEW
            edges += 1
        for k in range(first[j], first[j + 1]):
            if holds[h, track[k]] and not work.taken[track[k]]:
                work.columns[edges], work.costs[edges], work.choice[edges] = track[k], -gain[k], k
                edges += 1
        if j == turn:
            # what it was in the nodes that this one was split from
            at = node
            while nodes.above[at] >= 0 and nodes.turn[at] == turn:
                at = nodes.above[at]
                if nodes.choice[at, j] == FALSE:
                    may_be_false = False
                for e in range(edges):
                    if work.choice[e] == nodes.choice[at, j]:
                        work.costs[e] = np.inf
        work.row_slack[j - turn] = 0.0 if may_be_false else np.inf
        work.indptr[j - turn + 1] = edges
    rows = count - turn
    total = match_sparse(
        work.indptr[: rows + 1], work.columns, work.costs, work.row_slack[:rows], work.column_slack,
        work.edge[:rows], work.u[:rows], work.v,
    )  # fmt: skip
    nodes.cost[node] = cost + total
    if total == np.inf:
        return
    for i in range(rows):
        chosen = work.edge[i]
        choice[turn + i] = FALSE if chosen < 0 else work.choice[chosen]
        least = np.inf if chosen < 0 else work.row_slack[i] - work.u[i]
        for e in range(work.indptr[i], work.indptr[i + 1]):
            if e != chosen:
                least = min(least, work.costs[e] - work.u[i] - work.v[work.columns[e]])
        nodes.rise[node, turn + i] = max(0.0, least)
