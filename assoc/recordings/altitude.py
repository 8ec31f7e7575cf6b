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

    Garbled is a level that is more than 30 flight levels away from the median of up to three plots before and three
    after it of the same identity (which need three good ones among them). A known code is garbled, too, unless there
    are three such plots and it agrees with them: an aircraft on the ground is at level 0.

    Parameters
    ----------
    levels : array_like (n,)
        Flight levels in the order of time, NaN where there is none.
    identities : array_like of int (n,)
        0 where it was not decoded: such plots are judged by the codes only.
    codes : array_like of int
        Flight levels that are taken for garbled where the neighbours do not agree with them.
    times : array_like (n,), optional
        Seconds: only plots within `NEARBY` of one another are then compared.

    Returns
    -------
    ndarray of bool (n,)
    """
    identity, found = np.asarray(identities), np.isin(levels, np.asarray(codes, dtype=np.float64))
    order = np.argsort(identity, kind="stable")
    # from here on identity by identity
    level, identity, garbled = np.asarray(levels, dtype=np.float64)[order], identity[order], found[order]
    when = np.zeros(len(order)) if times is None else np.asarray(times, dtype=np.float64)[order]
    known = (identity != 0) & ~np.isnan(level)
    good, coded = known & ~garbled, known & garbled
    garbled[good] = _steps(level, identity, when, good, good) > LARGEST_STEP
    # codes may have codes beside them; good plots that disagree count for more
    beside = [_steps(level, identity, when, coded, among) for among in (known, good)]
    garbled[coded] = ~(np.fmax(*beside) <= LARGEST_STEP)
    found[order] = garbled
    return found


def _steps(level: Array, identity: Array, when: Array, of: Array, among: Array) -> Array:
    """How far the levels of some plots are from the median of their neighbours among others; NaN with too few."""
    rows, others = np.flatnonzero(of), np.flatnonzero(among)
    if not len(rows) or not len(others):
        return np.full(len(rows), np.nan)
    # one that is not among the others stands between two of them
    steps = np.array([*range(-NEIGHBOURS, 0), *range(1, NEIGHBOURS + 1)])
    at = (np.cumsum(among) - among)[rows][:, None] + steps - ((steps > 0) & ~among[rows][:, None])
    there = (at >= 0) & (at < len(others))
    beside = others[np.clip(at, 0, len(others) - 1)]
    there &= identity[beside] == identity[rows][:, None]
    there &= np.abs(when[beside] - when[rows][:, None]) <= NEARBY
    count = there.sum(axis=1)
    around = np.sort(np.where(there, level[beside], np.inf), axis=1)
    each = np.arange(len(rows))
    median = 0.5 * (around[each, np.maximum(count - 1, 0) // 2] + around[each, count // 2])
    return np.where(count >= NEIGHBOURS, np.abs(level[rows] - median), np.nan)
