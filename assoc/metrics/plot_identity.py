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
    source, track = columns_of_rows(sources=sources, tracks=tracks)
    recent: dict[int, deque[int]] = {}
    identity = np.full(len(source), -1, dtype=np.int64)
    for row, (aircraft, taker) in enumerate(zip(source.tolist(), track.tolist(), strict=True)):
        if taker >= 0:
            plots = recent.setdefault(taker, deque(maxlen=MEMORY))
            plots.append(aircraft)
            identity[row] = majority(plots)
    return identity


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
    source, track, sure = columns_of_rows(sources=sources, tracks=tracks, confirmed=confirmed)
    identity = identity_after_each(source, track)
    held = sure.astype(bool) & (track >= 0) & (identity >= 0)
    known = np.unique(np.stack([track[held], identity[held]], axis=1), axis=0)
    _, count = np.unique(known[:, 0], return_counts=True)
    return int((count == 1).sum()), len(count)
