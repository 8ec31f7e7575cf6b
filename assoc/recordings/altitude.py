"""Altitudes that cannot be right."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from assoc._system.wrong_types import explains_wrong_types
from assoc._types import Array

GARBLED_CODES = (0, 1, 2, 3, 256, 257, 258, 512, 513, 514, 584, 770)
"""Flight levels of the paper's recording that appear between quite different ones: answers with lost bits."""

NEIGHBOURS = 3
NEARBY = 300.0
"""Seconds: plots of one identity that are farther apart say nothing of one another."""
LARGEST_STEP = 30.0
"""Flight levels: no aircraft changes its level by more between a few rotations."""


@explains_wrong_types
def garbled_altitudes(
    levels: ArrayLike, identities: ArrayLike, codes: ArrayLike = GARBLED_CODES, times: ArrayLike | None = None
) -> Array:
    """Find garbled altitudes.

    Garbled are the known codes, and a level that is more than 30 flight levels away from the median of up to three
    plots before and three after it of the same identity (which need three good ones among them).

    Parameters
    ----------
    levels : array_like (n,)
        Flight levels in the order of time, NaN where there is none.
    identities : array_like of int (n,)
        0 where it was not decoded: such plots are judged by the codes only.
    codes : array_like of int
        Flight levels that are taken for garbled.
    times : array_like (n,), optional
        Seconds: only plots within `NEARBY` of one another are then compared.

    Returns
    -------
    ndarray of bool (n,)
    """
    level, identity = np.asarray(levels, dtype=np.float64), np.asarray(identities)
    garbled: Array = np.isin(level, np.asarray(codes, dtype=np.float64))
    rows = np.flatnonzero((identity != 0) & ~np.isnan(level) & ~garbled)
    rows = rows[np.argsort(identity[rows], kind="stable")]
    if len(rows):
        # each good plot beside its neighbours of the same identity
        steps = np.array([*range(-NEIGHBOURS, 0), *range(1, NEIGHBOURS + 1)])
        beside = np.arange(len(rows))[:, None] + steps
        there = (beside >= 0) & (beside < len(rows))
        others = rows[np.clip(beside, 0, len(rows) - 1)]
        there &= identity[others] == identity[rows][:, None]
        if times is not None:
            when = np.asarray(times, dtype=np.float64)
            there &= np.abs(when[others] - when[rows][:, None]) <= NEARBY
        count = there.sum(axis=1)
        around = np.sort(np.where(there, level[others], np.inf), axis=1)
        each = np.arange(len(rows))
        median = 0.5 * (around[each, np.maximum(count - 1, 0) // 2] + around[each, count // 2])
        garbled[rows[(count >= NEIGHBOURS) & (np.abs(level[rows] - median) > LARGEST_STEP)]] = True
    return garbled
