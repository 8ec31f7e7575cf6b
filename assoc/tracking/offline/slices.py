"""A recording in slices of time, each tracked by itself, and their tracks stitched together.

A slice begins some windows early, so that the tracks that come over from the slice before are confirmed at its
border. Tracks of both are one if they took the same plots there: an assignment of two lists, which `exact` proves
optimal, makes the number of these plots as large as possible.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from assoc._types import Array
from assoc.errors import AssocError
from assoc.problem import AssignmentProblem
from assoc.recordings import Window
from assoc.scene.geodesy import Origin
from assoc.solvers.assign import assign
from assoc.tracking.adapting.identity_watch import OddIdentity
from assoc.tracking.offline.plots import Followed, follow, known_of
from assoc.tracking.track_table import TrackTable
from assoc.tracking.tracker import Tracker

if TYPE_CHECKING:
    import pandas as pd

TURNS = 10.0
"""Turns that a slice begins early besides the time after which tracks are deleted."""
# counts that go on from slice to slice
_RUNNING = ("score", "hits", "hits_1", "hits_2")


def overlap(tracker: Tracker, turn: float) -> float:
    """Seconds that slices begin early, with a radar of so many seconds a turn."""
    missed = np.log1p([-sensor.detection_probability for sensor in tracker.sensors])
    return float(tracker.settings.life_cycle.patience(missed[None, :], turn)[0]) + TURNS * turn


class Slice(NamedTuple):
    """Windows of a slice."""

    number: int
    windows: list[Window]
    early: int
    """How many of the windows belong to the slice before."""


def slices_of(windows: Iterable[Window], seconds: float, early: float) -> Iterator[Slice]:
    """Slices of so many seconds, each of which begins so many seconds early."""
    held: list[Window] = []
    number = known = 0
    for window in windows:
        if len(held) > known and window.times[-1] >= held[known].times[-1] + seconds:
            yield Slice(number, held, known)
            held = [earlier for earlier in held if earlier.times[-1] >= held[-1].times[-1] - early]
            number, known = number + 1, len(held)
        held.append(window)
    if len(held) > known:
        yield Slice(number, held, known)


class SliceTracks(NamedTuple):
    """Tracks of a slice, under ids of its own."""

    number: int
    frame: pd.DataFrame
    """Of its own windows."""
    border: pd.DataFrame
    """After the last window of the slice before."""
    ends: Array
    """Times of its own windows, seconds."""
    sizes: Array
    early: Array
    """The track of each plot of the windows before, -1 for none."""
    tracks: Array
    """The same of its own."""
    sure: Array
    """Whether these were confirmed."""
    known: Array
    """Aircraft (-2: not known), code and address of its own plots, (n, 3)."""
    odd: tuple[OddIdentity, ...] = ()
    """Identities that cannot all be right."""


class TrackSlice:
    """Tracks slices, in any process, by a tracker before its first step; `origin` is that of `TrackTable`."""

    def __init__(self, tracker: Tracker, confirmed: bool, origin: Origin | None = None) -> None:
        self._tracker, self._confirmed, self._first = tracker, confirmed, tracker.state
        self._origin = origin

    def __call__(self, part: Slice) -> SliceTracks | tuple[int, str]:
        """Track a slice; returns its number and one line where it cannot be tracked."""
        try:
            return self._tracked(part)
        except AssocError as error:
            return part.number, str(error)

    def _tracked(self, part: Slice) -> SliceTracks:
        self._tracker.state = self._first
        tables = {inside: TrackTable(self._origin) for inside in (True, False)}
        done: list[Followed] = []
        for number, followed in enumerate(follow(self._tracker, part.windows)):
            done.append(followed)
            if number >= part.early - 1:
                tables[number >= part.early].add(*followed.listed(self._confirmed))
        if len(done) < len(part.windows):
            # the end was asked for: half a slice is none
            raise KeyboardInterrupt
        own = done[part.early :]
        none = np.zeros(0, dtype=np.int64)
        return SliceTracks(
            part.number,
            tables[True].to_frame(),
            tables[False].to_frame(),
            np.array([f.step.time for f in own]),
            np.array([len(f.window) for f in own]),
            np.concatenate([none, *(f.tracks for f in done[: part.early])]),
            np.concatenate([f.tracks for f in own]),
            np.concatenate([f.sure for f in own]),
            np.concatenate([known_of(f.window) for f in own]),
            self._tracker.odd_identities,
        )


class Stitching:
    """Gives the tracks of slices, one after the other, their ids in the whole recording."""

    def __init__(self) -> None:
        self._next = 1
        self._before: SliceTracks | None = None
        self.odd_identities: list[OddIdentity] = []
        """Identities that cannot all be right, each once."""

    def add(self, part: SliceTracks) -> SliceTracks:
        """Return the next slice with ids of the whole; after a missing one all its tracks are new."""
        before = self._before
        if before is not None and before.number + 1 != part.number:
            before = None
        same = {} if before is None else _same(before.tracks, part.early)
        found = np.unique(np.concatenate([part.tracks, part.early, part.frame.track_id, part.frame.parent]))
        names: dict[int, int] = {-1: -1, 0: 0, **same}
        for local in found[found > 0].tolist():
            if local not in names:
                names[local] = self._next
                self._next += 1
        frame = part.frame.assign(
            track_id=part.frame.track_id.map(names).astype(np.int64),
            parent=part.frame.parent.map(names).astype(np.int64),
        )
        if before is not None and len(before.frame):
            frame = _continued(frame, before.frame, part.border, same)
        tracks = np.array([names[local] for local in part.tracks.tolist()], dtype=np.int64)
        # of tracks that this slice shows alone
        shown, known = {*part.tracks.tolist()}, {odd.key for odd in self.odd_identities}
        odd = (found.named(names.__getitem__) for found in part.odd if shown >= {*found.tracks})
        self.odd_identities += [found for found in odd if found.key not in known]
        self._before = part._replace(frame=frame, tracks=tracks)
        return self._before


def _same(before: Array, early: Array) -> dict[int, int]:
    """Tracks of a slice that are those of the slice before, by the tracks that both gave to the same plots."""
    count = min(len(before), len(early))
    pairs = np.stack([early[len(early) - count :], before[len(before) - count :]], axis=1)
    pairs, shared = np.unique(pairs[(pairs > 0).all(axis=1)], axis=0, return_counts=True)
    if not len(pairs):
        return {}
    (mine, first), (theirs, second) = (np.unique(column, return_inverse=True) for column in pairs.T)
    problem = AssignmentProblem(
        np.stack([first, second], axis=1) + 1, -shared.astype(np.float64), [len(mine), len(theirs)]
    )
    chosen = assign(problem, "exact").tuples
    chosen = chosen[(chosen > 0).all(axis=1)] - 1
    return dict(zip(mine[chosen[:, 0]].tolist(), theirs[chosen[:, 1]].tolist(), strict=True))


def _continued(frame: pd.DataFrame, before: pd.DataFrame, border: pd.DataFrame, same: dict[int, int]) -> pd.DataFrame:
    """Tracks that come over the border keep their start, and count on."""
    last = before[before.time == before.time.iloc[-1]].set_index("track_id")
    begin = border.assign(track_id=border.track_id.map(same)).dropna(subset="track_id").set_index("track_id")
    both = last.index.intersection(begin.index)
    rows = frame.track_id.isin(both)
    of = frame.track_id[rows]
    frame = frame.copy()
    frame.loc[rows, "started"] = of.map(last.started)
    for column in _RUNNING:
        if column in frame and column in last and column in begin:
            more = last.loc[both, column] - begin.loc[both, column]
            frame.loc[rows, column] += of.map(more).astype(frame[column].dtype)
    return frame
