"""The excess of runs over the best known cost, at the end and over time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import pandas as pd

_CURVE_POINTS = 60


def with_excess(frame: pd.DataFrame, traces: pd.DataFrame) -> pd.DataFrame:
    """Traces of the runs of a frame; the column ``excess`` is the cost above the best known one of the scan."""
    best = (frame["cost"] - frame["excess"]).groupby([frame["scene"], frame["scan"]]).min().rename("best")
    traces = traces[traces["setting"].isin(frame["setting"].unique())].join(best, on=["scene", "scan"])
    excess = traces["cost"] - traces["best"]
    # rounding errors do not count as excess
    return traces.assign(excess=excess.where(excess > 1e-9 * traces["best"].abs().clip(lower=1.0), 0.0))


def mean_excess(traces: pd.DataFrame, column: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Average the excess of runs over time, each run with its best solution so far.

    ``traces`` are from `with_excess`, not empty; ``column`` is "iteration" or "seconds". Returns iterations, or
    milliseconds, (n,), and the mean cost above the best known, (n,).
    """
    factor = 1e3 if column == "seconds" else 1.0
    at = np.maximum(factor * traces[column].to_numpy(dtype=float), 1e-3)
    run = traces.groupby(["scene", "scan", "repeat"]).ngroup().to_numpy()
    excess = traces["excess"].to_numpy(dtype=float)
    first = float(np.quantile(at[np.unique(run, return_index=True)[1]], 0.5))
    grid = np.unique(np.geomspace(min(first, at.max()), at.max() * 1.02, _CURVE_POINTS))
    total = np.zeros(grid.size)
    order = np.lexsort((at, run))
    starts = np.flatnonzero(np.r_[True, np.diff(run[order]) > 0])
    for rows in np.split(order, starts[1:]):
        index = np.searchsorted(at[rows], grid, side="right") - 1
        total += excess[rows][np.maximum(index, 0)]
    return grid, total / starts.size
