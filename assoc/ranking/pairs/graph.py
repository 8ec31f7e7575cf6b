"""Pairs of two lists as a graph: members of both lists are vertices, pairs are edges, joint events are matchings."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import njit
from assoc._types import Array, Ints


class PairGraph(NamedTuple):
    """V vertices, those of the first list first, and K edges, each listed twice: once for each end.

    Attributes
    ----------
    ends : int64 array (K, 2)
        Vertices of each edge.
    ptr : int64 array (V + 1,)
        Vertex v has the edge ends ``ptr[v]:ptr[v + 1]``.
    edge : int64 array (2 K,)
        Edge of each edge end.
    mate : int64 array (2 K,)
        Index of the edge's other end.
    """

    ends: Ints
    ptr: Ints
    edge: Ints
    mate: Ints


def pair_graph(first: Array, second: Array, sizes: tuple[int, int]) -> PairGraph:
    """Graph of the pairs of members (from 0) of two lists of these sizes."""
    count = len(first)
    ends = np.stack([first, sizes[0] + second], axis=1).astype(np.int64)
    vertex = ends.T.reshape(-1)
    order = np.argsort(vertex, kind="stable")
    ptr = np.zeros(sum(sizes) + 1, dtype=np.int64)
    np.cumsum(np.bincount(vertex, minlength=sum(sizes)), out=ptr[1:])
    index = np.empty(2 * count, dtype=np.int64)
    index[order] = np.arange(2 * count)
    return PairGraph(ends, ptr, order % max(count, 1), index[(order + count) % max(2 * count, 1)])


@njit
def cluster(graph: PairGraph, kept: NDArray[np.bool_], start: int, number: int, label: Ints, members: Ints) -> int:
    """Label the cluster of a vertex and list its members; return how many."""
    members[0], label[start] = start, number
    size = 1
    at = 0
    while at < size:
        v = members[at]
        at += 1
        for x in range(graph.ptr[v], graph.ptr[v + 1]):
            e = graph.edge[x]
            u = graph.ends[e, 0] + graph.ends[e, 1] - v
            if kept[e] and label[u] < 0:
                label[u] = number
                members[size] = u
                size += 1
    return size
