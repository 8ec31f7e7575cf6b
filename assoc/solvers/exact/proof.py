"""The exact solver's course: reduce, improve, fix, and search the open parts in turns until all are proved."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from assoc.packing.bounds.dual_ascent import dual_bound
from assoc.packing.branching.feasibility import infeasible
from assoc.packing.branching.search import BranchAndBound
from assoc.packing.components.component import Part
from assoc.packing.components.search import complete
from assoc.packing.components.splitting import split_part
from assoc.packing.neighbourhoods.cover import Cover, chosen_columns
from assoc.packing.packing import Packing
from assoc.packing.run import Outcome, Run
from assoc.solvers.exact.reduction import Reduction
from assoc.solvers.genetic.parameters import GeneticParameters
from assoc.solvers.genetic.population import Breeding
from assoc.solvers.tabu.moves import TabuSearch
from assoc.solvers.tabu.parameters import TabuParameters

# rows from which tabu search and breeding pay beside the branching, and turns of branching between their iterations
_LARGE = 30
_MANY = 90
_TURNS = 3
# columns up to which a part is branched on before anything else, and for how many nodes
_SMALL = 400
_SHORT = 50


@dataclass(slots=True)
class _Task:
    part: Part
    search: BranchAndBound | None = None
    heuristics: tuple[TabuSearch, Breeding] | None = None
    improvements: int = 0
    turns: int = 0

    @property
    def bound(self) -> float:
        part = self.part
        if part.closed and part.packing.granularity:
            return part.weight
        bound = part.bound if self.search is None else max(part.bound, self.search.lower_bound)
        return min(bound, part.weight)

    def take_over(self) -> bool:
        """Take the branching's incumbent where it is better than the part's; whether it was."""
        search, part = self.search, self.part
        if search is None or search.columns is None or search.weight >= part.weight:
            return False
        part.weight = search.weight
        part.best = Cover.of(part.packing, search.columns).owner
        return True


def prove(packing: Packing, node_limit: int, patience: int, run: Run) -> Outcome:
    """Solve a packing to proven optimality or until the nodes or the time are used up."""
    reduction = Reduction(packing, run)
    parts = reduction.reduce()
    tasks: list[_Task] = []
    settled: list[_Task] = []
    nodes = 0
    deadline = run.deadline()
    for part in parts:
        part.deadline = deadline
        task = _branch_shortly(part, min(_SHORT, node_limit - nodes), run)
        if task.search is not None:
            nodes += task.search.nodes
        if part.closed or (task.search is not None and task.search.done):
            settled.append(task)
        else:
            tasks.extend(_Task(piece) for piece in _sharpen(part, run))
    columns = reduction.closed_columns
    weight, bound = reduction.closed_weight, reduction.closed_bound
    _record(run, nodes, weight, bound, settled + tasks)
    tasks = settled + _improve(tasks, patience, run)
    short = False
    while tasks:
        task = tasks.pop(0)
        part = task.part
        if not part.closed and not run.should_stop() and nodes < node_limit:
            if task.search is None:
                task.search = BranchAndBound(part.packing, part.duals, part.weight, part.tolerance, run.deadline())
                part.stalled = 0
            before = task.search.nodes
            # some ten milliseconds of work between two looks at the clock
            task.search.run(min(max(1, 20_000 // max(part.packing.num_columns, 1)), node_limit - nodes))
            nodes += task.search.nodes - before
            better = task.take_over()
            if not task.search.done:
                task.turns += 1
                # as long as they improve it, metaheuristics get half the time; then less and less
                if task.turns >= _TURNS * min(1 + part.stalled // 5, 5):
                    task.turns = 0
                    if _search_better(task, run):
                        task.search.weight = part.weight
                        better = True
                # a better incumbent rules columns out, and what falls apart is searched part by part: in one search
                # the nodes of independent parts multiply
                pieces = split_part(part) if better else None
                tasks.extend([task] if pieces is None else [_Task(piece) for piece in pieces])
                if better:
                    _record(run, nodes, weight, bound, tasks)
                continue
            if better:
                _record(run, nodes, weight, bound, [task, *tasks])
        if part.best is None:
            if task.search is not None and task.search.done and not task.search.out_of_memory:
                raise infeasible(part.packing)
            complete(part, run)
        assert part.best is not None
        short = short or (task.search is not None and task.search.out_of_memory)
        columns.append(part.origin[chosen_columns(part.packing.cols, part.best)])
        weight += part.weight
        bound += task.bound
    if (short or nodes >= node_limit) and not run.stopped_by and bound < weight - 1e-6 * max(1.0, abs(weight)):
        run.stopped_by = "memory_limit" if short else "iterations"
    _record(run, nodes, weight, bound, [])
    chosen = np.concatenate(columns) if columns else np.zeros(0, dtype=np.int64)
    return Outcome(chosen, nodes, bound, None if parts else reduction.proof)


def _branch_shortly(part: Part, nodes: int, run: Run) -> _Task:
    """Branch at once: a small part is mostly done before its bound could be made any better."""
    task = _Task(part)
    if part.closed or part.packing.num_columns > _SMALL or nodes <= 0 or run.should_stop():
        return task
    task.search = BranchAndBound(part.packing, part.duals, part.weight, part.tolerance, run.deadline())
    task.search.run(nodes)
    task.take_over()
    return task


def _sharpen(part: Part, run: Run) -> list[Part]:
    """Ascend anew, with time enough at every temperature, on a part that the reduction left open."""
    part.take_over(dual_bound(part.packing, run=run))
    if not part.closed and not run.should_stop():
        part.sharpen(run)
    return (None if part.closed else split_part(part, share=0.9)) or [part]


def _improve(tasks: list[_Task], patience: int, run: Run) -> list[_Task]:
    """Bring the incumbents of open parts near the optimum before any branching, and split what that allows."""
    result: list[_Task] = []
    queue = [(task, 0) for task in tasks]
    while queue:
        task, stalled = queue.pop(0)
        part = task.part
        # small parts are branched at once, and without an incumbent there is nothing to improve
        if (
            part.closed
            or part.best is None
            or part.packing.num_rows < _LARGE
            or stalled * 60 >= patience * part.packing.num_rows
        ):
            result.append(task)
            continue
        if run.should_stop():
            result.append(task)
            continue
        stalled = 0 if _search_better(task, run) else stalled + 1
        pieces = split_part(part) if stalled == 0 else None
        if pieces is None:
            queue.append((task, stalled))
        else:
            queue.extend((_Task(piece), 0) for piece in pieces)
    # whatever the patience, branching should start on as few columns as the incumbents allow
    split: list[_Task] = []
    for task in result:
        pieces = None if task.part.closed else split_part(task.part, share=0.9)
        split.extend([task] if pieces is None else [_Task(piece) for piece in pieces])
    return split


def _search_better(task: _Task, run: Run) -> bool:
    """One iteration of a metaheuristic and exact sub-steps on the incumbent; whether it became better.

    Tabu search and breeding take turns: they get stuck in different places.
    """
    part = task.part
    if part.best is None or part.packing.num_rows < _LARGE:
        return False
    if task.heuristics is None:
        task.heuristics = TabuSearch(part, TabuParameters()), Breeding(part, GeneticParameters())
    before = part.weight
    # small parts are branched sooner than a population is bred: most of them end there at once
    turn = task.improvements % 2 if task.search is not None or part.packing.num_rows >= _MANY else 0
    task.heuristics[turn].iterate(part, run.rng)
    task.improvements += 1
    part.refine(run, TabuParameters.clusters)
    part.stalled = 0 if part.weight < before - part.tolerance else part.stalled + 1
    return part.stalled == 0


def _record(run: Run, nodes: int, weight: float, bound: float, tasks: list[_Task]) -> None:
    run.record(nodes, weight + sum(task.part.weight for task in tasks), bound + sum(task.bound for task in tasks))
