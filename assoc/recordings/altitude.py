"""Altitudes that cannot be right."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from assoc._system.door import door
from assoc._types import Array

GARBLED_CODES = (0, 1, 2, 3, 256, 257, 258, 512, 513, 514, 584, 770)
"""Flight levels of the paper's recording that appear between quite different ones: answers with lost bits."""

NEIGHBOURS = 3
LARGEST_STEP = 30.0
"""Flight levels: no aircraft changes its level by more between a few rotations."""


@door
def garbled_altitudes(levels: ArrayLike, identities: ArrayLike, codes: ArrayLike = GARBLED_CODES) -> Array:
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

    Returns
    -------
    ndarray of bool (n,)
    """
    level, identity = np.asarray(levels, dtype=np.float64), np.asarray(identities)
    garbled = np.isin(level, np.asarray(codes, dtype=np.float64))
    for code in np.unique(identity[identity != 0]):
        rows = np.flatnonzero((identity == code) & ~np.isnan(level))
        good = rows[~garbled[rows]]
        for index, row in enumerate(good):
            around = np.concatenate(
                [good[max(0, index - NEIGHBOURS) : index], good[index + 1 : index + 1 + NEIGHBOURS]]
            )
            if len(around) >= NEIGHBOURS and abs(level[row] - np.median(level[around])) > LARGEST_STEP:
                garbled[row] = True
    return garbled
