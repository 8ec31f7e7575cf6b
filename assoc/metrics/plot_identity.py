"""The identity of a track from its last plots, and how often an aircraft changes its track."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Collection

import numpy as np

from assoc._system.wrong_types import explains_wrong_types
from assoc._types import Array
from assoc.metrics.trajectories import columns_of_rows

MEMORY = 6
"""A track's identity is the majority of its last plots, of this many."""


@explains_wrong_types
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
        self._tracks = self._sources = np.zeros(0, dtype=np.int64)

    def identities(self, sources: Array, tracks: Array) -> Array:
        """`identity_after_each` of the plots that follow."""
        identity = np.full(len(sources), -1, dtype=np.int64)
        taken, known = np.flatnonzero(tracks >= 0), len(self._tracks)
        every = np.concatenate([self._tracks, tracks[taken]])
        order = np.argsort(every, kind="stable")
        every, plots = every[order], np.concatenate([self._sources, sources[taken]])[order]
        row, begins = np.arange(len(every)), np.flatnonzero(np.diff(every, prepend=-1))
        counts = np.diff(begins, append=len(every))
        new = np.flatnonzero(order >= known)
        identity[taken[order[new] - known]] = _most(plots, new, np.repeat(begins, counts)[new])
        kept = np.repeat(begins + counts, counts) - row <= MEMORY
        self._tracks, self._sources = every[kept], plots[kept]
        return identity

    def keep(self, tracks: Collection[int]) -> None:
        """Forget all tracks but these."""
        kept = np.isin(self._tracks, np.array([*tracks], dtype=np.int64))
        self._tracks, self._sources = self._tracks[kept], self._sources[kept]


def _most(plots: Array, rows: Array, begins: Array) -> Array:
    """`majority` of up to MEMORY plots that end at each of rows (n,), none before `begins` (n,)."""
    columns = rows[:, None] - np.arange(MEMORY)
    last = np.where(columns >= begins[:, None], plots[np.maximum(columns, 0)], -1)
    votes = np.zeros(last.shape, dtype=np.int64)
    for column in last.T:
        votes += last == column[:, None]
    votes[last < 0] = 0
    # of equals the first here, which is the last plot; of false plots alone -1
    return np.asarray(last[np.arange(len(rows)), np.argmax(votes, axis=1)])


def majority(plots: deque[int]) -> int:
    """Aircraft of most of these plots, of equals the last; -1 if all are false."""
    votes = Counter(aircraft for aircraft in plots if aircraft >= 0)
    if not votes:
        return -1
    most = max(votes.values())
    return next(aircraft for aircraft in reversed(plots) if votes.get(aircraft, 0) == most)


@explains_wrong_types
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


@explains_wrong_types
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
        # tracks that had an identity, ascending, and it, -1 if they had several; and counts of forgotten ones
        self._tracks = self._had = np.zeros(0, dtype=np.int64)
        self._kept = self._count = 0
        self.any = False
        """Whether any plot had an identity."""

    def add(self, sources: Array, tracks: Array, confirmed: Array) -> None:
        """Add plots."""
        self.any |= bool((sources >= 0).any())
        identity = self._last.identities(sources, tracks)
        held = confirmed.astype(bool) & (tracks >= 0) & (identity >= 0)
        every = np.concatenate([self._tracks, tracks[held]])
        self._tracks, of = np.unique(every, return_inverse=True)
        had = np.concatenate([self._had, identity[held]])
        least = np.full(len(self._tracks), np.iinfo(np.int64).max)
        np.minimum.at(least, of, had)
        most = np.full(len(self._tracks), -1)
        np.maximum.at(most, of, had)
        self._had = np.where(least == most, most, -1)

    def keep(self, tracks: Collection[int]) -> None:
        """Forget all tracks but these: they get no more plots."""
        self._last.keep(tracks)
        kept = np.isin(self._tracks, np.array([*tracks], dtype=np.int64))
        self._kept += int((self._had[~kept] >= 0).sum())
        self._count += int((~kept).sum())
        self._tracks, self._had = self._tracks[kept], self._had[kept]

    def result(self) -> tuple[int, int]:
        """The numbers so far."""
        return self._kept + int((self._had >= 0).sum()), self._count + len(self._had)
