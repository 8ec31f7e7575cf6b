"""Correct, maintained and non-existing target rates of radar plots: CT, MT and IT."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from assoc._system.wrong_types import explains_wrong_types
from assoc._text.shown import Shown
from assoc._types import Array
from assoc.metrics.plot_identity import LastPlots
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


@explains_wrong_types
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
    found = RatesSoFar()
    found.add(*columns_of_rows(windows=windows, sources=sources, tracks=tracks, confirmed=confirmed))
    return found.result()


class RatesSoFar:
    """`ct_mt_it` of plots that are added one after the other, all of a window at once."""

    def __init__(self) -> None:
        self._last = LastPlots()
        # aircraft, ascending, and the tracks that took their last plots
        self._aircraft = self._takers = np.zeros(0, dtype=np.int64)
        self._windows: list[Array] = []
        self._rates: list[Array] = []

    def add(self, windows: Array, sources: Array, tracks: Array, confirmed: Array) -> None:
        """Add plots."""
        sure = confirmed.astype(bool)
        correct = sure & (sources >= 0) & (self._last.identities(sources, tracks) == sources)
        kept = sure & (sources >= 0) & (tracks >= 0) & (self._previous(sources, tracks) == tracks)
        real, given = sources >= 0, tracks >= 0
        names, index = np.unique(windows, return_inverse=True)

        def count(chosen: Array) -> Array:
            return np.bincount(index, weights=chosen, minlength=len(names))

        with np.errstate(invalid="ignore"):
            wrong = count(given & ~correct) / count(given)
            rates = [count(correct) / count(real), count(kept) / count(real), wrong]
        self._windows.append(names)
        self._rates.append(np.stack(rates, axis=1))

    def _previous(self, sources: Array, tracks: Array) -> Array:
        """The track that took the plot before of each plot's aircraft; -2 for the first, -1 if none did."""
        previous = np.full(len(sources), -2, dtype=np.int64)
        real, known = np.flatnonzero(sources >= 0), len(self._aircraft)
        every = np.concatenate([self._aircraft, sources[real]])
        order = np.argsort(every, kind="stable")
        every, takers = every[order], np.concatenate([self._takers, tracks[real]])[order]
        again = np.flatnonzero(np.diff(every, prepend=-1) == 0)
        previous[real[order[again] - known]] = takers[again - 1]
        last = np.flatnonzero(np.diff(every, append=-1))
        self._aircraft, self._takers = every[last], takers[last]
        return previous

    def keep(self, tracks: Collection[int]) -> None:
        """Forget the last plots of all tracks but these."""
        self._last.keep(tracks)

    def result(self) -> CtMtIt:
        """The rates so far."""
        rates = np.concatenate(self._rates)
        ct, mt, it = (100.0 * _mean(rate) for rate in rates.T)
        return CtMtIt(ct, mt, it, np.concatenate(self._windows), 100.0 * rates)


def _mean(rate: Array) -> float:
    known = rate[~np.isnan(rate)]
    return float(known.mean()) if len(known) else float("nan")
