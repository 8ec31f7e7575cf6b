"""The identity of a track from its last plots, and how often an aircraft changes its track."""

from __future__ import annotations

from collections import Counter, deque

import numpy as np

from assoc._system.door import door
from assoc._types import Array
from assoc.metrics.trajectories import columns_of_rows

MEMORY = 6
"""A track's identity is the majority of its last plots, of this many."""


@door
def identity_after_each(sources: Array, tracks: Array) -> Array:
    """Identity of the track that took each plot, after it took it.

    The identity is the aircraft of most of the track's last 6 plots, of equals the most recent; false plots do not
    count.

    Parameters
    ----------
    sources : array_like of int (n,)
        The aircraft behind each plot, -1 for a false plot, in the order in which the tracker took them.
    tracks : array_like of int (n,)
        The track that took it, negative if none did.

    Returns
    -------
    int64 array (n,)
        The aircraft; -1 where no track took the plot, or its track has false plots only.
    """
    return LastPlots().identities(*columns_of_rows(sources=sources, tracks=tracks))


class LastPlots:
    """The last plots of tracks."""

    def __init__(self) -> None:
        self._recent: dict[int, deque[int]] = {}

    def identities(self, sources: Array, tracks: Array) -> Array:
        """`identity_after_each` of the plots that follow."""
        identity = np.full(len(sources), -1, dtype=np.int64)
        for row, (aircraft, taker) in enumerate(zip(sources.tolist(), tracks.tolist(), strict=True)):
            if taker >= 0:
                plots = self._recent.get(taker)
                if plots is None:
                    plots = self._recent[taker] = deque(maxlen=MEMORY)
                plots.append(aircraft)
                sure = aircraft >= 0 and 2 * plots.count(aircraft) >= len(plots)
                identity[row] = aircraft if sure else majority(plots)
        return identity

    def keep(self, tracks: set[int]) -> None:
        """Forget all tracks but these."""
        self._recent = {track: plots for track, plots in self._recent.items() if track in tracks}


def majority(plots: deque[int]) -> int:
    """Aircraft of most of these plots, of equals the last; -1 if all are false."""
    votes = Counter(aircraft for aircraft in plots if aircraft >= 0)
    if not votes:
        return -1
    most = max(votes.values())
    return next(aircraft for aircraft in reversed(plots) if votes.get(aircraft, 0) == most)


@door
def plot_identity_switches(sources: Array, tracks: Array, confirmed: Array) -> int:
    """How often an aircraft changes its track; single plots given to another track do not count.

    An aircraft belongs to the last confirmed track that took one of its plots and had its identity then (the
    majority of the track's last 6 plots). A switch is a change of that track: two tracks that swap their
    aircraft count two, a track that was lost and started again counts one.

    Parameters
    ----------
    sources, tracks : array_like of int (n,)
        As for `identity_after_each`.
    confirmed : array_like of bool (n,)
        Whether that track was confirmed then.
    """
    source, track, sure = columns_of_rows(sources=sources, tracks=tracks, confirmed=confirmed)
    held = sure.astype(bool) & (source >= 0) & (identity_after_each(source, track) == source)
    owner: dict[int, int] = {}
    switches = 0
    for aircraft, taker in zip(source[held].tolist(), track[held].tolist(), strict=True):
        switches += owner.get(aircraft, taker) != taker
        owner[aircraft] = taker
    return switches


@door
def tracks_of_one_identity(sources: Array, tracks: Array, confirmed: Array) -> tuple[int, int]:
    """How many confirmed tracks kept one identity all the time, and how many had any.

    A track's identity after each plot is the majority of its last 6 (`identity_after_each`), so that a single foreign
    plot changes nothing.

    Parameters
    ----------
    sources, tracks : array_like of int (n,)
        As for `identity_after_each`.
    confirmed : array_like of bool (n,)
        Whether that track was confirmed then; its plots before that do not count.
    """
    found = IdentitiesSoFar()
    found.add(*columns_of_rows(sources=sources, tracks=tracks, confirmed=confirmed))
    return found.result()


class IdentitiesSoFar:
    """`tracks_of_one_identity` of plots that are added one after the other."""

    def __init__(self) -> None:
        self._last = LastPlots()
        self._of: dict[int, int] = {}
        self.any = False
        """Whether any plot had an identity."""

    def add(self, sources: Array, tracks: Array, confirmed: Array) -> None:
        """Add plots."""
        self.any |= bool((sources >= 0).any())
        identity = self._last.identities(sources, tracks)
        held = confirmed.astype(bool) & (tracks >= 0) & (identity >= 0)
        for track, aircraft in zip(tracks[held].tolist(), identity[held].tolist(), strict=True):
            if self._of.setdefault(track, aircraft) != aircraft:
                self._of[track] = -1

    def keep(self, tracks: set[int]) -> None:
        """Forget the last plots of all tracks but these."""
        self._last.keep(tracks)

    def result(self) -> tuple[int, int]:
        """The numbers so far."""
        return sum(one >= 0 for one in self._of.values()), len(self._of)
