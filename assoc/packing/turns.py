"""Search components in turns, each until its search is over."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from assoc._system.kernels.sorting import ascending
from assoc._types import Floats
from assoc.errors import InfeasibleError
from assoc.packing.component import Component
from assoc.packing.cover import Cover
from assoc.packing.run import Outcome, Run, infeasible

# share of a component's gap by which its bound must rise for a new point of the trace
_WORTH = 0.02


class Task(Protocol):
    """The search of one component."""

    component: Component

    def turn(self) -> bool:
        """Search for a moment; return whether the search is over."""
        ...

    def split(self) -> Sequence[Task]:
        """Tasks for the remaining components, if the component has become much smaller; else empty."""
        ...


@dataclass(slots=True, kw_only=True)
class Turns:
    """The searches of all components of a packing, and the results of those that are over.

    Weights and bounds are summed exactly: over thousands of components the error of a plain sum can exceed the bounds'
    margins for rounding.
    """

    run: Run
    iterations: int = 0
    """Total over all searches."""
    columns: list[NDArray[np.integer]] = field(default_factory=list)
    weights: list[float] = field(default_factory=list)
    bounds: list[float] = field(default_factory=list)
    proved: float = -math.inf
    """The best bound on the whole so far: after a split the sum over the components may be below it."""

    def take(self, tasks: Iterable[Task]) -> None:
        """Give each task its turn, again and again, until all searches are over; errors as `search_components`."""
        waiting = deque(tasks)
        while waiting:
            task = waiting.popleft()
            component = task.component
            weight, bound = component.weight, component.lower_bound
            # after time is over only components without a cover take a turn: there may be thousands
            over = component.closed or (component.best is not None and self.run.should_stop()) or task.turn()
            if over and component.best is None:
                complete_greedily(component, self.run)
            news = component.weight < weight
            if not over:
                risen = component.lower_bound > bound + _WORTH * (component.weight - bound)
                news = news or risen or self.run.is_silent()
                waiting.extend(task.split() or [task])
            if news:
                self.record([task, *waiting] if over else waiting)
            if over:
                self.columns.append(component.origin[component.best_columns()])
                self.weights.append(component.weight)
                self.bounds.append(component.lower_bound)

    def record(self, tasks: Iterable[Task] = ()) -> None:
        """Add a point to the trace, with the current weights and bounds of the components that are not done."""
        components = [task.component for task in tasks]
        weight = math.fsum([*self.weights, *(component.weight for component in components)])
        bound = math.fsum([*self.bounds, *(component.lower_bound for component in components)])
        self.proved = max(self.proved, min(bound, weight))
        self.run.record(self.iterations, weight, self.proved)

    def outcome(self, duals: Floats | None) -> Outcome:
        """The result of all searches together; ``duals`` as in `Outcome`."""
        self.record()
        chosen = np.concatenate(self.columns) if self.columns else np.zeros(0, dtype=np.int64)
        return Outcome(chosen, self.iterations, self.proved, duals)


def complete_greedily(component: Component, run: Run) -> None:
    """Last resort for a component without a complete cover."""
    cover = Cover.empty(component.packing)
    cover.add_greedily(ascending(component.reduced))
    if not cover.complete(run):
        raise infeasible(component.packing, run)
    component.offer(cover.owner, cover.weight)
    if component.best is None:
        raise InfeasibleError("no complete solution was found")
