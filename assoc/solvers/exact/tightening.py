"""The bound of a very large component by cuts, found and priced in one region of rows after the other.

Multipliers u of the rows and v <= 0 of cuts (odd sets of rows, packing/simplex/cuts.py) bound a solution from below by

    sum_r u_r + sum_Q v_Q (|Q| - 1) / 2     where no reduced cost  w_j - sum_{r in j} u_r - sum_Q v_Q a_Qj  is < 0.

The linear program of thousands of rows with their cuts takes too long. But with all other multipliers held, those of a
region's rows, and of the cuts inside it, are a small linear program, which finds new cuts, too. Each raises the bound
of the whole; the regions of the next sweep have other borders.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._types import Floats
from assoc.packing.branching.root import Root, root_with_cuts
from assoc.packing.component import Component
from assoc.packing.kernels.rounding import margin
from assoc.packing.packing import Packing, assemble
from assoc.packing.run import Run
from assoc.packing.simplex.program import all_allowed, make_feasible

MANY = 1600
"""Rows from which a component is worth sweeps: a smaller one gets the cuts of its own root."""
# rows of a region
_REGION = 800
# columns of small reduced cost for each row: by them regions grow
_NEAR = 2
# share of the gap that a row costs at least where regions begin
_WORTH = 1e-4
# most sweeps; share of the gap that one gains at least
_SWEEPS, _GAIN = 20, 0.005


class Cut(NamedTuple):
    """An odd set of rows and its multiplier."""

    rows: NDArray[np.int32]
    columns: NDArray[np.int32]
    """The columns with two of these rows or more, and half of the number of these rows, rounded down."""
    times: Floats
    dual: float

    @property
    def bound(self) -> float:
        """What the cut adds to the bound."""
        return self.dual * (self.rows.size // 2)


@dataclass(slots=True)
class Prices:
    """Multipliers of a component's rows and of cuts, for solutions lighter than its best cover."""

    duals: Floats
    reduced: Floats
    """Reduced costs of the columns, (N,); ``inf`` where no such solution has the column."""
    bound: float
    cuts: list[Cut] = field(default_factory=list)

    @classmethod
    def of(cls, component: Component) -> Prices:
        """The prices of a component's multipliers, without cuts."""
        return cls(component.duals.copy(), component.reduced.copy(), component.bound)

    def inside(self, rows: NDArray[np.bool_]) -> list[Cut]:
        """The cuts whose rows are all in this mask, (R + 1,)."""
        return [cut for cut in self.cuts if rows[cut.rows].all()]

    def weights(self, places: NDArray[np.int32], own: NDArray[np.bool_], packing: Packing, cuts: list[Cut]) -> Floats:
        """Weights of columns less the multipliers of all but their ``own`` rows, (K, S), and these cuts.

        All columns that a cut counts are among the places, which ascend.
        """
        duals = np.append(self.duals, 0.0)[packing.cols[places]]
        weights = self.reduced[places] + np.where(own, duals, 0.0).sum(axis=1)
        for cut in cuts:
            weights[np.searchsorted(places, cut.columns)] += cut.dual * cut.times
        return np.asarray(weights)

    def costly(self, best: NDArray[np.int32]) -> Floats:
        """What the best cover (owner of each row) costs above the bound, for each row, (R,)."""
        return np.where(best >= 0, self.reduced[best], -self.duals)


def tighten(component: Component, prices: Prices, run: Run) -> None:
    """Add cuts to the prices of a component, in sweeps over its rows, while they raise the bound."""
    for sweep in range(_SWEEPS):
        before = prices.bound
        _drop(component, prices)
        for inside in _regions(component, prices, sweep):
            if run.should_stop():
                break
            _tighten(component, prices, inside, run.deadline())
        _recompute(component, prices)
        component.proven = max(component.proven, min(prices.bound, component.weight))
        if component.closed or run.should_stop() or prices.bound - before < _GAIN * (component.weight - prices.bound):
            break


def _drop(component: Component, prices: Prices) -> None:
    """Drop the columns that no lighter solution has."""
    dropped = prices.reduced > component.weight - prices.bound
    dropped[component.best_columns()] = False
    prices.reduced[dropped] = np.inf


def _regions(component: Component, prices: Prices, sweep: int) -> Iterator[NDArray[np.bool_]]:
    """Masks of rows, (R + 1,), that columns of small reduced cost join to costly ones; the last is no row."""
    packing, reduced = component.packing, prices.reduced
    rows = packing.num_rows
    few = min(_NEAR * rows, reduced.size) - 1
    neighbours: list[set[int]] = [set() for _ in range(rows + 1)]
    for column in packing.cols[reduced <= np.partition(reduced, few)[few]].tolist():
        for r in column:
            neighbours[r].update(column)
    done = {-1}
    assert component.best is not None
    costly = np.flatnonzero(prices.costly(component.best) > _WORTH * (component.weight - prices.bound))
    for begin in np.random.default_rng(sweep).permutation(costly).tolist():
        if begin in done:
            continue
        region = [begin]
        done.add(begin)
        for r in region:
            new = neighbours[r] - done
            done |= new
            # the list grows while it is read
            region.extend(sorted(new))
            if len(region) >= _REGION:
                break
        inside = np.zeros(rows + 1, dtype=np.bool_)
        inside[region] = True
        yield inside


def _tighten(component: Component, prices: Prices, inside: NDArray[np.bool_], deadline: float) -> None:
    """Raise the bound by the linear program of a region and its cuts."""
    packing, duals = component.packing, prices.duals
    places = packing.touching(np.flatnonzero(inside[:-1]))
    cols = packing.cols[places]
    own = inside[cols]
    known = prices.inside(inside)
    weights = prices.weights(places, own, packing, known)
    before = math.fsum(duals[inside[:-1]]) + math.fsum(cut.bound for cut in known)
    best = np.isin(places, component.best_columns(), assume_unique=True)
    cutoff = math.fsum(np.minimum(weights[best], 0.0))
    useful = np.flatnonzero(weights < 0.0)
    if not useful.size or cutoff - before <= component.tolerance:
        return
    rows = np.where(own[useful], cols[useful], np.int32(-1))
    region = assemble(rows, weights[useful], packing.arrays.slack, places[useful])
    number = np.full(packing.num_rows, -1)
    number[region.row_origin] = np.arange(region.num_rows)
    kept = [cut for cut in known if (number[cut.rows] >= 0).all()]
    sets = np.zeros((len(kept), region.num_rows), dtype=np.bool_)
    for k, cut in enumerate(kept):
        sets[k, number[cut.rows]] = True
    start = np.concatenate([duals[region.row_origin], [cut.dual for cut in kept]])
    root = root_with_cuts(region, start, cutoff, deadline, sets)
    make_feasible(root.program, all_allowed(root.program, root.slack), root.duals)
    if root.program.sides @ root.duals <= before:
        return
    duals[inside[:-1]] = 0.0
    duals[region.row_origin] = root.duals[: region.num_rows]
    gone = {id(cut) for cut in known}
    new = list(_cuts(packing, region, root))
    prices.cuts = [cut for cut in prices.cuts if id(cut) not in gone] + new
    prices.reduced[places] = weights - np.where(own, np.append(duals, 0.0)[cols], 0.0).sum(axis=1)
    for cut in new:
        prices.reduced[cut.columns] -= cut.dual * cut.times


def _cuts(packing: Packing, region: Packing, root: Root) -> Iterator[Cut]:
    """The cuts of a region that have a multiplier."""
    for inside, dual in zip(root.sets, root.duals[region.num_rows :].tolist(), strict=True):
        if dual < 0.0:
            rows = region.row_origin[inside]
            columns = packing.touching(rows)
            uses = np.isin(packing.cols[columns], rows).sum(axis=1)
            twice = uses >= 2
            yield Cut(rows, columns[twice], (uses[twice] // 2).astype(np.float64), dual)


def _recompute(component: Component, prices: Prices) -> None:
    """Recompute reduced costs and bound from the multipliers."""
    packing, dropped = component.packing, np.isinf(prices.reduced)
    prices.duals = np.minimum(prices.duals, 0.0)
    charged = np.zeros(packing.num_columns)
    for cut in prices.cuts:
        charged[cut.columns] += cut.dual * cut.times
    prices.reduced = packing.weights - charged - np.append(prices.duals, 0.0)[packing.cols].sum(axis=1)
    size = float(np.abs(prices.duals).sum()) - math.fsum(cut.bound for cut in prices.cuts)
    largest = float((np.abs(packing.weights) - charged).max())
    # a solution has at most one column for each row, and each reduced cost is rounded
    rounding = margin(size, packing.num_sensors) + 8.0 * sys.float_info.epsilon * largest * packing.num_rows
    least = min(float(prices.reduced[~dropped].min()), 0.0)
    prices.reduced[dropped] = np.inf
    total = math.fsum(prices.duals) + math.fsum(cut.bound for cut in prices.cuts)
    prices.bound = total + least * packing.num_rows - rounding
