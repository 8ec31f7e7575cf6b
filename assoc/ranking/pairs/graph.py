"""Pairs of two lists as a graph: members of both lists are vertices, pairs are edges, joint events are matchings."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

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
    count = len(first)
    ends = np.stack([first, sizes[0] + second], axis=1).astype(np.int64)
    vertex = ends.T.reshape(-1)
    order = np.argsort(vertex, kind="stable")
    ptr = np.zeros(sum(sizes) + 1, dtype=np.int64)
    np.cumsum(np.bincount(vertex, minlength=sum(sizes)), out=ptr[1:])
    index = np.empty(2 * count, dtype=np.int64)
    index[order] = np.arange(2 * count)
    edge = order % max(count, 1)
    return PairGraph(ends, ptr, edge, index[(order + count) % max(2 * count, 1)], Graph(ends, ptr, edge))
