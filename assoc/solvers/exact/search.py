"""The exact solver's course: reduce, improve, fix, and search the open components in turns until all are proved."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from assoc.packing.bounds.dual_ascent import dual_bound
from assoc.packing.branching.compiling import compile_branching_ahead
from assoc.packing.branching.feasibility import infeasible
from assoc.packing.branching.search import BranchAndBound
from assoc.packing.components.component import Component
from assoc.packing.components.search import complete_greedily
from assoc.packing.components.splitting import split_component
from assoc.packing.neighbourhoods.cover import Cover
from assoc.packing.packing import Packing
from assoc.packing.run import Outcome, Run
from assoc.solvers.exact.reduction import Reduction
from assoc.solvers.genetic.parameters import GeneticParameters
from assoc.solvers.genetic.population import Breeding
from assoc.solvers.tabu.moves import TabuSearch
from assoc.solvers.tabu.parameters import TabuParameters

# rows from which tabu search and breeding pay beside the branching from the start: its passes need no good incumbent.
# Elsewhere they join it after so many turns, about a second: who stops a long search wants a good incumbent
_LARGE = 150
_ALONE = 100
# turns of branching between their iterations
_TURNS = 3
# share of a component's gap by which its bound has risen when the trace says so
_WORTH = 0.02
# columns up to which a component is branched on before anything else, and for how many nodes
_SMALL = 2000
_SHORT = 20
# columns from which a problem may be hard enough for its branching to be compiled beforehand
_HARD = 500
# columns for each row from which it surely is
_DENSE = 15


@dataclass(slots=True)
class _Done:
    """Weights and bounds of the components that are done.

    They are added up exactly: over thousands of them a plain sum can lose more than the bounds' margins for rounding.
    """

    weights: list[float]
    bounds: list[float]

    def record(self, run: Run, nodes: int, tasks: list[_Task]) -> None:
        """Add a point to the trace, with what is known of the components that are not done."""
        weight = math.fsum([*self.weights, *(task.component.weight for task in tasks)])
        run.record(nodes, weight, math.fsum([*self.bounds, *(task.bound for task in tasks)]))


@dataclass(slots=True)
class _Task:
    component: Component
    # what the search of a larger one has proved before this was split off
    floor: float = -np.inf
    search: BranchAndBound | None = None
    heuristics: tuple[TabuSearch, Breeding] | None = None
    improvements: int = 0
    # of branching: since the last iteration of a metaheuristic, and in all
    turns: int = 0
    age: int = 0

    @property
    def bound(self) -> float:
        component = self.component
        if component.closed and component.packing.granularity:
            return component.weight
        bound = max(component.bound, self.floor)
        if self.search is not None:
            bound = max(bound, self.search.lower_bound)
        return min(bound, component.weight)

    def take_over(self) -> bool:
        """Take the branching's incumbent where it is better than the component's; whether it was."""
        search, component = self.search, self.component
        if search is None or search.columns is None or search.weight >= component.weight:
            return False
        component.weight = search.weight
        component.best = Cover.of(component.packing, search.columns).owner
        return True

    def parts(self, components: list[Component]) -> list[_Task]:
        """Tasks for what the component fell apart into, each with what the bound says of it.

        A cover of one with the best covers of the others is a cover of the whole, and weighs no less than the bound.
        """
        whole = self.component.weight
        rounding = 1e-12 * sum(abs(one.weight) for one in components) + 1e-12 * abs(whole)
        return [_Task(one, self.bound - (whole - one.weight) - rounding) for one in components]


def prove(packing: Packing, node_limit: int, patience: int, run: Run) -> Outcome:
    """Solve a packing to proven optimality or until the nodes or the time are used up."""
    if packing.num_columns > _HARD:
        compile_branching_ahead(surely=packing.num_columns > _DENSE * packing.num_rows)
    reduction = Reduction(packing, run)
    components = reduction.reduce()
    columns = reduction.closed_columns
    done = _Done([reduction.closed_weight], [reduction.closed_bound])
    if components:
        # what is known before the search of hard ones: worth seeing where the search takes long
        done.record(run, 0, [_Task(one) for one in components])
    tasks: list[_Task] = []
    settled: list[_Task] = []
    nodes = 0
    deadline = run.deadline()
    for component in components:
        component.deadline = deadline
        task = _branch_shortly(component, min(_SHORT, node_limit - nodes), run)
        if task.search is not None:
            nodes += task.search.nodes
        if component.closed or (task.search is not None and task.search.done):
            settled.append(task)
        else:
            tasks.extend(_Task(one) for one in _sharpen(component, run))

    def show(tasks: list[_Task]) -> None:
        done.record(run, nodes, settled + tasks)

    show(tasks)
    tasks = settled + _improve(tasks, patience, run, show)
    short = False
    while tasks:
        task = tasks.pop(0)
        component = task.component
        if not component.closed and not run.should_stop() and nodes < node_limit:
            if task.search is None:
                task.search = _branching(component, run, floor=task.floor)
                component.stalled = 0
            before, bound_before = task.search.nodes, task.bound
            # some ten milliseconds of work between two looks at the clock
            task.search.run(min(max(1, 20_000 // max(component.packing.num_columns, 1)), node_limit - nodes))
            nodes += task.search.nodes - before
            better = task.take_over()
            if not task.search.done:
                task.turns += 1
                task.age += 1
                alone = component.packing.num_rows < _LARGE and task.age < _ALONE
                # as long as they improve it, metaheuristics get half the time; then less and less
                if not alone and task.turns >= _TURNS * min(1 + component.stalled, 10):
                    task.turns = 0
                    if _search_better(task, run):
                        task.search.weight = component.weight
                        better = True
                # a better incumbent rules columns out, and what falls apart is searched component by component:
                # in one search the nodes of independent components multiply
                smaller = split_component(component) if better else None
                tasks.extend([task] if smaller is None else task.parts(smaller))
                risen = task.bound > bound_before + _WORTH * (component.weight - bound_before)
                if better or risen or run.is_silent():
                    done.record(run, nodes, tasks)
                continue
            if better:
                done.record(run, nodes, [task, *tasks])
        if component.best is None:
            if task.search is not None and task.search.done and not task.search.out_of_memory:
                raise infeasible(component.packing)
            complete_greedily(component, run)
        assert component.best is not None
        short = short or (task.search is not None and task.search.out_of_memory)
        columns.append(component.origin[component.best_columns()])
        done.weights.append(component.weight)
        done.bounds.append(task.bound)
    weight, bound = math.fsum(done.weights), math.fsum(done.bounds)
    if (short or nodes >= node_limit) and not run.stopped_by and bound < weight - 1e-6 * max(1.0, abs(weight)):
        run.stopped_by = "memory_limit" if short else "iterations"
    run.record(nodes, weight, bound)
    chosen = np.concatenate(columns) if columns else np.zeros(0, dtype=np.int64)
    return Outcome(chosen, nodes, bound, None if components else reduction.proof)


def _branching(component: Component, run: Run, *, to_the_end: bool = True, floor: float = -np.inf) -> BranchAndBound:
    return BranchAndBound(
        component.packing,
        component.duals,
        component.weight,
        component.tolerance,
        run.deadline(),
        run.memory_allows,
        to_the_end=to_the_end,
        floor=floor,
    )


def _branch_shortly(component: Component, nodes: int, run: Run) -> _Task:
    """Branch at once: a small component is mostly done before its bound could be made any better."""
    task = _Task(component)
    if component.closed or component.packing.num_columns > _SMALL or nodes <= 0 or run.should_stop():
        return task
    task.search = _branching(component, run, to_the_end=False)
    task.search.run(nodes)
    task.take_over()
    return task


def _sharpen(component: Component, run: Run) -> list[Component]:
    """Ascend anew, with time enough at every temperature, on a component that the reduction left open."""
    if run.should_stop():
        # one pass over a million columns takes longer than a short limit allows
        return [component]
    component.take_over(dual_bound(component.packing, run=run))
    if not component.closed and not run.should_stop():
        component.sharpen(run)
    return (None if component.closed else split_component(component, share=0.9)) or [component]


def _improve(tasks: list[_Task], patience: int, run: Run, show: Callable[[list[_Task]], None]) -> list[_Task]:
    """Bring the incumbents of open components near the optimum before any branching, and split what that allows."""
    result: list[_Task] = []
    queue = [(task, 0) for task in tasks]
    while queue:
        task, stalled = queue.pop(0)
        component = task.component
        # small components are branched at once, and without an incumbent there is nothing to improve
        if (
            component.closed
            or component.best is None
            or component.packing.num_rows < _LARGE
            or stalled * 60 >= patience * component.packing.num_rows
        ):
            result.append(task)
            continue
        if run.should_stop():
            result.append(task)
            continue
        stalled = 0 if _search_better(task, run) else stalled + 1
        if stalled == 0:
            show([*result, task, *(other for other, _ in queue)])
        smaller = split_component(component) if stalled == 0 else None
        if smaller is None:
            queue.append((task, stalled))
        else:
            queue.extend((_Task(one), 0) for one in smaller)
    # whatever the patience, branching should start on as few columns as the incumbents allow
    split: list[_Task] = []
    for task in result:
        done = task.component.closed or run.should_stop()
        smaller = None if done else split_component(task.component, share=0.9)
        split.extend([task] if smaller is None else [_Task(one) for one in smaller])
    return split


def _search_better(task: _Task, run: Run) -> bool:
    """One iteration of a metaheuristic and exact sub-steps on the incumbent; whether it became better.

    Tabu search and breeding take turns: they get stuck in different places.
    """
    component = task.component
    if component.best is None:
        return False
    if task.heuristics is None:
        task.heuristics = TabuSearch(component, TabuParameters()), Breeding(component, GeneticParameters())
    before = component.weight
    task.heuristics[task.improvements % 2].iterate(component, run.rng)
    task.improvements += 1
    component.refine(run, TabuParameters.clusters)
    component.stalled = 0 if component.weight < before - component.tolerance else component.stalled + 1
    return component.stalled == 0
