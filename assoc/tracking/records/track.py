"""Results of trackers: tracks, decisions and steps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal, NamedTuple

import numpy as np

from assoc._text.shown import Shown
from assoc._text.times import moment
from assoc._types import Array

Status = Literal["tentative", "confirmed", "coasting", "lost"]

# one scan without a detection by several sensors may be a shadow or P_d declared too high
_LOST_AFTER = 2
# for a ghost of bearings a scan without them is the end
_KNOWN_AFTER = 5


@dataclass(frozen=True, eq=False, repr=False)
class Track(Shown):
    """One target as a tracker sees it at one time.

    Attributes
    ----------
    track_id : int
        From 1, never reused.
    time : float
        Time of the state, seconds.
    mean, covariance : arrays (n,), (n, n)
        In the order of the motion model.
    position, velocity : arrays (3,)
        Metres, m/s; components that the motion model lacks are 0.
    confirmed : bool
    score : float
        Log likelihood ratio against false alarms.
    hits : int
        Scans (of any sensor) in which it was detected.
    started, last_detection : float
        Seconds.
    existence : float
        Probability that the target is still there.
    missed : int
        Scans in a row in which dwells covered it and none detected it.
    hidden : float
        Seconds since the last detection for which no sensor could see it.
    parent : int
        Track that it parted from, where one target became two; 0 for none.
    """

    track_id: int
    time: float
    mean: Array
    covariance: Array
    position: Array
    velocity: Array
    confirmed: bool
    score: float
    hits: int
    started: float
    last_detection: float
    existence: float
    missed: int = 0
    hidden: float = 0.0
    parent: int = 0

    @property
    def status(self) -> Status:
        """Where it is in its life.

        "tentative"; "confirmed"; "coasting": confirmed, and now missed or out of view; "lost": probably gone (existence
        below 0.5), after five scans with a detection not before two missed in a row, or at a detection that leaves
        it unlikely, as in dense clutter.
        """
        if not self.confirmed:
            return "tentative"
        known = 0 < self.missed < _LOST_AFTER and self.hits >= _KNOWN_AFTER
        if self.existence < 0.5 and not known:
            return "lost"
        return "coasting" if self.missed or self.hidden else "confirmed"

    @property
    def reported(self) -> bool:
        """Whether it is confirmed and not lost."""
        return self.status in ("confirmed", "coasting")

    def __repr__(self) -> str:
        place = ", ".join(f"{x:.6g}" for x in self.position)
        return f"Track({self.track_id}, {self.status}, ({place}) m at {moment(self.time)}, score {self.score:.4g})"


class TrackColumns(NamedTuple):
    """T tracks as columns: the fields of `Track`, an array (T, ...) each; states of different widths are no columns."""

    track_id: Array
    time: Array
    mean: Array
    covariance: Array
    position: Array
    velocity: Array
    confirmed: Array
    score: Array
    hits: Array
    started: Array
    last_detection: Array
    existence: Array
    missed: Array
    hidden: Array
    parent: Array

    @staticmethod
    def of(tracks: Sequence[Track]) -> TrackColumns:
        """The columns of one or more tracks."""
        return TrackColumns(*(np.array([getattr(track, name) for track in tracks]) for name in TrackColumns._fields))

    @property
    def status(self) -> Array:
        """`Track.status` of each, str (T,)."""
        unseen = (self.missed > 0) | (self.hidden != 0.0)
        return np.select([~self.confirmed, self._lost, unseen], ["tentative", "lost", "coasting"], "confirmed")

    @property
    def _lost(self) -> Array:
        known = (self.missed > 0) & (self.missed < _LOST_AFTER) & (self.hits >= _KNOWN_AFTER)
        return (self.existence < 0.5) & ~known

    @property
    def reported(self) -> Array:
        """`Track.reported` of each, bool (T,)."""
        return self.confirmed & ~self._lost

    def rows(self, chosen: Array) -> TrackColumns:
        """Some of the tracks."""
        return TrackColumns(*(column[chosen] for column in self))


@dataclass(frozen=True, eq=False, repr=False)
class Decision(Shown):
    """The track of each measurement of one scan.

    Attributes
    ----------
    scan : int
        Number of the step, from 0.
    time : float
        Its time, seconds.
    assigned : tuple over sensors of int64 arrays (n_s,)
        Track of each measurement; 0 is a false alarm.
    confirmed : tuple over sensors of bool arrays (n_s,)
        Whether that track was confirmed at the time of the decision.
    """

    scan: int
    time: float
    assigned: tuple[Array, ...]
    confirmed: tuple[Array, ...]

    def __repr__(self) -> str:
        sizes = " + ".join(str(len(ids)) for ids in self.assigned)
        tracks = len({int(i) for ids in self.assigned for i in ids if i > 0})
        return (
            f"{type(self).__name__}(scan {self.scan}, t = {moment(self.time)}: {sizes} measurements, {tracks} tracks)"
        )


@dataclass(frozen=True, eq=False, repr=False)
class Step(Decision):
    """Result of a tracker's step; for a tracker that defers decisions, its present best decision.

    Attributes
    ----------
    final : tuple of Decision
        Scans decided for good in this step: this one, for trackers that decide at once; for multiple
        hypothesis trackers the scan that left the window, if any.
    ended : int64 array
        Confirmed tracks deleted in this step.
    merged : int64 array (K, 2)
        Confirmed tracks that were found to have the target of an older one, and that one; see
        `assoc.tracking.stages.merging`. They are in `ended`, too.
    late, refused : int
        Measurements older than the last scan that were used, and those too old for that; see
        `assoc.tracking.LatePlots`.
    gap : float
        How far the score of the association may be from the best one's, relative, in the worst assignment problem of
        the step; 0: all were proved to be best. First scans of thousands of targets are left with about 0.001.
    """

    final: tuple[Decision, ...] = ()
    ended: Array = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    merged: Array = field(default_factory=lambda: np.zeros((0, 2), dtype=np.int64))
    late: int = 0
    refused: int = 0
    gap: float = 0.0


def owners(rows: Array, values: Array, sizes: Array) -> list[Array]:
    """For each measurement of each sensor, the value (int64) of the track that took it, 0 if none did.

    Parameters
    ----------
    rows : int array (T, S)
        Measurements of the tracks, 1-based, 0: none.
    values : int64 array (T,)
    sizes : int array (S,)
        Measurements of each sensor.
    """
    found = []
    for s, size in enumerate(sizes.tolist()):
        values_of = np.zeros(size + 1, dtype=np.int64)
        values_of[rows[:, s]] = values
        found.append(values_of[1:])
    return found


def rows_of_ids(ids: Array, wanted: Array) -> Array:
    """Rows of some ids (K,) among those of T tracks, ascending (T,); T where there is none."""
    rows = np.searchsorted(ids, wanted)
    return np.where(ids.take(rows, mode="clip") == wanted, rows, len(ids)) if len(ids) else rows


def among(ids: Array, others: Array) -> Array:
    """Which ids are among others, as `np.isin` says, which takes many times as long for few of them."""
    return np.asarray(rows_of_ids(np.sort(others), ids) < len(others))


def taken_by(ids: Array, assigned: Sequence[Array]) -> Array:
    """1-based measurements of tracks by their ascending ids (T,), 0: none, int64 (T + 1, S); the last row is nobody's.

    The reverse of `owners`.
    """
    rows = np.zeros((len(ids) + 1, len(assigned)), dtype=np.int64)
    for s, taken in enumerate(assigned):
        rows[rows_of_ids(ids, taken), s] = np.arange(len(taken)) + 1
    rows[-1] = 0
    return rows


def decision(scan: int, time: float, assigned: Sequence[Array], confirmed_ids: Array) -> Decision:
    """Make a decision from track ids and the ids of confirmed tracks."""
    ids = tuple(np.asarray(array, dtype=np.int64) for array in assigned)
    return Decision(scan, time, ids, tuple(among(array, confirmed_ids) & (array > 0) for array in ids))


def renamed(step: Step, ids: Array, names: Array) -> Step:
    """The step with these names (K,) of confirmed tracks in place of ids (K,)."""
    name_of = dict(zip(ids.tolist(), names.tolist(), strict=True))
    assigned = tuple(np.array([name_of.get(i, i) for i in taken.tolist()], dtype=np.int64) for taken in step.assigned)
    confirmed = tuple(flags | np.isin(taken, names) for flags, taken in zip(step.confirmed, assigned, strict=True))
    now: dict[str, Any] = {"assigned": assigned, "confirmed": confirmed}
    final = tuple(replace(decision, **now) if decision.scan == step.scan else decision for decision in step.final)
    return replace(step, **now, final=final)
