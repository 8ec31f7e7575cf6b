"""The children of a solution in Murty's ranking: their bounds, their shortest paths, their multipliers.

Rows and columns that may stay unmatched are joined to one more node, the dummy, with potential z: unmatched rows
and columns are matched to it, and a path may lead through it. The dummy can be matched many times, so that by
complementary slackness its matched edges have reduced costs <= 0, not 0.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from assoc._system.compiled import inner_njit
from assoc._system.kernels.copying import copy_to
from assoc._system.kernels.sorting import order_of
from assoc.packing.kernels.heap import pop, push
from assoc.ranking.murty.arrays import ALONE, Forbidden, Graph, Nodes, PathWork, Queues


@inner_njit
def set_forbidden(graph: Graph, nodes: Nodes, forbidden: Forbidden, parent: int, child: int, on: bool) -> None:
    """Mark or unmark what a child, the index of its row, must not use: its fixed rows and its forbidden edges."""
    for t in range(child):
        r = nodes.order[parent, t]
        forbidden.row[r] = on
        if nodes.edge_of[parent, r] >= 0:
            forbidden.column[graph.columns[nodes.edge_of[parent, r]]] = on
    matched = nodes.edge_of[parent, nodes.order[parent, child]]
    if matched >= 0:
        forbidden.edge[matched] = on
    if child == nodes.fixed[parent]:
        links = nodes.forbidden
        node = parent
        while node >= 0 and links[node, 1] != -1:
            # an entry is 2 + edge, so that 1 stands for staying unmatched
            if links[node, 1] >= 2:
                forbidden.edge[links[node, 1] - 2] = on
            node = links[node, 0]


@inner_njit
def may_stay_alone(graph: Graph, nodes: Nodes, parent: int, row: int) -> bool:
    """Whether the child of ``row`` may leave that row unmatched."""
    order, fixed, links = nodes.order, nodes.fixed, nodes.forbidden
    if not graph.row_alone[row] or nodes.edge_of[parent, row] == ALONE:
        return False
    if fixed[parent] < order.shape[1] and order[parent, fixed[parent]] == row:
        node = parent
        while node >= 0 and links[node, 1] != -1:
            if links[node, 1] == 1:
                return False
            node = links[node, 0]
    return True


@inner_njit
def _relax(work: PathWork, size: int, num_reached: int, item: int, value: float, edge: int, row: int) -> Any:
    """Relax an edge to a column (or the dummy); the sizes of the queue and of the list of reached nodes."""
    distance, previous, previous_row, closed, reached, _, _, queue_key, queue_item = work
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


@inner_njit
def search_path(
    graph: Graph, nodes: Nodes, forbidden: Forbidden, work: PathWork, parent: int, row: int, alone: bool, limit: float
) -> Any:
    """Dijkstra from a row to what its parent matched it to; length (inf: above the limit), reached, tree."""
    costs, columns, row_ptr, row_edges = graph.costs, graph.columns, graph.row_ptr, graph.row_edges
    row_alone, column_alone = graph.row_alone, graph.column_alone
    edge_of, row_of, u, v = nodes.edge_of, nodes.row_of, nodes.u, nodes.v
    forbidden_row, forbidden_column, forbidden_edge = forbidden
    distance, _, _, closed, _, tree_row, tree_distance, queue_key, queue_item = work
    dummy = column_alone.size
    matched = edge_of[parent, row]
    target = columns[matched] if matched >= 0 else dummy
    z = v[parent, dummy]
    size, num_reached, num_tree = 0, 0, 0
    # the row leaves the dummy: the reduced cost of that edge may be negative
    i, d = row, (0.0 if matched >= 0 else max(0.0, u[parent, row] + z))
    while True:
        if i >= 0:
            tree_row[num_tree] = i
            tree_distance[num_tree] = d
            num_tree += 1
            for x in range(row_ptr[i], row_ptr[i + 1]):
                e = row_edges[x]
                j = columns[e]
                if forbidden_column[j] or (i == row and forbidden_edge[e]):
                    continue
                value = d + max(0.0, costs[e] - u[parent, i] - v[parent, j])
                if value <= limit:
                    size, num_reached = _relax(work, size, num_reached, j, value, e, i)
            if alone if i == row else (row_alone[i] and edge_of[parent, i] != ALONE):
                value = d + max(0.0, -u[parent, i] - z)
                if value <= limit:
                    size, num_reached = _relax(work, size, num_reached, dummy, value, -1, i)
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
                if column_alone[j] and not forbidden_column[j] and row_of[parent, j] != ALONE:
                    value = d + max(0.0, z - v[parent, j])
                    if value <= limit:
                        size, num_reached = _relax(work, size, num_reached, j, value, -1, -1)
            for r in range(row_alone.size):
                if edge_of[parent, r] == ALONE and not forbidden_row[r] and r != row:
                    value = d + max(0.0, u[parent, r] + z)
                    if value <= limit:
                        size, num_reached = _relax(work, size, num_reached, dummy + 1 + r, value, -1, -1)
        elif row_of[parent, item] == ALONE:
            # the dummy that held this column is free now
            value = d + max(0.0, v[parent, item] - z)
            if value <= limit:
                size, num_reached = _relax(work, size, num_reached, dummy, value, item, -1)
        else:
            i = row_of[parent, item]


@inner_njit
def clear(work: PathWork, num_reached: int) -> None:
    """Make the working arrays ready for the next path."""
    for t in range(num_reached):
        work.distance[work.reached[t]] = np.inf
        work.closed[work.reached[t]] = False


@inner_njit
def make_node(
    graph: Graph, nodes: Nodes, forbidden: Forbidden, work: PathWork, node: int, parent: int, child: int, alone: bool
) -> None:
    """Turn a child into a node: its solution and the multipliers that prove it the best of its kind."""
    columns = graph.columns
    edge_of, row_of, u, v, order, fixed, links, node_cost = nodes
    distance, previous, previous_row, closed, reached, tree_row, tree_distance, _, _ = work
    dummy = graph.column_alone.size
    row = order[parent, child]
    length, num_reached, num_tree = search_path(graph, nodes, forbidden, work, parent, row, alone, np.inf)
    copy_to(edge_of[node], edge_of[parent])
    copy_to(row_of[node], row_of[parent])
    copy_to(u[node], u[parent])
    copy_to(v[node], v[parent])
    copy_to(order[node], order[parent])
    fixed[node] = child
    matched = edge_of[parent, row]
    links[node, 0] = parent if child == fixed[parent] else -1
    links[node, 1] = matched + 2 if matched >= 0 else 1
    node_cost[node] = node_cost[parent] + length
    for t in range(num_tree):
        u[node, tree_row[t]] += length - tree_distance[t]
    for t in range(num_reached):
        if closed[reached[t]] and reached[t] <= dummy:
            v[node, reached[t]] -= length - distance[reached[t]]
    item = columns[matched] if matched >= 0 else dummy
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
    clear(work, num_reached)


@inner_njit
def open_children(graph: Graph, nodes: Nodes, forbidden: Forbidden, queues: Queues, node: int, worst: float) -> None:
    """Queue the children of a node by their bounds."""
    columns, row_alone = graph.columns, graph.row_alone
    edge_of, order, fixed, node_cost = nodes.edge_of, nodes.order, nodes.fixed, nodes.cost
    forbidden_row, forbidden_column, counts, limits = forbidden.row, forbidden.column, queues.counts, queues.limits
    num_rows = row_alone.size
    first = fixed[node]
    for t in range(first):
        r = order[node, t]
        forbidden_row[r] = True
        if edge_of[node, r] >= 0:
            forbidden_column[columns[edge_of[node, r]]] = True
    if first < num_rows:
        # the row with forbidden edges stays first, so that all other children have it fixed
        start = first + 1 if first > 0 or node > 0 else first
        bounds = np.empty(num_rows - start)
        for t in range(start, num_rows):
            bounds[t - start] = -_way_round(graph, nodes, forbidden, node, order[node, t])
        copy_to(order[node, start:], order[node, start:][order_of(bounds)])
    for t in range(first, num_rows):
        r = order[node, t]
        bound = node_cost[node] + _way_round(graph, nodes, forbidden, node, r)
        if bound <= worst:
            if bound < np.inf:
                push(queues.key, queues.item, counts[1], bound, (np.int64(node) * num_rows + t) << 1)
                counts[1] += 1
        else:
            limits[0] = min(limits[0], worst)
        forbidden_row[r] = True
        if edge_of[node, r] >= 0:
            forbidden_column[columns[edge_of[node, r]]] = True
    for r in range(num_rows):
        forbidden_row[r] = False
    forbidden_column[:] = False


@inner_njit
def _way_round(graph: Graph, nodes: Nodes, forbidden: Forbidden, node: int, row: int) -> float:
    """Return a bound on any path from a row to what it is matched to: the first step and the last."""
    costs, rows, columns, row_alone, column_alone, row_ptr, row_edges, column_ptr, column_edges = graph
    edge_of, u, v = nodes.edge_of, nodes.u, nodes.v
    forbidden_row, forbidden_column = forbidden.row, forbidden.column
    matched = edge_of[node, row]
    z = v[node, column_alone.size]
    out = np.inf
    if matched >= 0 and row_alone[row]:
        out = max(0.0, -u[node, row] - z)
    for x in range(row_ptr[row], row_ptr[row + 1]):
        e = row_edges[x]
        if e != matched and not forbidden_column[columns[e]]:
            out = min(out, max(0.0, costs[e] - u[node, row] - v[node, columns[e]]))
    if matched < 0:
        return out + max(0.0, u[node, row] + z)
    if out == np.inf:
        return out
    column = columns[matched]
    into = max(0.0, z - v[node, column]) if column_alone[column] else np.inf
    for x in range(column_ptr[column], column_ptr[column + 1]):
        e = column_edges[x]
        if e != matched and not forbidden_row[rows[e]]:
            into = min(into, max(0.0, costs[e] - u[node, rows[e]] - v[node, column]))
    return out + into
