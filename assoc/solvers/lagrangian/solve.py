"""Lagrangian relaxation from S dimensions to two, and recovery of a solution from two to S.

The constraints of sensors 3..S are relaxed with multipliers u (u <= 0 where a measurement may stay
unused, free where it must be used). For each pair of measurements of the first two sensors only the cheapest
column, by weight less its u, matters; what remains is a two-dimensional assignment, solved to the optimum:

    L(u) = sum(u) + min { 2-D assignment of c_ij = min_j' (w_j' - u of its rows in sensors 3..S) } <= optimum

Its duals together with u are feasible multipliers of the whole problem, which certify the bound. Multipliers move
along the subgradient g_r = 1 - (times that r is used) by Polyak's step. From the pairs a solution is recovered sensor
by sensor: the tuples so far are assigned to the measurements of the next sensor, with u for those of later sensors.
Each step is again an exact 2-D assignment.

The multipliers start from the smoothed dual ascent (packing/bounds/dual_ascent.py), which is near the LP bound
in milliseconds; columns whose reduced cost exceeds the gap are dropped on the way.

References
----------
S. Deb, M. Yeddanapudi, K. Pattipati and Y. Bar-Shalom, "A generalized S-D assignment algorithm for
multisensor-multitarget state estimation", IEEE Trans. AES 33, 523-538 (1997).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from assoc._system.kernels.sorting import ascending
from assoc._types import Floats
from assoc.packing.bounds.dual_ascent import certified_bound, dual_bound, hard_pass, reduced_costs
from assoc.packing.bounds.priced import Priced
from assoc.packing.cover import Cover
from assoc.packing.neighbourhoods.cluster import ClusterSearch
from assoc.packing.neighbourhoods.dimensionwise import improve_dimensionwise
from assoc.packing.packing import Packing
from assoc.packing.run import Outcome, Run, infeasible
from assoc.solvers.lagrangian.arranged import arrange
from assoc.solvers.lagrangian.parameters import LagrangianParameters
from assoc.solvers.lagrangian.recovery import recover
from assoc.solvers.lagrangian.relaxation import relax

_COARSE_LEVELS = 4
_COARSE_PASSES = 10
_POLISH_STEPS = 50
_POLISH_ROUNDS = 20
_POLISH_TUPLES = 20


def solve(packing: Packing, parameters: LagrangianParameters, run: Run) -> Outcome:
    """Relax and recover; one iteration is one subgradient step.

    Raises
    ------
    InfeasibleError
        There is no solution, or none was found.
    """
    if packing.num_columns == 0:
        if packing.is_axial:
            raise infeasible(packing)
        return Outcome(np.zeros(0, dtype=np.int64), 0, 0.0, np.zeros(packing.num_rows))
    if parameters.warm_start:
        # coarse: only good enough to drop most columns before the full ascent on the rest
        duals = dual_bound(packing, levels=_COARSE_LEVELS, passes=_COARSE_PASSES, run=run)
    else:
        duals = np.zeros(packing.num_rows)
        hard_pass(packing, duals)
    bound = certified_bound(packing, duals)
    if bound == math.inf:
        raise infeasible(packing)
    if run.fallback is not None and run.should_stop():
        return Outcome(run.fallback, 0, min(bound, float(packing.weights[run.fallback].sum())), duals)
    search = Subgradient(packing, duals, parameters, run, bound)
    search.iterate()
    if parameters.polish:
        search.polish()
    columns = search.columns
    if columns is None and run.fallback is not None:
        columns = run.fallback.astype(np.int64)
    if columns is None:
        cover = Cover.empty(packing)
        cover.add_greedily(ascending(packing.weights))
        if not cover.complete(run):
            raise infeasible(packing, run)
        columns = cover.columns().astype(np.int64)
    # the proof of a bound over the columns left also needs the columns that were dropped
    proof = search.proof
    bound = min(search.bound, float(packing.weights[columns].sum()))
    if search.cut_off:
        run.stopped_by = run.stopped_by or "iterations"
    return Outcome(columns, search.iterations, bound, proof)


class Subgradient:
    """State of the method: multipliers, best bound, best solution, and the columns left."""

    def __init__(
        self, packing: Packing, duals: Floats, parameters: LagrangianParameters, run: Run, bound: float
    ) -> None:
        self.parameters = parameters
        self.run = run
        self.whole = packing
        self.bound = bound
        self.proof: Floats | None = duals
        self.columns = None if run.start is None else run.start.astype(np.int64)
        self.weight = math.inf if run.start is None else float(packing.weights[run.start].sum())
        self.iterations = 0
        self.cut_off = False
        self._focus(packing, duals, np.arange(packing.num_columns))

    def _focus(self, packing: Packing, duals: Floats, origin: NDArray[np.int64]) -> None:
        """Restrict the work to these columns; ``origin`` holds their indices in the whole problem."""
        self.packing = packing
        self.origin = origin
        self.arranged = arrange(packing)
        self.duals = duals
        self.best = duals

    def iterate(self) -> None:
        """Relax, recover and step until the gap is closed or nothing changes any more."""
        factor = self.parameters.step
        stalled = 0
        while self.iterations < self.parameters.iterations:
            self.iterations += 1
            before = self.bound
            subgradient = self._relax()
            if subgradient is None:
                # the columns left allow no better solution than the best one
                self._raise_bound(self.weight, None)
                break
            if self.run.should_stop() and (self.columns is not None or self.run.fallback is not None):
                break
            self._recover()
            self.run.record(self.iterations, self.weight, min(self.bound, self.weight))
            if self._gap_closed() or self.run.should_stop():
                break
            if self.bound > before + 1e-9 * max(1.0, abs(before)):
                stalled = 0
            else:
                stalled += 1
                if stalled % self.parameters.patience == 0:
                    factor *= 0.5
                    self.duals = self.best
                    if factor < self.parameters.step / 1024.0:
                        break
                    continue
            dropped = self._drop_columns()
            if self.iterations == 1 and self.parameters.warm_start:
                self._refine()
            elif not dropped and not self._step(subgradient, factor):
                break
        else:
            self.cut_off = True

    def polish(self) -> None:
        """Improve the best solution by cluster search within the columns left."""
        if self.columns is None or self._gap_closed() or self.run.should_stop():
            return
        search = ClusterSearch(Priced.of(self.packing, self.best))
        search.size = _POLISH_TUPLES * self.packing.cols.shape[1]
        cover = Cover.of(self.packing, np.flatnonzero(np.isin(self.origin, self.columns)))
        for _ in range(_POLISH_ROUNDS):
            if self.run.should_stop():
                return
            change, _ = search.search(
                self.packing.arrays, cover.owner, self.run.rng, _POLISH_STEPS, self.run.deadline()
            )
            if change == 0.0:
                return
            self.weight = cover.weight
            self.columns = self.origin[cover.columns()]
            self.run.record(self.iterations, self.weight, min(self.bound, self.weight))
            if self._gap_closed():
                return

    def _gap_closed(self) -> bool:
        if self.weight == math.inf:
            return False
        closed = self.weight - self.bound <= self.parameters.gap * max(1.0, abs(self.weight + self.run.offset))
        if closed and not self.run.stopped_by:
            self.run.stopped_by = "gap"
        return closed

    def _relax(self) -> Floats | None:
        """Solve the 2-D relaxation; returns the subgradient, or None if it has no solution."""
        answer = relax(self.arranged, self.duals)
        if answer is None:
            return None
        self.duals, subgradient = answer
        bound = certified_bound(self.packing, self.duals)
        if bound > self.bound:
            self._raise_bound(bound, self.duals if self.packing is self.whole else None)
            self.best = self.duals
        return subgradient

    def _raise_bound(self, bound: float, proof: Floats | None) -> None:
        self.bound, self.proof = max(self.bound, bound), proof

    def _recover(self) -> None:
        columns = recover(self.arranged, self.duals)
        if columns is None:
            return
        cover = Cover.of(self.packing, columns)
        better = self._offer(cover)
        if not self.parameters.polish:
            return
        if better:
            # it may already be good enough for the requested gap or the callback
            self.run.record(self.iterations, self.weight, min(self.bound, self.weight))
            if self._gap_closed() or self.run.should_stop():
                return
        cover.improve(self.run.deadline())
        improve_dimensionwise(self.packing, cover.owner, self.run.deadline())
        self._offer(cover)

    def _offer(self, cover: Cover) -> bool:
        """Keep a cover if it is the best so far; returns whether it was."""
        weight = cover.weight
        if weight >= self.weight:
            return False
        self.weight = weight
        self.columns = self.origin[cover.columns()]
        return True

    def _drop_columns(self) -> bool:
        """Drop columns that no better solution can use; returns whether enough were dropped to rebuild the packing."""
        if self.weight == math.inf:
            return False
        room = self.weight - self.bound + 1e-9 * max(1.0, abs(self.weight))
        reduced = reduced_costs(self.packing, self.best)
        # the multipliers prove a bound that may be below the best
        slack = max(0.0, self.bound - certified_bound(self.packing, self.best))
        keep = reduced <= room + slack
        if np.count_nonzero(keep) > 0.5 * keep.size:
            return False
        smaller = self.packing.restrict(keep)
        origin = self.origin[smaller.origin]
        self._focus(smaller, self.best[smaller.row_origin], origin)
        return True

    def _refine(self) -> None:
        """Do the full smoothed dual ascent on the columns left."""
        duals = dual_bound(self.packing, run=self.run)
        bound = certified_bound(self.packing, duals)
        if bound > certified_bound(self.packing, self.best):
            self.duals = self.best = duals
            if bound > self.bound:
                self._raise_bound(bound, duals if self.packing is self.whole else None)

    def _step(self, subgradient: Floats, factor: float) -> bool:
        """Polyak's step on the relaxed rows; False where the subgradient is 0 (u is optimal)."""
        slack = self.packing.slack
        direction = np.where(slack & (self.duals >= 0.0) & (subgradient > 0.0), 0.0, subgradient)
        norm = float(direction @ direction)
        if norm == 0.0:
            return False
        target = self.weight if self.weight < math.inf else self.bound + 0.1 * max(1.0, abs(self.bound))
        moved = self.duals + factor * max(target - self.bound, 1e-9) / norm * direction
        self.duals = np.where(slack, np.minimum(moved, 0.0), moved)
        return True
