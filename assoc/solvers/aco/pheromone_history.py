"""The pheromone of the ant colony after each cycle."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assoc._system import memory
from assoc._system.wrong_types import explains_wrong_types
from assoc._text.shown import Shown
from assoc._types import Floats
from assoc.packing.packing import Packing
from assoc.packing.prepare import prepare
from assoc.packing.run import Callback
from assoc.problem import AssignmentProblem
from assoc.solution import Solution
from assoc.solvers.aco.colony import Cycle, tuples_of
from assoc.solvers.aco.paper import false_alarms, nodes_of
from assoc.solvers.assign import assign
from assoc.solvers.registry import make_parameters


@dataclass(frozen=True, eq=False, repr=False)
class PheromoneHistory(Shown):
    """Pheromone, visibility and probability of all nodes after each cycle.

    Attributes
    ----------
    cycles : int array (K,)
        Numbers of the cycles, from 1. Mode mmas counts the cycles of each component: a component that ended earlier
        keeps its last values.
    pheromone, visibility, probability : arrays (K, N)
        tau_j, eta_j and p_j of eq. 8 after each cycle (`Cycle`). NaN where no ant has walked: mode mmas skips a
        component that its bound closes at once.
    tuples : int32 array (N, S)
        The tuple of each node; false alarms are the tuples with one measurement. Tuples that cost more than their
        false alarms, and measurements in no tuple, are not nodes: there is nothing to choose.
    costs : array (N,)
        Costs of the tuples less those of their false alarms.
    chosen : bool array (N,)
        Whether the node is in the best solution.
    solution : Solution
        The result of ``assign``.
    """

    cycles: NDArray[np.int64]
    pheromone: Floats
    visibility: Floats
    probability: Floats
    tuples: NDArray[np.int32]
    costs: Floats
    chosen: NDArray[np.bool_]
    solution: Solution

    def __repr__(self) -> str:
        return f"PheromoneHistory({len(self.cycles)} cycles, {len(self.tuples)} tuples, {self.solution!r})"

    def top(self, nodes: int) -> PheromoneHistory:
        """Return the history of ``nodes`` nodes: chosen ones first, then those with the most pheromone at the end."""
        last = self.pheromone[-1] if len(self.pheromone) else np.zeros(len(self.tuples))
        kept = np.lexsort((-np.nan_to_num(last), ~self.chosen))[:nodes]
        return PheromoneHistory(
            self.cycles,
            self.pheromone[:, kept],
            self.visibility[:, kept],
            self.probability[:, kept],
            self.tuples[kept],
            self.costs[kept],
            self.chosen[kept],
            self.solution,
        )


@explains_wrong_types
def pheromone(
    problem: AssignmentProblem,
    *,
    seed: int | np.random.SeedSequence | np.random.Generator | None = 0,
    time_limit: float | None = None,
    callback: Callback | None = None,
    watch: Callable[[Cycle], object] | None = None,
    **parameters: Any,
) -> PheromoneHistory:
    """Run the ant colony and keep the pheromone, visibility and probability of every tuple after every cycle.

    Parameters
    ----------
    problem : AssignmentProblem
    seed, time_limit, callback, watch
        As in ``assoc.assign``; the search is that of ``assign(problem, "aco", ...)``. With several ``workers`` the
        first one's colony is shown.
    **parameters
        Parameters of ``aco``, ``mode`` among them.

    Returns
    -------
    PheromoneHistory

    Raises
    ------
    InvalidInputError
        A parameter is unknown or out of range.
    InfeasibleError
        The problem (without dummies) has no solution.
    LimitExceededError
        The cycles take more memory than is available.
    """
    kept: list[Cycle] = []

    def keep(cycle: Cycle) -> None:
        kept.append(cycle)
        # once as a list and once as arrays
        needed = 48.0 * cycle.number * cycle.pheromone.size
        memory.require(needed, f"{cycle.number} cycles on {cycle.pheromone.size} nodes", "take fewer iterations")
        if watch is not None:
            watch(cycle)

    solution = assign(problem, "aco", seed=seed, time_limit=time_limit, callback=callback, watch=keep, **parameters)
    packing = prepare(problem, every_tuple=make_parameters("aco", parameters).every_tuple).packing
    # leave out nodes that are in no cycle
    alone = false_alarms(packing) if parameters.get("mode") == "paper" else np.flatnonzero(packing.slack)
    _, costs = nodes_of(packing, alone)
    tuples = tuples_of(problem.tuples, problem.sizes, packing, np.arange(packing.num_columns), alone)
    chosen = {tuple(row) for row in solution.tuples.tolist()}
    cycles = 1 + np.arange(max((cycle.number for cycle in kept), default=0))
    states = _by_cycle(kept, packing, alone, len(cycles))
    best = np.array([tuple(row) in chosen for row in tuples.tolist()], dtype=np.bool_)
    return PheromoneHistory(cycles, states[0], states[1], states[2], tuples, costs, best, solution)


def _by_cycle(kept: list[Cycle], packing: Packing, alone: NDArray[np.int64], count: int) -> Floats:
    """Pheromone, visibility and probability of all nodes after each cycle, shape (3, K, N)."""
    node_of_row = np.full(packing.num_rows, -1, dtype=np.int64)
    node_of_row[alone] = packing.num_columns + np.arange(alone.size)
    num = packing.num_columns + alone.size
    states = np.full((3, count, num), np.nan)
    for cycle in kept:
        nodes = np.concatenate([cycle.columns, node_of_row[cycle.rows]])
        states[:, cycle.number - 1, nodes] = np.stack([cycle.pheromone, cycle.visibility, cycle.probability])
    for k in range(1, count):
        # components without a cycle of this number keep their values
        states[:, k] = np.where(np.isnan(states[:, k]), states[:, k - 1], states[:, k])
    return states
