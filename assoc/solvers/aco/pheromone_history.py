"""The pheromone of the ant colony cycle by cycle, for those who want to see it at work."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assoc.packing.prepare import prepare
from assoc.packing.run import Run
from assoc.problem import AssignmentProblem
from assoc.solvers.aco.paper import nodes_of, solve_as_in_the_paper
from assoc.solvers.aco.parameters import AcoParameters
from assoc.solvers.registry import make_parameters


@dataclass(frozen=True, eq=False)
class PheromoneHistory:
    """What the ants of the paper (``mode="paper"``) left on the nodes.

    Attributes
    ----------
    cycles : int array (K,)
        Numbers of the cycles, from 1.
    pheromone : array (K, N)
        After each cycle, of each node.
    tuples : int32 array (N, S)
        The tuple that a node is; false alarms are the tuples with one measurement. What cannot be chosen or left
        is no node: tuples dearer than their false alarms, and measurements that no tuple holds.
    costs : array (N,)
        Their costs, counted from the false alarms.
    chosen : bool array (N,)
        Whether the node is in the best solution found.
    """

    cycles: NDArray[np.int64]
    pheromone: NDArray[np.float64]
    tuples: NDArray[np.int32]
    costs: NDArray[np.float64]
    chosen: NDArray[np.bool_]


def pheromone_history(problem: AssignmentProblem, *, seed: int = 0, **parameters: Any) -> PheromoneHistory:
    """Run the ant colony of the paper and keep its pheromone after every cycle.

    Parameters
    ----------
    problem : AssignmentProblem
    seed : int, default 0
        The same seed gives the search of ``assign(problem, "aco", mode="paper", seed=seed, ...)``.
    **parameters
        Of ``aco``; ``mode`` is "paper".

    Returns
    -------
    PheromoneHistory

    Raises
    ------
    InvalidInputError
        A parameter is unknown or out of range.
    InfeasibleError
        No ant completed a tour (possible only without dummies).
    """
    chosen: AcoParameters = make_parameters("aco", {**parameters, "mode": "paper"})  # type: ignore[assignment]
    prepared = prepare(problem)
    packing = prepared.packing
    kept: list[tuple[int, NDArray[np.float64]]] = []

    def keep(cycle: int, state: NDArray[np.float64]) -> None:
        kept.append((cycle, state))

    run = Run(seed, offset=prepared.offset, watch=keep)
    outcome = solve_as_in_the_paper(packing, chosen, run)
    rows, costs = nodes_of(packing)
    best = np.zeros(len(rows), dtype=np.bool_)
    best[outcome.columns] = True
    covered = np.zeros(packing.num_rows + 1, dtype=np.bool_)
    covered[packing.cols[outcome.columns]] = True
    alone = np.arange(len(rows)) >= packing.num_columns
    best[alone] = ~covered[rows[alone, 0]]
    return PheromoneHistory(
        cycles=np.array([cycle for cycle, _ in kept], dtype=np.int64),
        pheromone=np.array([state for _, state in kept]).reshape(len(kept), len(rows)),
        tuples=_tuples(problem, packing.row_origin, rows),
        costs=costs,
        chosen=best,
    )


def _tuples(problem: AssignmentProblem, origin: NDArray[Any], rows: NDArray[np.int32]) -> NDArray[np.int32]:
    """From rows (measurements counted through, -1: none) to one index for each sensor."""
    starts = np.cumsum(problem.sizes) - problem.sizes
    node, place = np.nonzero(rows >= 0)
    through = np.asarray(origin)[rows[node, place]]
    sensor = np.searchsorted(starts, through, side="right") - 1
    # sensors without measurements start where the next one does
    result = np.zeros((len(rows), problem.num_sensors), dtype=np.int32)
    result[node, sensor] = through - starts[sensor] + 1
    return result
