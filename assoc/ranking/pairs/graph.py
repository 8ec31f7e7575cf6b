"""Pairs of two lists as a graph: members of both lists are vertices, pairs are edges, joint events are matchings."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from assoc._system.compiled import njit
from assoc._types import Array, Ints
from assoc.ranking.sweep import Graph


class PairGraph(NamedTuple):
    """V vertices, those of the first list first, and K edges, each listed twice: once for each end."""

    ends: Ints
    """Vertices of each edge, (K, 2)."""
    ptr: Ints
    """Vertex v has the edge ends ``ptr[v]:ptr[v + 1]``."""
    edge: Ints
    """Edge of each edge end, (2 K,)."""
    mate: Ints
    """Index of the edge's other end, (2 K,)."""
    graph: Graph
    """The first three, as sweeps take them."""


def pair_graph(first: Array, second: Array, sizes: tuple[int, int]) -> PairGraph:
    """Graph of the pairs of members (from 0) of two lists of these sizes."""
    ends = np.stack([first, sizes[0] + second], axis=1).astype(np.int64)
    ptr, edge, mate = _listed(ends, sum(sizes))
    return PairGraph(ends, ptr, edge, mate, Graph(ends, ptr, edge))


@njit
def _listed(ends: Ints, vertices: int) -> tuple[Ints, Ints, Ints]:
    """The edges of each vertex: the fields of a `PairGraph` after the first."""
    ptr, count = np.zeros(vertices + 1, np.int64), len(ends)
    for e in range(count):
        ptr[ends[e, 0] + 1] += 1
        ptr[ends[e, 1] + 1] += 1
    for v in range(vertices):
        ptr[v + 1] += ptr[v]
    free, edge, mate = ptr.copy(), np.empty(2 * count, np.int64), np.empty(2 * count, np.int64)
    for e in range(count):
        x, y = free[ends[e, 0]], free[ends[e, 1]]
        edge[x] = edge[y] = e
        mate[x], mate[y] = y, x
        free[ends[e, 0]] += 1
        free[ends[e, 1]] += 1
    return ptr, edge, mate
