"""A metaheuristic on all components of a packing, in turns."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from assoc.errors import InfeasibleError
from assoc.packing.bounds.dual_ascent import dual_bound
from assoc.packing.branching.feasibility import infeasible
from assoc.packing.components.component import Part
from assoc.packing.components.proof import bound_of_part
from assoc.packing.components.splitting import _columns, split_components, split_part
from assoc.packing.kernels.sorting import ascending
from assoc.packing.neighbourhoods.cover import Cover
from assoc.packing.packing import Packing
from assoc.packing.run import Outcome, Run


class Searcher(Protocol):
    """A metaheuristic at work on one part."""

    def iterate(self, part: Part, rng: np.random.Generator) -> None:
        """Do one iteration and ``offer`` what it finds to the part."""


def solve_by(
    make: Callable[[Part, np.random.Generator], Searcher],
    packing: Packing,
    run: Run,
    iterations: int,
    patience: int,
    refinement: int = 0,
) -> Outcome:
    """Run a metaheuristic on every part of the packing.

    Parameters
    ----------
    make : callable
        Makes the searcher of a part.
    packing : Packing
        The whole problem.
    run : Run
        Clock, random generator, trace.
    iterations : int
        Iterations on one part at the most.
    patience : int
        A part is left after so many iterations without improvement.
    refinement : int
        Exact sub-steps on the best cover after each iteration, for every 30 rows of the part.

    Raises
    ------
    InfeasibleError
        A part has no complete cover, or none was found.
    """
    # without a solution at the time limit there would be nothing to return: the bound gets a share of the time
    share = Run(run.rng, time_limit=run.time_limit and 0.3 * run.time_limit, started=run.started)
    duals = dual_bound(packing, run=share)
    parts = split_components(packing, duals, np.arange(packing.num_columns))
    deadline = run.deadline()
    for part in parts:
        part.deadline = deadline
        part.offer_greedy()
        if not part.closed and not share.should_stop():
            part.sharpen(share)
    columns: list[NDArray[np.int64]] = []
    bound, weight = 0.0, 0.0
    done = len(parts)
    cut_off = False
    root_bound = sum(part.bound for part in parts)
    _record_all(run, done, weight, root_bound, parts)
    queue: list[tuple[Part, Searcher | None]] = [(part, None) for part in parts]
    while queue:
        part, searcher = queue.pop(0)
        # a part that has a cover takes no turn after time is over, or thousands of parts would take one each
        over = part.closed or (part.best is not None and run.should_stop())
        if not over:
            if searcher is None:
                searcher = make(part, run.rng)
            before, iterations_before = part.weight, part.iterations
            over = _take_turn(part, searcher, run, iterations, patience, refinement)
            done += part.iterations - iterations_before
            cut_off |= part.iterations >= iterations and part.stalled < patience and not part.closed
            if part.best is None and over:
                complete(part, run)
            if part.weight < before:
                _record_all(run, done, weight, root_bound, [part, *(other for other, _ in queue)])
            pieces = None if over else split_part(part)
            if pieces is not None:
                queue.extend((piece, None) for piece in pieces)
                continue
        if over:
            columns.append(part.origin[_columns(part)])
            bound += bound_of_part(part, run)
            weight += part.weight
        else:
            queue.append((part, searcher))
    chosen = np.concatenate(columns) if columns else np.zeros(0, dtype=np.int64)
    run.record(done, weight, bound)
    if cut_off:
        # said only now: a run that is stopped neither searches other parts nor raises their bounds
        run.stopped_by = run.stopped_by or "iterations"
    return Outcome(chosen, done, bound, duals)


def _take_turn(part: Part, searcher: Searcher, run: Run, iterations: int, patience: int, refinement: int) -> bool:
    """Give a part up to ten iterations; whether its search is over."""
    for _ in range(10):
        before = part.weight
        searcher.iterate(part, run.rng)
        part.refine(run, refinement)
        part.iterations += 1
        part.stalled = 0 if part.weight < before - part.tolerance else part.stalled + 1
        if part.closed or part.stalled >= patience or part.iterations >= iterations or run.should_stop():
            return True
    return False


def _record_all(run: Run, iterations: int, weight: float, bound: float, parts: list[Part]) -> None:
    known = weight + sum(part.weight for part in parts)
    if known < np.inf:
        run.record(iterations, known, bound)


def complete(part: Part, run: Run) -> None:
    """Last resort for a part in which no iteration covered all that must be covered."""
    cover = Cover.empty(part.packing)
    cover.add_greedily(ascending(part.reduced))
    if not cover.complete(run):
        raise infeasible(part.packing, run)
    part.offer(cover.owner, cover.weight)
    if part.best is None:
        raise InfeasibleError("no complete solution was found")
