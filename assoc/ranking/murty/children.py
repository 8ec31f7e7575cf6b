"""The children of a solution in Murty's ranking: their bounds, their shortest paths, their multipliers.

Rows and columns that may stay alone are joined to one more node, the dummy, with potential z: a row that
stays alone is matched to it, a column that stays alone is matched by it, and a path may lead through it. The
dummy takes many at once, so that by complementary slackness its edges in use have reduced costs <= 0, not 0.

Nodes are rows of arrays (``murty.Murty`` owns them): the edge of each row, the row of each column, the
multipliers u and v (the dummy's is the last of v), the order in which rows are split by, how many of them
are fixed, and the link to the edge that the node's own row may not use.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from assoc._system.compiled import njit
from assoc._types import Floats
from assoc.packing.kernels.heap import pop, push

ALONE = -1


@njit
def set_taboo(
    parent: int, place: int, columns: Any, edge_of: Any, order: Any, fixed: Any, forbidden: Any, taboo_row: Any,
    taboo_column: Any, taboo_edge: Any, on: bool
) -> None:  # fmt: skip
    """Mark (or unmark) what the child at ``place`` may not touch: its fixed rows and its forbidden edges."""
    for t in range(place):
        r = order[parent, t]
        taboo_row[r] = on
        if edge_of[parent, r] >= 0:
            taboo_column[columns[edge_of[parent, r]]] = on
    own = edge_of[parent, order[parent, place]]
    if own >= 0:
        taboo_edge[own] = on
    if place == fixed[parent]:
        node = parent
        while node >= 0 and forbidden[node, 1] != -1:
            # an entry is 2 + edge, so that 1 stands for staying alone
            if forbidden[node, 1] >= 2:
                taboo_edge[forbidden[node, 1] - 2] = on
            node = forbidden[node, 0]


@njit
def may_stay_alone(parent: int, row: int, edge_of: Any, order: Any, fixed: Any, forbidden: Any, row_alone: Any) -> bool:
    """Whether the child of ``row`` may leave that row alone."""
    if not row_alone[row] or edge_of[parent, row] == ALONE:
        return False
    if fixed[parent] < order.shape[1] and order[parent, fixed[parent]] == row:
        node = parent
        while node >= 0 and forbidden[node, 1] != -1:
            if forbidden[node, 1] == 1:
                return False
            node = forbidden[node, 0]
    return True


@njit
def _relax(room: Any, size: int, num_reached: int, item: int, value: float, edge: int, row: int) -> Any:
    """Offer a way to a column (or the dummy); the sizes of the queue and of the list of what was reached."""
    distance, previous, previous_row, closed, reached, _, _, queue_key, queue_item = room
    if closed[item] or value >= distance[item]:
        return size, num_reached
    if distance[item] == np.inf:
        reached[num_reached] = item
        num_reached += 1
    distance[item] = value
    previous[item] = edge
    previous_row[item] = row
    push(queue_key, queue_item, size, value, item)
    return size + 1, num_reached


@njit
def search_path(
    parent: int, row: int, alone: bool, limit: float, costs: Floats, columns: Any, row_ptr: Any, row_edges: Any,
    row_alone: Any, column_alone: Any, edge_of: Any, row_of: Any, u: Any, v: Any, taboo_row: Any, taboo_column: Any,
    taboo_edge: Any, room: Any,
) -> Any:  # fmt: skip
    """Dijkstra from a row to what its parent matched it to; length (inf: above the limit), reached, tree."""
    distance, _, _, closed, _, tree_row, tree_distance, queue_key, queue_item = room
    dummy = column_alone.size
    own = edge_of[parent, row]
    target = columns[own] if own >= 0 else dummy
    z = v[parent, dummy]
    size, num_reached, num_tree = 0, 0, 0
    # a row that leaves the dummy: its edge to it may be cheaper than tight, as those of a full node may
    i, d = row, (0.0 if own >= 0 else max(0.0, u[parent, row] + z))
    while True:
        if i >= 0:
            tree_row[num_tree] = i
            tree_distance[num_tree] = d
            num_tree += 1
            for x in range(row_ptr[i], row_ptr[i + 1]):
                e = row_edges[x]
                j = columns[e]
                if taboo_column[j] or (i == row and taboo_edge[e]):
                    continue
                value = d + max(0.0, costs[e] - u[parent, i] - v[parent, j])
                if value <= limit:
                    size, num_reached = _relax(room, size, num_reached, j, value, e, i)
            if alone if i == row else (row_alone[i] and edge_of[parent, i] != ALONE):
                value = d + max(0.0, -u[parent, i] - z)
                if value <= limit:
                    size, num_reached = _relax(room, size, num_reached, dummy, value, -1, i)
        item = -1
        while size > 0:
            d = queue_key[0]
            item = queue_item[0]
            size -= 1
            pop(queue_key, queue_item, size)
            if not closed[item] and d == distance[item]:
                break
            item = -1
        if item < 0:
            return np.inf, num_reached, num_tree
        if item == target:
            return d, num_reached, num_tree
        closed[item] = True
        i = -1
        if item > dummy:
            i = item - dummy - 1
        elif item == dummy:
            for j in range(dummy):
                if column_alone[j] and not taboo_column[j] and row_of[parent, j] != ALONE:
                    value = d + max(0.0, z - v[parent, j])
                    if value <= limit:
                        size, num_reached = _relax(room, size, num_reached, j, value, -1, -1)
            for r in range(row_alone.size):
                if edge_of[parent, r] == ALONE and not taboo_row[r] and r != row:
                    value = d + max(0.0, u[parent, r] + z)
                    if value <= limit:
                        size, num_reached = _relax(room, size, num_reached, dummy + 1 + r, value, -1, -1)
        elif row_of[parent, item] == ALONE:
            # the dummy that held this column is free now
            value = d + max(0.0, v[parent, item] - z)
            if value <= limit:
                size, num_reached = _relax(room, size, num_reached, dummy, value, item, -1)
        else:
            i = row_of[parent, item]


@njit
def clear(room: Any, num_reached: int) -> None:
    """Make the working arrays ready for the next path."""
    distance, _, _, closed, reached, _, _, _, _ = room
    for t in range(num_reached):
        distance[reached[t]] = np.inf
        closed[reached[t]] = False


@njit
def make_node(
    node: int, parent: int, place: int, alone: bool, costs: Floats, columns: Any, row_ptr: Any, row_edges: Any,
    row_alone: Any, column_alone: Any, edge_of: Any, row_of: Any, u: Any, v: Any, order: Any, fixed: Any,
    forbidden: Any, node_cost: Any, taboo_row: Any, taboo_column: Any, taboo_edge: Any, room: Any,
) -> None:  # fmt: skip
    """Turn a child into a node: its solution and the multipliers that prove it the best of its kind."""
    distance, previous, previous_row, closed, reached, tree_row, tree_distance, _, _ = room
    dummy = column_alone.size
    row = order[parent, place]
    length, num_reached, num_tree = search_path(
        parent, row, alone, np.inf, costs, columns, row_ptr, row_edges, row_alone, column_alone, edge_of, row_of,
        u, v, taboo_row, taboo_column, taboo_edge, room,
    )  # fmt: skip
    edge_of[node] = edge_of[parent]
    row_of[node] = row_of[parent]
    u[node] = u[parent]
    v[node] = v[parent]
    order[node] = order[parent]
    fixed[node] = place
    own = edge_of[parent, row]
    forbidden[node, 0] = parent if place == fixed[parent] else -1
    forbidden[node, 1] = own + 2 if own >= 0 else 1
    node_cost[node] = node_cost[parent] + length
    for t in range(num_tree):
        u[node, tree_row[t]] += length - tree_distance[t]
    for t in range(num_reached):
        if closed[reached[t]] and reached[t] <= dummy:
            v[node, reached[t]] -= length - distance[reached[t]]
    item = columns[own] if own >= 0 else dummy
    while True:
        i = previous_row[item]
        if i >= 0:
            edge_of[node, i] = previous[item] if item != dummy else ALONE
            if item != dummy:
                row_of[node, item] = i
            if i == row:
                break
            before = edge_of[parent, i]
            item = columns[before] if before >= 0 else dummy
        elif item == dummy:
            item = previous[item]
        else:
            row_of[node, item] = ALONE
            item = dummy
    clear(room, num_reached)


@njit
def open_children(
    node: int, worst: float, costs: Floats, rows: Any, columns: Any, index: Any, row_alone: Any, column_alone: Any,
    edge_of: Any, u: Any, v: Any, order: Any, fixed: Any, node_cost: Any, taboo_row: Any, taboo_column: Any,
    heap_key: Any, heap_item: Any, size: int, limits: Any,
) -> int:  # fmt: skip
    """Queue the children of a node by their bounds; the size of the queue."""
    num_rows = row_alone.size
    first = fixed[node]
    for t in range(first):
        r = order[node, t]
        taboo_row[r] = True
        if edge_of[node, r] >= 0:
            taboo_column[columns[edge_of[node, r]]] = True
    if first < num_rows:
        # the row with forbidden edges stays first, so that all other children have it fixed
        start = first + 1 if first > 0 or node > 0 else first
        bounds = np.empty(num_rows - start)
        for t in range(start, num_rows):
            bounds[t - start] = -_way_round(
                node, order[node, t], costs, rows, columns, index, row_alone, column_alone, edge_of, u, v, taboo_row,
                taboo_column,
            )  # fmt: skip
        order[node, start:] = order[node, start:][np.argsort(bounds)]
    for t in range(first, num_rows):
        r = order[node, t]
        bound = node_cost[node] + _way_round(
            node, r, costs, rows, columns, index, row_alone, column_alone, edge_of, u, v, taboo_row, taboo_column
        )
        if bound <= worst:
            if bound < np.inf:
                push(heap_key, heap_item, size, bound, (np.int64(node) * num_rows + t) << 1)
                size += 1
        else:
            limits[0] = min(limits[0], worst)
        taboo_row[r] = True
        if edge_of[node, r] >= 0:
            taboo_column[columns[edge_of[node, r]]] = True
    for r in range(num_rows):
        taboo_row[r] = False
    taboo_column[:] = False
    return size


@njit
def _way_round(
    node: int, row: int, costs: Floats, rows: Any, columns: Any, index: Any, row_alone: Any, column_alone: Any,
    edge_of: Any, u: Any, v: Any, taboo_row: Any, taboo_column: Any
) -> float:  # fmt: skip
    """Return a bound on any path from a row to what it is matched to: the first step and the last."""
    row_ptr, row_edges, column_ptr, column_edges = index
    own = edge_of[node, row]
    z = v[node, column_alone.size]
    out = np.inf
    if own >= 0 and row_alone[row]:
        out = max(0.0, -u[node, row] - z)
    for x in range(row_ptr[row], row_ptr[row + 1]):
        e = row_edges[x]
        if e != own and not taboo_column[columns[e]]:
            out = min(out, max(0.0, costs[e] - u[node, row] - v[node, columns[e]]))
    if own < 0:
        return out + max(0.0, u[node, row] + z)
    if out == np.inf:
        return out
    column = columns[own]
    into = max(0.0, z - v[node, column]) if column_alone[column] else np.inf
    for x in range(column_ptr[column], column_ptr[column + 1]):
        e = column_edges[x]
        if e != own and not taboo_row[rows[e]]:
            into = min(into, max(0.0, costs[e] - u[node, rows[e]] - v[node, column]))
    return out + into
