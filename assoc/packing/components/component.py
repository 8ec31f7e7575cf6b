"""What ant colony, genetic algorithm and tabu search share: parts, reduced-cost fixing, stopping, proof.

The packing is taken apart into parts (first its components). The first iteration is the greedy one, which follows
the reduced costs alone, and most parts need no other. An open part is searched for some iterations; then
columns whose reduced cost exceeds the part's gap are dropped, since no better solution can use them, and
what is left is taken apart again. A part whose gap is closed is done. Parts take turns, so that a time
limit is shared between them. At the end a short branch and bound (branch_and_bound.py) raises the bounds
of small open parts; it never changes the solution, which is the metaheuristic's own.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from assoc.errors import InfeasibleError
from assoc.packing.bounds.dual_ascent import certified_bound, component_bounds, dual_bound, hard_pass, reduced_costs
from assoc.packing.bounds.linear_program import linear_program_duals
from assoc.packing.branching.feasibility import infeasible
from assoc.packing.branching.search import Search
from assoc.packing.kernels.sorting import ascending
from assoc.packing.neighbourhoods import dimensionwise
from assoc.packing.neighbourhoods.cluster_steps import ClusterSteps
from assoc.packing.neighbourhoods.insertion import Cover, chosen_columns
from assoc.packing.neighbourhoods.large import LargeNeighbourhood
from assoc.packing.packing import Packing
from assoc.packing.run import Outcome, Run

Floats = NDArray[np.float64]
Owner = NDArray[np.int32]

TOLERANCE = 1e-9
_PROOF_NODES = 2000
# columns up to which the linear program is solved: some seconds at the most
_LINEAR_PROGRAM = 200_000
# rows from which large neighbourhoods pay, and tries on one best cover: then only another one helps
_LARGE = 30
_TRIES = 300


@dataclass(slots=True)
class Part:
    """A connected piece of the problem with its multipliers and the best cover known.

    Attributes
    ----------
    packing : Packing
        One component.
    duals, reduced : float arrays, shapes (R,) and (N,)
        Feasible multipliers and reduced costs.
    bound : float
        Valid lower bound of the part.
    origin : int array, shape (N,)
        The columns' places in the packing that the solver was given.
    best : int32 array, shape (R,), or None
        Owner of each row in the best complete cover known.
    weight : float
        Its weight; ``inf`` when none is known.
    deadline : float
        When time is over, by the kernels' clock (clock.py).
    """

    packing: Packing
    duals: Floats
    reduced: Floats
    bound: float
    origin: NDArray[np.int64]
    best: Owner | None = None
    weight: float = np.inf
    iterations: int = 0
    stalled: int = 0
    deadline: float = np.inf
    clusters: ClusterSteps | None = None
    neighbourhood: LargeNeighbourhood = field(default_factory=LargeNeighbourhood)
    tried: int = 0
    tried_weight: float = np.inf

    @property
    def tolerance(self) -> float:
        """Gains below this do not exist or do not count: rounding, or whole-numbered weights."""
        return max(TOLERANCE * max(1.0, abs(self.bound)), 0.999 * self.packing.granularity)

    @property
    def closed(self) -> bool:
        """Whether the best cover is optimal."""
        return self.weight - self.bound <= self.tolerance

    @property
    def late(self) -> bool:
        """Whether time is over."""
        return self.deadline < np.inf and time.monotonic() > self.deadline

    @property
    def temperature(self) -> float:
        """Scale of the reduced costs that matter: a share of the gap, at most of the weights' spread."""
        widest = max(0.02 * float(np.ptp(self.packing.weights)), 1e-12)
        if self.weight < np.inf:
            return min(max((self.weight - self.bound) / 4.0, TOLERANCE * max(1.0, abs(self.bound))), widest)
        return widest

    def take_over(self, duals: Floats) -> None:
        """Take over feasible multipliers if their bound is better."""
        bound = certified_bound(self.packing, duals)
        if bound > self.bound:
            self.bound, self.duals, self.reduced = bound, duals, reduced_costs(self.packing, duals)

    def sharpen(self, run: Run) -> None:
        """Take the multipliers of the linear program itself, where that is not too large."""
        if self.packing.num_columns > _LINEAR_PROGRAM:
            return
        duals = linear_program_duals(self.packing, run)
        if duals is not None:
            hard_pass(self.packing, duals, np.empty(self.packing.num_columns), 1)
            self.take_over(duals)

    def offer_greedy(self) -> None:
        """Offer the cover that always takes the column of least reduced cost, improved by insertion."""
        cover = Cover.empty(self.packing)
        cover.add_greedily(ascending(self.reduced))
        cover.improve(self.deadline)
        self.offer(cover.owner, weight_of(self, cover.owner))

    def improve(self, owner: Owner, rng: np.random.Generator, steps: int) -> float:
        """Improve a complete cover in place by exact sub-steps; return the change of its weight."""
        if steps == 0 or self.late or incomplete(self, owner):
            return 0.0
        if self.clusters is None:
            self.clusters = ClusterSteps(self.packing, self.duals)
        return self.clusters.improve(owner, rng, steps, self.deadline)

    def polish(self, owner: Owner) -> float:
        """Improve a complete cover in place by dimensionwise search; return its weight."""
        if not incomplete(self, owner):
            dimensionwise.improve(self.packing, owner, deadline=self.deadline)
        return weight_of(self, owner)

    def refine(self, run: Run, steps: int) -> None:
        """Improve the best cover: exact sub-steps, ``steps`` for every 30 rows, and ``steps`` large neighbourhoods."""
        if self.best is None or steps == 0:
            return
        left = steps * max(1, self.packing.num_rows // 30)
        while left > 0 and not self.closed and not run.should_stop():
            self.improve(self.best, run.rng, min(left, 10))
            # summed anew: changes of the order of rounding would add up to an improvement that is none
            self.weight = weight_of(self, self.best)
            left -= 10
        if self.weight < self.tried_weight:
            self.tried_weight, self.tried = self.weight, 0
        for _ in range(steps if self.packing.num_rows >= _LARGE and not incomplete(self, self.best) else 0):
            if self.closed or self.tried >= _TRIES or run.should_stop():
                return
            self.tried += 1
            if self.neighbourhood.improve(self, self.best, self.weight, run.rng) < 0.0:
                self.weight = weight_of(self, self.best)
                self.tried_weight, self.tried = self.weight, 0

    def offer(self, owner: Owner, weight: float) -> bool:
        """Keep a cover if it is complete and better than the best; whether it was."""
        if weight < self.weight - self.tolerance and not incomplete(self, owner):
            self.best, self.weight = owner.copy(), weight
            return True
        return False


def weight_of(part: Part, owner: Owner) -> float:
    """Weight of a cover of the part."""
    return float(part.packing.weights[chosen_columns(part.packing.cols, owner)].sum())


def incomplete(part: Part, owner: Owner) -> bool:
    """Whether a row that must be covered is not."""
    return bool((owner[~part.packing.slack] < 0).any())


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


def split_components(packing: Packing, duals: Floats, origin: NDArray[np.int64]) -> list[Part]:
    """Return the components as parts without a cover.

    Raises
    ------
    InfeasibleError
        A row that must be covered has no column.
    """
    bounds = component_bounds(packing, duals)
    if np.isposinf(bounds).any():
        raise infeasible(packing)
    reduced = reduced_costs(packing, duals)
    parts: list[Part] = []
    for c in range(packing.num_components):
        piece = packing.component(c) if packing.num_components > 1 else packing
        top, end = packing.row_start[c], packing.row_start[c + 1]
        first, last = packing.col_start[c], packing.col_start[c + 1]
        parts.append(Part(piece, duals[top:end], reduced[first:last], float(bounds[c]), origin[first:last]))
    return parts


def split_part(part: Part, share: float = 2 / 3) -> list[Part] | None:
    """Drop the columns that no better solution can use; None unless at most ``share`` of them are left."""
    if part.best is None:
        return None
    keep = part.reduced <= part.weight - part.bound - (part.tolerance if part.packing.granularity else 0.0)
    keep[chosen_columns(part.packing.cols, part.best)] = True
    if np.count_nonzero(keep) > share * keep.size:
        return None
    smaller = part.packing.restrict(keep)
    duals = np.where(smaller.slack, np.minimum(part.duals[smaller.row_origin], 0.0), part.duals[smaller.row_origin])
    duals = np.ascontiguousarray(duals)
    hard_pass(smaller, duals, np.empty(smaller.num_columns), 1)
    place = np.full(part.packing.num_columns, -1, dtype=np.int32)
    place[smaller.origin] = np.arange(smaller.num_columns, dtype=np.int32)
    owner = part.best[smaller.row_origin]
    owner = np.where(owner >= 0, place[owner], -1).astype(np.int32)
    pieces = split_components(smaller, duals, part.origin[smaller.origin])
    for c, piece in enumerate(pieces):
        own = owner[smaller.row_start[c] : smaller.row_start[c + 1]]
        piece.best = np.where(own >= 0, own - smaller.col_start[c], -1).astype(np.int32)
        piece.weight = float(piece.packing.weights[_columns(piece)].sum())
        piece.iterations, piece.stalled, piece.deadline = part.iterations, part.stalled, part.deadline
    return pieces


def _columns(part: Part) -> NDArray[np.int64]:
    assert part.best is not None
    return np.asarray(chosen_columns(part.packing.cols, part.best), dtype=np.int64)


def complete(part: Part, run: Run) -> None:
    """Last resort for a part in which no iteration covered all that must be covered."""
    cover = Cover.empty(part.packing)
    cover.add_greedily(ascending(part.reduced))
    if not cover.complete(run):
        raise infeasible(part.packing, run)
    part.offer(cover.owner, cover.weight)
    if part.best is None:
        raise InfeasibleError("no complete solution was found")


def bound_of_part(part: Part, run: Run) -> float:
    """Raise the bound of an open part by a short branch and bound."""
    if part.closed:
        # whole-numbered weights: nothing fits between the bound and the cover
        return part.weight if part.packing.granularity else min(part.bound, part.weight)
    if run.should_stop():
        return part.bound
    search = Search(part.packing, part.duals, part.weight, part.tolerance, run.deadline())
    while not search.done and search.nodes < _PROOF_NODES and not run.should_stop():
        search.run(50)
    return min(max(part.bound, search.lower_bound), part.weight)


def bound_of_choice(packing: Packing, columns: NDArray[np.integer], run: Run) -> tuple[float, Floats]:
    """Return a valid bound, made tight enough to prove this choice of columns where it is optimal.

    Parameters
    ----------
    packing : Packing
        The problem.
    columns : int array
        A complete choice of columns.
    run : Run
        Clock.

    Returns
    -------
    float, float array
        The bound and the multipliers that give its dual part.
    """
    duals = dual_bound(packing, run=run)
    owner = Cover.of(packing, columns).owner
    total = 0.0
    for c, part in enumerate(split_components(packing, duals, np.arange(packing.num_columns))):
        own = owner[packing.row_start[c] : packing.row_start[c + 1]]
        part.best = np.where(own >= 0, own - packing.col_start[c], -1).astype(np.int32)
        part.weight = float(part.packing.weights[_columns(part)].sum())
        total += bound_of_part(part, run)
    return total, duals
