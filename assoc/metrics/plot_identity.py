"""Whose plots a track has taken lately, and how often an aircraft's identity goes over to another track."""

from __future__ import annotations

from collections import Counter, deque

import numpy as np

from assoc._system.door import door
from assoc._types import Array
from assoc.errors import InvalidInputError

MEMORY = 6
"""A track's identity is the majority of its last plots, of this many."""


@door
def identity_after_each(sources: Array, tracks: Array) -> Array:
    """Identity of the track that took each plot, after it took it.

    The identity is the aircraft of most of the track's last 6 plots; false plots have no vote, of equals the most
    recent counts.

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
    source, track = np.asarray(sources), np.asarray(tracks)
    if source.ndim != 1 or source.shape != track.shape:
        raise InvalidInputError(f"sources and tracks must both have shape (n,), got {source.shape}, {track.shape}")
    recent: dict[int, deque[int]] = {}
    identity = np.full(len(source), -1, dtype=np.int64)
    for row, (aircraft, taker) in enumerate(zip(source.tolist(), track.tolist(), strict=True)):
        if taker >= 0:
            plots = recent.setdefault(taker, deque(maxlen=MEMORY))
            plots.append(aircraft)
            identity[row] = majority(plots)
    return identity


def majority(plots: deque[int]) -> int:
    """Whose most of these plots are, of equals the last one's; -1 if no plot is anyone's."""
    votes = Counter(aircraft for aircraft in plots if aircraft >= 0)
    if not votes:
        return -1
    most = max(votes.values())
    return next(aircraft for aircraft in reversed(plots) if votes.get(aircraft, 0) == most)


@door
def plot_identity_switches(sources: Array, tracks: Array, confirmed: Array) -> int:
    """How often an aircraft goes over to another track, whole plots gone astray not counted.

    An aircraft belongs to the last confirmed track that took one of its plots and had its identity then (the
    majority of the track's last 6 plots). A switch is a change of that track: two tracks that swap their
    aircraft give two, a track that was lost and begun anew gives one.

    Parameters
    ----------
    sources, tracks : array_like of int (n,)
        As for `identity_after_each`.
    confirmed : array_like of bool (n,)
        Whether that track was confirmed then.
    """
    source, track, sure = np.asarray(sources), np.asarray(tracks), np.asarray(confirmed, dtype=bool)
    if source.ndim != 1 or not source.shape == track.shape == sure.shape:
        shapes = f"{source.shape}, {track.shape}, {sure.shape}"
        raise InvalidInputError(f"sources, tracks and confirmed must have one shape (n,), got {shapes}")
    own = sure & (source >= 0) & (identity_after_each(source, track) == source)
    owner: dict[int, int] = {}
    switches = 0
    for aircraft, taker in zip(source[own].tolist(), track[own].tolist(), strict=True):
        switches += owner.get(aircraft, taker) != taker
        owner[aircraft] = taker
    return switches


@door
def tracks_of_one_identity(sources: Array, tracks: Array, confirmed: Array) -> tuple[int, int]:
    """How many confirmed tracks kept one identity for all their life, and how many had any.

    A track's identity after each plot is the majority of its last 6 (`identity_after_each`), so that a single plot gone
    astray, or with a garbled code, changes nothing.

    Parameters
    ----------
    sources, tracks : array_like of int (n,)
        As for `identity_after_each`.
    confirmed : array_like of bool (n,)
        Whether that track was confirmed then; its plots before that do not count.
    """
    source, track, sure = np.asarray(sources), np.asarray(tracks), np.asarray(confirmed, dtype=bool)
    if source.ndim != 1 or not source.shape == track.shape == sure.shape:
        shapes = f"{source.shape}, {track.shape}, {sure.shape}"
        raise InvalidInputError(f"sources, tracks and confirmed must have one shape (n,), got {shapes}")
    identity = identity_after_each(source, track)
    own = sure & (track >= 0) & (identity >= 0)
    known = np.unique(np.stack([track[own], identity[own]], axis=1), axis=0)
    _, count = np.unique(known[:, 0], return_counts=True)
    return int((count == 1).sum()), len(count)
