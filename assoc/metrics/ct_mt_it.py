"""Correct, maintained and non-existing target rates of radar plots: CT, MT and IT."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from assoc._system.door import door
from assoc._text.shown import Shown
from assoc._types import Array
from assoc.metrics.plot_identity import identity_after_each
from assoc.metrics.trajectories import columns_of_rows


@dataclass(frozen=True, eq=False, repr=False)
class CtMtIt(Shown):
    """Rates of each window and their means, in percent.

    Attributes
    ----------
    ct, mt, it : float
        Means over the windows that have such plots; NaN if none has.
    windows : int array (K,)
        The windows, ascending.
    per_window : array (K, 3)
        CT, MT, IT of each; NaN for 0 / 0.
    """

    ct: float
    mt: float
    it: float
    windows: Array
    per_window: Array

    def __repr__(self) -> str:
        return f"CtMtIt(CT {self.ct:.1f} %, MT {self.mt:.1f} %, IT {self.it:.1f} %, {len(self.windows)} windows)"


@door
def ct_mt_it(windows: Array, sources: Array, tracks: Array, confirmed: Array) -> CtMtIt:
    """CT, MT and IT of plots that a tracker has given to tracks.

    CT: aircraft plots given to a confirmed track whose identity is that aircraft / aircraft plots. MT: aircraft
    plots in a confirmed track that also took that aircraft's previous plot / aircraft plots. IT: plots that were
    given to a track, but not to a confirmed one of the same identity / plots given to a track. For a track's identity
    see `identity_after_each`.

    Parameters
    ----------
    windows : array_like of int (n,)
        The window of each plot, in the order in which the tracker took them.
    sources : array_like of int (n,)
        The aircraft behind each plot, -1 for a false plot.
    tracks : array_like of int (n,)
        The track that took it, -1 if none did.
    confirmed : array_like of bool (n,)
        Whether that track was confirmed then, the plot included.

    Returns
    -------
    CtMtIt
    """
    window, source, track, sure = columns_of_rows(windows=windows, sources=sources, tracks=tracks, confirmed=confirmed)
    correct = sure.astype(bool) & (source >= 0) & (identity_after_each(source, track) == source)
    previous: dict[int, int] = {}
    kept = np.zeros(len(window), dtype=bool)
    for row, (aircraft, taker) in enumerate(zip(source.tolist(), track.tolist(), strict=True)):
        if aircraft >= 0:
            kept[row] = taker >= 0 and bool(sure[row]) and previous.get(aircraft) == taker
            previous[aircraft] = taker
    real, given = source >= 0, track >= 0
    names, index = np.unique(window, return_inverse=True)

    def count(chosen: Array) -> Array:
        return np.bincount(index, weights=chosen, minlength=len(names))

    with np.errstate(invalid="ignore"):
        wrong = count(given & ~correct) / count(given)
        rates = np.stack([count(correct) / count(real), count(kept) / count(real), wrong], axis=1)
    ct, mt, it = (100.0 * _mean(rate) for rate in rates.T)
    return CtMtIt(ct, mt, it, names, 100.0 * rates)


def _mean(rate: Array) -> float:
    known = rate[~np.isnan(rate)]
    return float(known.mean()) if len(known) else float("nan")
