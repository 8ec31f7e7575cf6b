"""Large components whose gap comes from a few places: search these regions alone, then the little that they leave.

Good multipliers u leave most rows decided. What the best cover costs above the bound comes from the others: A, the rows
of their columns. For any set A of rows with slack, every solution weighs at least

    sum_{r not in A} u_r  +  min sum_{j that touch A} (w_j - sum_{r of j not in A} u_r) x_j

where the minimum is over packings of the rows of A. It falls into independent regions, which are solved exactly. An
answer whose columns stay inside A replaces that part of the cover, and its region has no gap left; where columns reach
out of A, A grows. (Of a very large component w is the weight less the multipliers of cuts that reach out of A:
tightening.py.) Then the gap is what the rows outside of A cost: those that cost most of it join A, until nothing is
left or regions become too hard or too large. Columns that cost more than what is left are dropped.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._types import Floats
from assoc.packing.component import Component
from assoc.packing.kernels.columns import choose_all
from assoc.packing.kernels.rounding import margin
from assoc.packing.packing import Packing, assemble
from assoc.packing.run import Outcome, Run
from assoc.solvers.exact.tightening import MANY, Prices, tighten

# share of the gap that rows outside of regions may cost
_OUTSIDE = 0.02
# share of what is left that regions keep, above which they are too hard: they would only become harder
_HARD = 0.5
# share of the rows up to which a gap comes from so few that regions alone close it
_FEW = 0.01
# share of the rows above which regions are not worth a search
_MOST = 0.5
# rounds of growth: a region grows by a column or two in each
_ROUNDS = 100

Solve = Callable[[Packing], Outcome]


class _Searched(NamedTuple):
    """What regions have shown."""

    bound: float
    """A lower bound on solutions lighter than the best cover."""
    extra: Floats
    """What a solution with this column weighs more than the bound, at least, (N,)."""
    reaching: NDArray[np.int32]
    """Columns of the answers that have rows outside of all regions."""
    hard: bool
    """Whether regions could not be closed."""


def close_by_regions(component: Component, solve: Solve, run: Run) -> NDArray[np.bool_]:
    """Improve the cover and the bound of a component, whose rows all have slack, by searches of regions.

    Returns the columns that a better cover may have, and those of the best one.
    """
    packing, searched = component.packing, None
    prices = Prices.of(component)
    inside = _costly(component, prices, component.weight - prices.bound)
    if packing.num_rows >= MANY and np.count_nonzero(inside) > _FEW * packing.num_rows:
        tighten(component, prices, run)
        inside = _costly(component, prices, component.weight - prices.bound)
    before = -1
    for _ in range(_ROUNDS):
        _complete(component, inside)
        rows = int(np.count_nonzero(inside))
        if rows > _MOST * packing.num_rows or rows == before:
            break
        before, weight = rows, component.weight
        searched = _search(component, prices, inside, solve)
        component.proven = max(component.proven, min(searched.bound, weight))
        # searches that end early may show less than cuts did
        in_vain = bool(prices.cuts) and searched.bound < prices.bound - component.tolerance
        if component.closed or searched.hard or in_vain:
            break
        if not searched.reaching.size:
            inside |= _costly(component, prices, component.weight - searched.bound)
        inside[packing.cols[searched.reaching]] = True
    cutoff = component.weight - (component.tolerance if packing.granularity else 0.0)
    keep = prices.bound + prices.reduced <= cutoff
    if searched is not None:
        keep &= searched.bound + searched.extra <= cutoff
    keep[component.best_columns()] = True
    return np.asarray(keep)


def _costly(component: Component, prices: Prices, gap: float) -> NDArray[np.bool_]:
    """The rows that cost most of a gap, shape (R + 1,); the last is no row, a sensor that missed."""
    best = component.best
    assert best is not None
    cost = prices.costly(best)
    order = np.argsort(cost)
    # all rows of a column name its reduced cost
    outside = np.cumsum(cost[order]) <= _OUTSIDE * component.packing.num_sensors * gap
    inside = np.zeros(cost.size + 1, dtype=np.bool_)
    inside[order[~outside]] = True
    return inside


def _complete(component: Component, inside: NDArray[np.bool_]) -> None:
    """Add all rows of the best cover's columns that have rows inside."""
    assert component.best is not None
    chosen = component.best[inside[:-1]]
    inside[component.packing.cols[chosen[chosen >= 0]]] = True
    inside[-1] = False


def _search(component: Component, prices: Prices, inside: NDArray[np.bool_], solve: Solve) -> _Searched:
    """Solve all regions; where an answer stays inside, it replaces that part of the best cover."""
    packing, duals, best = component.packing, prices.duals, component.best_columns()
    places = packing.touching(np.flatnonzero(inside[:-1]))
    cols = packing.cols[places]
    own = inside[cols]
    cuts = prices.inside(inside)
    weights = prices.weights(places, own, packing, cuts)
    worse = prices.reduced[places] > component.weight - prices.bound
    useful = ((weights < 0.0) & ~worse) | np.isin(places, best)
    regions = assemble(np.where(own, cols, np.int32(-1))[useful], weights[useful], packing.arrays.slack, places[useful])
    found = solve(regions)
    region = np.searchsorted(regions.col_start, found.columns, side="right") - 1
    gained = -np.add.reduceat(duals[regions.row_origin], regions.row_start[:-1])
    place = np.full(packing.num_rows, regions.num_components)
    place[regions.row_origin] = np.repeat(np.arange(regions.num_components), np.diff(regions.row_start))
    for cut in cuts:
        # a cut holds in the part of each region, too
        gained -= cut.dual * (np.bincount(place[cut.rows], minlength=regions.num_components + 1)[:-1] // 2)
    np.add.at(gained, region, regions.weights[found.columns])
    # a column that is not useful costs its weight on top of an answer without it, any other at most its own region
    extra = prices.reduced.copy()
    extra[places] = np.where(worse, extra[places], weights)
    extra[regions.origin] = prices.reduced[regions.origin] - np.repeat(gained, np.diff(regions.col_start))
    size = float(np.abs(duals).sum()) - math.fsum(cut.bound for cut in prices.cuts)
    own_part = math.fsum(duals[inside[:-1]]) + math.fsum(cut.bound for cut in cuts)
    bound = prices.bound - own_part + found.lower_bound - 4.0 * margin(size, packing.num_sensors)

    chosen = regions.origin[found.columns]
    reaches = ((packing.cols[chosen] >= 0) & ~inside[packing.cols[chosen]]).any(axis=1)
    settled = np.ones(regions.num_components, dtype=np.bool_)
    settled[region[reaches]] = False
    assert component.best is not None
    owner = component.best.copy()
    owner[regions.row_origin[np.repeat(settled, np.diff(regions.row_start))]] = -1
    choose_all(packing.arrays.cols, chosen[settled[region]], owner)
    component.offer(owner, component.weight_of(owner))
    left = float(regions.weights[found.columns].sum()) - found.lower_bound
    most = max(_OUTSIDE * (component.weight - prices.bound), _HARD * (component.weight - bound))
    return _Searched(bound, extra, chosen[reaches], hard=left > most)
