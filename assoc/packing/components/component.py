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
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from assoc._types import Floats
from assoc.packing.bounds.dual_ascent import certified_bound, hard_pass, reduced_costs
from assoc.packing.bounds.linear_program import linear_program_duals
from assoc.packing.kernels.sorting import ascending
from assoc.packing.neighbourhoods import dimensionwise
from assoc.packing.neighbourhoods.cluster_steps import ClusterSteps
from assoc.packing.neighbourhoods.cover import Cover, chosen_columns
from assoc.packing.neighbourhoods.large import LargeNeighbourhood
from assoc.packing.packing import Packing
from assoc.packing.run import Run

Owner = NDArray[np.int32]

TOLERANCE = 1e-9
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
