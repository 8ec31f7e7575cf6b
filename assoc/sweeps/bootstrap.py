"""Bootstrap intervals for runs that share problems and repeats."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from assoc._types import Floats

RESAMPLES, LEVEL = 2000, 0.95
_MOST_NUMBERS = 10_000_000


def mean_interval(values: Floats, weights: Floats | None = None, *, resamples: int = RESAMPLES) -> tuple[float, float]:
    """95 % interval of the mean over problems and repeats, (P, R) with NaN where a run is missing, both resampled.

    The mean is ``sum(weights * values) / sum(weights)``; the seed is fixed, so that the interval is reproducible. NaN
    without values, and both ends equal to a single value.

    A. B. Owen, The pigeonhole bootstrap, Annals of Applied Statistics 1 (2007): resampling rows and columns is
    conservative where runs of one problem, or of one repeat, are alike.
    """
    share = np.where(np.isnan(values), 0.0, 1.0 if weights is None else weights)
    if not share.any():
        return np.nan, np.nan
    of_rows, of_columns = draws(*values.shape, resamples)
    # relative to the middle of the values, so that large equal numbers give an interval of width 0
    middle = weighted_mean(values, weights)
    away = np.where(share > 0, values - middle, 0.0)
    total = ((of_rows @ (share * away)) * of_columns).sum(axis=1)
    weight = ((of_rows @ share) * of_columns).sum(axis=1)
    means = middle + total[weight > 0] / weight[weight > 0]
    low, high = np.quantile(means, [(1 - LEVEL) / 2, (1 + LEVEL) / 2])
    return float(low), float(high)


@lru_cache(maxsize=8)
def draws(rows: int, columns: int, resamples: int) -> tuple[Floats, Floats]:
    """Number of times that each row and each column is drawn, for each resample."""
    rng = np.random.default_rng(0)
    resamples = max(200, min(resamples, _MOST_NUMBERS // max(rows, columns)))
    of_rows = rng.multinomial(rows, np.full(rows, 1 / rows), resamples).astype(float)
    of_columns = rng.multinomial(columns, np.full(columns, 1 / columns), resamples).astype(float)
    return of_rows, of_columns


def weighted_mean(values: Floats, weights: Floats | None = None) -> float:
    """Mean of the values that are not NaN; NaN if there are none or the weights are all 0."""
    known = ~np.isnan(values)
    share = np.ones(int(known.sum())) if weights is None else weights[known]
    return float(np.average(values[known], weights=share)) if share.sum() > 0 else float("nan")
