"""The kernel of branch and bound: takes nodes from a stack until it is empty or a limit is reached.

At each node it solves the linear program, rounds its solution, and chooses a pair to branch on. Columns and sides of
pairs that the linear program alone excludes are dropped at once.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from assoc._system.clock import is_over
from assoc._system.compiled import inner_njit, lean_inner_njit, njit
from assoc._system.kernels.copying import copy_to
from assoc._system.kernels.sorting import order_of
from assoc.packing.branching.node import Work, allowed_at, branch, drop, keep_side, open_node, relax
from assoc.packing.branching.open_nodes import Stack, has_room
from assoc.packing.branching.pairs import NEITHER, TOGETHER, WHOLE, any_open_pair, decide, doubtful_pairs
from assoc.packing.simplex.dual import OPTIMAL, STOPPED, Effort
from assoc.packing.simplex.program import Allowed


class Limits(NamedTuple):
    """Which solutions to search for, and when to stop."""

    tolerance: float
    """Least improvement on the incumbent."""
    aim: float
    """Weight below which solutions must be."""
    nodes: int
    """Most nodes."""
    deadline: float
    """Time limit by the kernels' clock (clock.py)."""


@inner_njit
def _greedy(work: Work, allowed: Allowed) -> Any:
    """Take columns by ``key`` while they fit; the weight (inf if a row without slack stays uncovered), the number."""
    cols, weights, trial, active, slack = work.cols, work.weights, work.trial, allowed.active, allowed.slack
    covered = np.zeros(trial.size, np.bool_)
    weight = 0.0
    count = 0
    for a in order_of(work.key[: active.size]):
        j = active[a]
        free = True
        duty = False
        for s in range(cols.shape[1]):
            r = cols[j, s]
            if r >= 0:
                if covered[r]:
                    free = False
                    break
                duty = duty or not slack[r]
        if free and (weights[j] < 0.0 or duty):
            weight += weights[j]
            trial[count] = j
            count += 1
            for s in range(cols.shape[1]):
                if cols[j, s] >= 0:
                    covered[cols[j, s]] = True
    for r in range(covered.size):
        if not slack[r] and not covered[r]:
            return np.inf, count
    return weight, count


@lean_inner_njit
def _by_values(work: Work, allowed: Allowed) -> bool:
    """Lower the keys by the LP's values, so that large values come first; whether all are whole numbers."""
    in_basis, values, active, key = work.basis.position, work.basis.values, allowed.active, work.key
    whole = True
    for a in range(active.size):
        position = in_basis[active[a]]
        if position >= 0:
            value = values[position]
            whole = whole and not WHOLE < value < 1.0 - WHOLE
            key[a] -= value * work.limit
    return whole


@inner_njit
def _lightest(work: Work, num: int) -> Any:
    """As `_greedy`, by weight: where columns that share a row are equal, the lightest of each kind."""
    for a in range(num):
        work.key[a] = work.weights[work.node.active[a]]
    return _greedy(work, allowed_at(work, num))


@njit
def search_depth_first(work: Work, stack: Stack, num_open: int, incumbent: float, limits: Limits) -> Any:
    """Search depth first; the number of open nodes, the incumbent's weight and number of columns, the nodes done.

    Stops early with nodes open when there is no room left for two children, or time is over.
    """
    tolerance, aim, node_limit, deadline = limits
    cols, program, basis, trials = work.cols, work.program, work.basis, work.trials
    count_found = -1
    nodes = 0
    # the node whose basis is loaded
    at_work = -1
    while num_open > 0 and nodes < node_limit:
        top = num_open - 1
        lower = stack.bound[top]
        if lower >= min(incumbent - tolerance, aim):
            num_open = top
            continue
        # pruned nodes need no room: giving them up for want of it would end the passes
        if not has_room(stack, top):
            break
        num = open_node(work, stack, top, at_work)
        at_work = -1
        row, other, likely = -1, -1, 0.5
        closed = False
        late = False
        while True:
            cut = min(incumbent - tolerance, aim, work.limit)
            # a little more than the cut, as rounding lowers the bound
            status, bound = relax(work, num, cut + 0.1 * tolerance, deadline)
            if status == STOPPED and is_over(deadline):
                late = True
                break
            lower = max(lower, bound)
            if lower >= cut:
                closed = True
                break
            num = drop(work, num, bound, cut)
            allowed = allowed_at(work, num)
            whole = status == OPTIMAL and _by_values(work, allowed)
            weight, count = _greedy(work, allowed)
            if weight < incumbent - 1e-3 * tolerance:
                incumbent = weight
                count_found = count
                copy_to(work.found[:count], work.trial[:count])
                cut = min(cut, incumbent - tolerance)
                if lower >= cut:
                    closed = True
                    break
                num = drop(work, num, bound, cut)
                allowed = allowed_at(work, num)
            in_doubt = 0
            if status == OPTIMAL and not whole:
                in_doubt = doubtful_pairs(cols, basis, trials)
            if in_doubt == 0:
                row, other = any_open_pair(cols, allowed, work.trial)
                break
            which, verdict = decide(program, cols, allowed, basis, trials, in_doubt, Effort(cut, 0, deadline))
            row, other, likely = int(trials.pairs[which, 0]), int(trials.pairs[which, 1]), trials.values[which]
            if verdict == NEITHER:
                break
            num = keep_side(work, num, (row, other), verdict == TOGETHER)
        if late:
            # the node is unchanged on the stack
            break
        num_open = top
        nodes += 1
        if closed:
            continue
        if row < 0:
            weight, count = _lightest(work, num)
            if weight < incumbent:
                incumbent = weight
                count_found = count
                copy_to(work.found[:count], work.trial[:count])
            continue
        num_open = branch(work, stack, top, num, (row, other), likely >= 0.5, lower)
        at_work = num_open - 1
    return num_open, incumbent, count_found, nodes
