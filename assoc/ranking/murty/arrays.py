"""The arrays of Murty's ranking: the edges, the solutions found, the open children, and room for shortest paths."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import inner_njit, njit
from assoc._types import Ints

ALONE = -1


class Graph(NamedTuple):
    """Edges between rows and columns, and the edges still in use, listed by row and by column.

    Edge e joins ``rows[e]`` and ``columns[e]`` at ``costs[e]``; ``row_alone`` and ``column_alone`` say which may stay
    unmatched (at no cost). Row r has the edges ``row_edges[row_ptr[r]:row_ptr[r + 1]]``, and columns likewise.
    """

    costs: NDArray[np.float64]
    rows: NDArray[np.int32]
    columns: NDArray[np.int32]
    row_alone: NDArray[np.bool_]
    column_alone: NDArray[np.bool_]
    row_ptr: NDArray[np.int64]
    row_edges: NDArray[np.int32]
    column_ptr: NDArray[np.int64]
    column_edges: NDArray[np.int32]


class Nodes(NamedTuple):
    """Solutions found, one a row of each array.

    The edge of each row, the row of each column, the multipliers u and v (the dummy's is the last of v), the order in
    which rows are branched on, how many of them are fixed, the edge that the first free row must not use, as a list
    through the parents (parent, 2 + edge; 1: staying unmatched), and the cost of the solution.
    """

    edge_of: NDArray[np.int32]
    row_of: NDArray[np.int32]
    u: NDArray[np.float64]
    v: NDArray[np.float64]
    order: NDArray[np.int32]
    fixed: NDArray[np.int32]
    forbidden: NDArray[np.int32]
    cost: NDArray[np.float64]


class Queues(NamedTuple):
    """Open children by cost or bound, and the k least costs known.

    ``counts``: solutions, open children, costs known, shortest paths so far. ``limits``: a lower bound on the cost of
    everything left out, and the cost above which children are left out.
    """

    key: NDArray[np.float64]
    item: NDArray[np.int64]
    best: NDArray[np.float64]
    best_item: NDArray[np.int64]
    counts: NDArray[np.int64]
    limits: NDArray[np.float64]


class Forbidden(NamedTuple):
    """Rows, columns and edges that a path must not use."""

    row: NDArray[np.bool_]
    column: NDArray[np.bool_]
    edge: NDArray[np.bool_]


class PathWork(NamedTuple):
    """Buffers for a shortest path: through columns, the dummy, and from there to unmatched rows."""

    distance: NDArray[np.float64]
    previous: NDArray[np.int64]
    previous_row: NDArray[np.int64]
    closed: NDArray[np.bool_]
    reached: NDArray[np.int64]
    tree_row: NDArray[np.int64]
    tree_distance: NDArray[np.float64]
    queue_key: NDArray[np.float64]
    queue_item: NDArray[np.int64]


def new_nodes(capacity: int, num_rows: int, num_columns: int) -> Nodes:
    """Allocate nodes for ``capacity`` solutions."""
    return Nodes(
        edge_of=np.empty((capacity, num_rows), np.int32),
        row_of=np.empty((capacity, num_columns), np.int32),
        u=np.empty((capacity, num_rows)),
        v=np.empty((capacity, num_columns + 1)),
        order=np.empty((capacity, num_rows), np.int32),
        fixed=np.empty(capacity, np.int32),
        forbidden=np.empty((capacity, 2), np.int32),
        cost=np.empty(capacity),
    )


def new_queues(k: int, num_rows: int) -> Queues:
    """Allocate queues for the first open children."""
    return Queues(
        key=np.empty(max(64, 4 * num_rows)),
        item=np.empty(max(64, 4 * num_rows), np.int64),
        best=np.empty(min(k, 64)),
        best_item=np.empty(min(k, 64), np.int64),
        counts=np.zeros(4, np.int64),
        limits=np.array([np.inf, np.inf]),
    )


def with_edges(graph: Graph, keep: NDArray[np.intp]) -> Graph:
    """Return the graph with the edges ``keep`` listed by row and by column, and no others."""
    index = index_edges(graph.rows, graph.columns, graph.row_alone.size, graph.column_alone.size, keep)
    return Graph(*graph[:5], *index)


def twice(array: NDArray[Any]) -> NDArray[Any]:
    """Return a copy with twice the room along the first axis."""
    return np.concatenate([array, np.empty_like(array)])


@njit
def index_edges(rows: Ints, columns: Ints, num_rows: int, num_columns: int, keep: Ints) -> Any:
    """List the edges ``keep`` by row and by column."""
    row_ptr = np.zeros(num_rows + 1, np.int64)
    column_ptr = np.zeros(num_columns + 1, np.int64)
    for e in keep:
        row_ptr[rows[e] + 1] += 1
        column_ptr[columns[e] + 1] += 1
    for r in range(num_rows):
        row_ptr[r + 1] += row_ptr[r]
    for c in range(num_columns):
        column_ptr[c + 1] += column_ptr[c]
    row_edges = np.empty(keep.size, np.int32)
    column_edges = np.empty(keep.size, np.int32)
    row_place, column_place = row_ptr[:-1].copy(), column_ptr[:-1].copy()
    for e in keep:
        row_edges[row_place[rows[e]]] = e
        row_place[rows[e]] += 1
        column_edges[column_place[columns[e]]] = e
        column_place[columns[e]] += 1
    return row_ptr, row_edges, column_ptr, column_edges


@inner_njit
def new_forbidden(graph: Graph) -> Forbidden:
    """Nothing is forbidden yet."""
    return Forbidden(
        np.zeros(graph.row_alone.size, np.bool_),
        np.zeros(graph.column_alone.size, np.bool_),
        np.zeros(graph.costs.size, np.bool_),
    )


@inner_njit
def new_path_work(graph: Graph) -> PathWork:
    """Allocate buffers for shortest paths."""
    num_rows, num_columns = graph.row_alone.size, graph.column_alone.size
    num_items = num_columns + 1 + num_rows
    # each edge is queued at most once, and so is each step to and from the dummy
    num_offers = graph.row_edges.size + 2 * num_rows + 2 * num_columns + 2
    return PathWork(
        np.full(num_items, np.inf),
        np.empty(num_items, np.int64),
        np.empty(num_items, np.int64),
        np.zeros(num_items, np.bool_),
        np.empty(num_items, np.int64),
        np.empty(num_rows + 1, np.int64),
        np.empty(num_rows + 1),
        np.empty(num_offers),
        np.empty(num_offers, np.int64),
    )
