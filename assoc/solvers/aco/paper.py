"""The ant colony of the paper, equations 7 to 11 on costs made positive.

Nodes are the tuples, false alarms among them. In the first cycle each ant starts on a different random node
and moves to the allowed node of largest visibility eta = 1 / c (eq. 7), of equal ones to the first. In later cycles an
ant starts on a node of its own previous tour (or of any ant's: ``start_on``) and draws the next node by eq. 8. A tour
ends when no node is allowed. Then pheromone evaporates, and ant k lays 1 / L_k on each node of its tour (eqs. 9-11).
Pheromone starts equal to the visibility. The search ends when all ants have walked the same tour, as a set of nodes, in
whatever order, or after ``iterations`` cycles; the answer is the cheapest tour of all cycles.

Eq. 7 needs positive costs, but eq. 5 also gives negative ones: c is replaced by a positive transform that keeps the
order, selected by the parameter ``visibility``; L_k is the sum of the transformed costs of a tour.
Costs are relative to the false alarms: tuples that cost no less than their singletons are nodes if ``tuples`` is "all".
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assoc._system.clock import now
from assoc._system.compiled import njit
from assoc._types import Floats
from assoc.errors import InfeasibleError, InvalidInputError
from assoc.packing.cover import Cover
from assoc.packing.packing import Packing
from assoc.packing.run import Outcome, Run
from assoc.packing.short_branching import bound_of_choice
from assoc.solvers.aco.colony import Cycle

if TYPE_CHECKING:
    from assoc.solvers.aco.parameters import AcoParameters


def solve_as_in_the_paper(packing: Packing, parameters: AcoParameters, run: Run) -> Outcome:
    """Run the paper's ant colony on the whole problem; one iteration is one cycle of all ants.

    InfeasibleError if no ant completed a tour (possible only without dummies).
    """
    alone = false_alarms(packing)
    nodes, costs = nodes_of(packing, alone)
    if costs.size == 0:
        return Outcome(np.zeros(0, dtype=np.int64), 0, 0.0)
    positive = transformed(costs, parameters.visibility, parameters.scale)
    visibility = 1.0 / positive  # eq. 7
    pheromone = visibility.copy()
    tours = np.full((parameters.ants, packing.num_rows), -1, dtype=np.int32)
    lengths = np.zeros(parameters.ants, dtype=np.int64)
    starts = run.rng.permutation(costs.size)[np.arange(parameters.ants) % costs.size]
    best: NDArray[np.integer] | None = run.start
    best_weight = np.inf if run.start is None else float(packing.weights[run.start].sum())
    cycle, cut_off = 0, False
    while cycle < parameters.iterations:
        if cycle > 0:
            if not lengths.all():
                # the time limit came before every ant had walked
                break
            ants = np.arange(parameters.ants)
            whose = run.rng.integers(0, ants.size, ants.size) if parameters.start_on == "any" else ants
            starts = tours[whose, run.rng.integers(0, lengths[whose])].astype(np.int64)
        probability = pheromone**parameters.alpha * visibility**parameters.beta  # numerator of eq. 8
        value = visibility if cycle == 0 else probability
        owners = _cycle(nodes, value, cycle == 0, starts, tours, lengths, run.rng, run.deadline())
        cycle += 1
        complete = (owners[:, ~packing.slack] >= 0).all(axis=1)
        walked = np.where(complete, _weights(costs, tours, lengths), np.inf)
        k = int(walked.argmin())
        if walked[k] < best_weight:
            tour = tours[k, : lengths[k]]
            best, best_weight = tour[tour < packing.num_columns].copy(), float(walked[k])
            run.record(cycle, best_weight, -np.inf)
        _lay(pheromone, positive, tours, lengths, parameters.rho)
        if run.watch is not None:
            value = pheromone**parameters.alpha * visibility**parameters.beta
            columns = np.arange(packing.num_columns)
            run.watch(Cycle(cycle, columns, alone, pheromone.copy(), visibility, value / value.sum()))
        if (owners == owners[0]).all() or run.should_stop():
            break
    else:
        cut_off = True
    if best is None:
        cover = Cover.empty(packing)
        if not cover.complete(run):
            raise InfeasibleError("no ant completed a tour: the problem may have no solution")
        best = cover.columns()
    bound, duals = bound_of_choice(packing, best, run)
    run.record(cycle, float(packing.weights[best].sum()), bound)
    if cut_off:
        # reported only now: a run that is stopped does not raise its bound
        run.stopped_by = run.stopped_by or "iterations"
    return Outcome(best, cycle, bound, duals)


def false_alarms(packing: Packing) -> NDArray[np.int64]:
    """Rows that may be false alarms: none without dummies, where ants cannot choose to leave rows uncovered."""
    return np.zeros(0, dtype=np.int64) if packing.is_axial else np.arange(packing.num_rows)


def nodes_of(packing: Packing, alone: NDArray[np.int64]) -> tuple[NDArray[np.int32], Floats]:
    """Rows of the nodes, first the packing's columns, then the single rows; and their costs."""
    singles = np.full((alone.size, packing.cols.shape[1]), -1, dtype=np.int32)
    singles[:, 0] = alone
    return np.concatenate([packing.cols, singles]), np.concatenate([packing.weights, np.zeros(alone.size)])


def transformed(costs: Floats, kind: str, scale: float) -> Floats:
    """Return the costs as positive numbers in the same order, for eq. 7; "reciprocal" takes positive costs alone."""
    if kind == "exponential":
        # beyond e^600 differences of visibility no longer matter, but its powers would overflow
        return np.exp(np.minimum((costs - costs.min()) / scale, 150.0))
    if kind == "shifted":
        return costs - costs.min() + scale
    if costs.min() <= 0:
        raise InvalidInputError("visibility: 'reciprocal' needs positive costs; take 'exponential' or 'shifted'")
    return costs


@njit
def _weights(costs: Floats, tours: NDArray[np.int32], lengths: NDArray[np.int64]) -> Floats:
    """Sum of the costs of each ant's tour."""
    weights = np.zeros(lengths.size)
    for k in range(lengths.size):
        for i in range(lengths[k]):
            weights[k] += costs[tours[k, i]]
    return weights


@njit
def _cycle(
    nodes: NDArray[np.int32],
    value: Floats,
    greedy: bool,
    starts: NDArray[np.int64],
    tours: NDArray[np.int32],
    lengths: NDArray[np.int64],
    rng: np.random.Generator,
    deadline: float,
) -> NDArray[np.int32]:
    """Walk all ants' tours; returns the owner (node) of each row for each ant.

    Ants do not start after the deadline.
    """
    num, num_sensors = nodes.shape
    num_ants, num_rows = tours.shape
    owners = np.full((num_ants, num_rows), -1, np.int32)
    allowed = np.empty(num, np.int32)
    for ant in range(num_ants):
        if deadline < np.inf and now() > deadline:
            lengths[ant] = 0
            continue
        count = num
        for j in range(num):
            allowed[j] = j
        length = 0
        node = starts[ant]
        while not (deadline < np.inf and now() > deadline):
            tours[ant, length] = node
            length += 1
            for s in range(num_sensors):
                if nodes[node, s] >= 0:
                    owners[ant, nodes[node, s]] = node
            # the tabu list: nodes that share a measurement with the tour
            kept = 0
            total = 0.0
            for i in range(count):
                j = allowed[i]
                fits = True
                for s in range(num_sensors):
                    if nodes[j, s] >= 0 and owners[ant, nodes[j, s]] >= 0:
                        fits = False
                        break
                if fits:
                    allowed[kept] = j
                    kept += 1
                    total += value[j]
            count = kept
            if count == 0:
                break
            if greedy:
                node = allowed[0]
                for i in range(1, count):
                    if value[allowed[i]] > value[node]:
                        node = allowed[i]
            else:
                draw = rng.random() * total
                node = allowed[count - 1]
                for i in range(count):
                    draw -= value[allowed[i]]
                    if draw < 0.0:
                        node = allowed[i]
                        break
        lengths[ant] = length
    return owners


@njit
def _lay(pheromone: Floats, positive: Floats, tours: NDArray[np.int32], lengths: NDArray[np.int64], rho: float) -> None:
    """Eqs. 9-11."""
    for j in range(pheromone.size):
        pheromone[j] *= rho
    for ant in range(tours.shape[0]):
        total = 0.0
        for i in range(lengths[ant]):
            total += positive[tours[ant, i]]
        for i in range(lengths[ant]):
            pheromone[tours[ant, i]] += 1.0 / total
