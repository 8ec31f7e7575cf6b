"""Tracks as a table: one row for each track and scan, the columns of tracks.csv."""

from __future__ import annotations

import math
import os
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from assoc._files.tables import csv_text, escaped
from assoc._system.interrupts import end_is_asked
from assoc._system.wrong_types import explains_wrong_types
from assoc._text.shown import Shown
from assoc._types import Array
from assoc.exports.maps import FOLLOWED_WITHIN, coordinates, followed_targets
from assoc.metrics.trajectories import Trajectories, last_at_each_instant
from assoc.scene.geodesy import Origin
from assoc.scene.scene import Scene
from assoc.tracking.filter_choice import open_heights
from assoc.tracking.quality import Qualities
from assoc.tracking.records.identity_evidence import address_text
from assoc.tracking.records.track import Decision, Track, TrackColumns
from assoc.tracking.tracker import Tracker

if TYPE_CHECKING:
    import pandas as pd


COLUMNS = (
    "track_id", "time", "x", "y", "z", "vx", "vy", "vz", "confirmed", "score", "hits", "started", "last_detection",
    "sigma_x", "sigma_y", "sigma_z", "existence", "speed", "heading", "altitude", "status",
    "parent",
)  # fmt: skip
"""Columns of a table of tracks: metres, m/s, seconds; sigmas are standard deviations of the position.

Speed and heading are those of the horizontal velocity (equations 3.5 to 3.8 of the thesis on clustering time windows,
of the filter's estimate and not from plot to plot), the heading in degrees, clockwise from +y: with y to the north a
compass heading."""


# counts that wait to be sorted together
_ROWS = 20_000
# types of columns that are no floats
_KINDS: dict[str, type] = {"track_id": np.int64, "confirmed": np.bool_, "hits": np.int64, "status": np.str_,
                           "parent": np.int64}  # fmt: skip


@explains_wrong_types
class TrackTable(Shown):
    """Collects tracks of scan after scan.

    It grows with every scan; for endless recordings write it in parts.

    Parameters
    ----------
    origin : tuple of latitude, longitude, height, optional
        `assoc.Scene.origin` of the scene: the table then has latitude and longitude in degrees, and altitudes
        above the ellipsoid.

    Attributes
    ----------
    targets : dict of int to str
        Name of the target that each track followed most, where the truth has names, else address or code: column
        target.
    identities : dict of int to (str, str)
        Address (hexadecimal; of a ship its MMSI) and Mode 3/A code (octal) that most plots of each track had, empty
        where none had one: columns address_hex and mode3_oct.
    """

    def __repr__(self) -> str:
        return f"TrackTable({len(np.unique(self._column('track_id')))} tracks, {len(self)} rows)"

    def __init__(self, origin: Origin | None = None) -> None:
        self.origin = origin
        self.targets: dict[int, str] = {}
        self.identities: dict[int, tuple[str, str]] = {}
        self._known = _Names(), _Names()
        self._parts: list[dict[str, Array]] = []

    def add(
        self,
        tracks: Iterable[Track] | TrackColumns,
        positions: Sequence[int] = (0, 1, 2),
        altitudes: Mapping[int, float] | None = None,
        qualities: Qualities | None = None,
        truth: Array | None = None,
    ) -> None:
        """Add the tracks of one scan.

        Parameters
        ----------
        tracks : iterable of Track, or TrackColumns
        positions : sequence of int
            Indices of x, y (and z) in the state: ``filter.motion.position``.
        altitudes : mapping of track id to metres, optional
            Altitudes by transponders; without them the altitude is z, or NaN for planar tracks.
        qualities : Qualities, optional
            Of the tracker: the table then has the columns nis, consistent and hits_1, hits_2, ..., by sensor.
        truth : array (n, 3), optional
            Positions of all targets at this time: the table then has the column nees, the normalised estimation error
            squared of the position over its number of components, by the nearest target; NaN if none is within 1 km.
        """
        if not isinstance(tracks, TrackColumns):
            listed = list(tracks)
            if not listed:
                return
            tracks = TrackColumns.of(listed)
        count, axes = len(tracks.track_id), list(positions)
        if not count:
            return
        sigmas = np.zeros((count, 3))
        sigmas[:, : len(axes)] = np.sqrt(np.diagonal(tracks.covariance, axis1=1, axis2=2)[:, axes])
        east, north = tracks.velocity[:, 0], tracks.velocity[:, 1]
        if altitudes is not None:
            heights = np.array([altitudes.get(number, math.nan) for number in tracks.track_id.tolist()])
        else:
            heights = tracks.position[:, 2] if len(axes) > 2 else np.full(count, math.nan)
        values = (
            tracks.track_id, tracks.time, *tracks.position.T, *tracks.velocity.T, tracks.confirmed, tracks.score,
            tracks.hits, tracks.started, tracks.last_detection, *sigmas.T, tracks.existence, np.hypot(east, north),
            np.mod(np.degrees(np.arctan2(east, north)), 360.0), heights, tracks.status, tracks.parent,
        )  # fmt: skip
        part = dict(zip(COLUMNS, values, strict=True))
        if qualities is not None:
            nis, consistent, hits = qualities.of(tracks.track_id)
            part |= {"nis": nis, "consistent": consistent}
            part |= {f"hits_{s}": column for s, column in enumerate(hits.T, 1)}
        if truth is not None:
            both = zip(tracks.mean, tracks.covariance, strict=True)
            part["nees"] = np.array([_nees(*state, positions, truth) for state in both])
        self._parts.append(part)

    def _column(self, name: str) -> Array:
        """One of `COLUMNS` of all rows."""
        parts = [part[name] for part in self._parts]
        return np.concatenate(parts) if parts else np.zeros(0, _KINDS.get(name, np.float64))

    def name_targets(self, scene: Scene) -> None:
        """Find the target that each track followed most, where the truth of its scene has names."""
        if scene.truth is not None and scene.truth.names:
            self.targets = followed_targets(*self.arrays(), scene)

    def count_identities(self, ids: Array, known: Array) -> None:
        """Count the codes and addresses (n, 2) of measurements by the tracks (n,) that took them."""
        taken = ids > 0
        for kind, column in zip(self._known, (known[:, 1], known[:, 0]), strict=True):
            rows = np.flatnonzero(taken & (column != 0))
            kind.count(ids[rows], column[rows])

    def name_by_identities(self, living: Collection[int] = ()) -> None:
        """Take the codes and addresses that were counted most, of all tracks but the living; their counts then go."""
        addresses, codes = (kind.most(living) for kind in self._known)
        for number in dict.fromkeys([*addresses, *codes]):
            address = address_text(addresses[number]) if number in addresses else ""
            code = f"{codes[number]:04o}" if number in codes else ""
            self.identities[number] = address, code
            self.targets.setdefault(number, address or code)

    def take_names(self, other: TrackTable) -> None:
        """Take targets and identities of a table of the same tracks."""
        self.targets, self.identities = other.targets, other.identities

    def __len__(self) -> int:
        return sum(len(part["track_id"]) for part in self._parts)

    def to_frame(self) -> pd.DataFrame:
        """Return the table; see `COLUMNS`."""
        import pandas as pd

        kinds = {name: _KINDS.get(name, np.float64) for name in COLUMNS} | {"status": "str"}
        frame = pd.DataFrame({name: self._column(name) for name in COLUMNS}).astype(kinds)
        if self.origin is not None:
            latitude, longitude, height = coordinates(frame[["x", "y", "z"]].to_numpy(dtype=float), self.origin).T
            # planar tracks have no z; altitudes by transponders stay
            frame["altitude"] = np.where(frame["sigma_z"] > 0, height, frame["altitude"])
            frame = frame.assign(latitude=latitude, longitude=longitude)
        for name in dict.fromkeys(name for part in self._parts for name in part if name not in COLUMNS):
            frame[name] = np.concatenate(
                [part[name] if name in part else np.full(len(part["track_id"]), np.nan) for part in self._parts]
            )
        return self.with_names(frame)

    def with_names(self, frame: pd.DataFrame) -> pd.DataFrame:
        """The frame with the columns of targets and identities, where there are any."""
        ids, of = np.unique(frame["track_id"].to_numpy(), return_inverse=True)
        if self.targets:
            frame = frame.assign(target=_texts([self.targets.get(number, "") for number in ids.tolist()])[of])
        if self.identities:
            names = [self.identities.get(number, ("", "")) for number in ids.tolist()]
            addresses, codes = (_texts([identity[kind] for identity in names])[of] for kind in (0, 1))
            frame = frame.assign(address_hex=addresses, mode3_oct=codes)
        return frame

    def to_csv(self, path: str | os.PathLike[str]) -> None:
        """Write the table as CSV; the file appears whole or not at all."""
        from assoc._files.output import write_text

        frame = self.to_frame()
        if self.targets:
            frame["target"] = escaped(frame["target"])
        write_text(path, csv_text(frame))

    def to_parquet(self, path: str | os.PathLike[str]) -> None:
        """Write the table as Parquet; the file appears whole or not at all.

        Raises
        ------
        MissingExtraError
            pyarrow is not installed.
        """
        from assoc._files.output import write_atomically
        from assoc._system.imports import check_extra

        check_extra("pyarrow", "parquet")
        frame = self.to_frame()
        write_atomically(path, lambda file: frame.to_parquet(file, index=False))

    def inconsistent(self) -> dict[int, float]:
        """Tracks whose NIS was far above its mean at any time, and the largest one of each."""
        found: dict[int, float] = {}
        for part in self._parts:
            if "consistent" not in part:
                continue
            rows = np.flatnonzero(~part["consistent"])
            for number, nis in zip(part["track_id"][rows].tolist(), part["nis"][rows].tolist(), strict=True):
                found[number] = max(found.get(number, 0.0), nis)
        return found

    def confirmed_ids(self) -> set[int]:
        """Ids of tracks that were confirmed at any time."""
        return {*self._column("track_id")[self._column("confirmed")].tolist()}

    def arrays(self, *, confirmed: bool = True) -> tuple[Array, Array, Array]:
        """Times (n,), track ids (n,) and positions (n, 3) of confirmed tracks or of all, for metrics.

        Of several scans at one time, the last row of each track.
        """
        rows = self._column("confirmed") | (not confirmed)
        times, ids = self._column("time")[rows], self._column("track_id")[rows]
        positions = np.stack([self._column(name)[rows] for name in ("x", "y", "z")], axis=1)
        kept = last_at_each_instant(times, ids)
        return times[kept], ids[kept], positions[kept]


def against_truth(scene: Scene, tracks: Trajectories) -> tuple[Trajectories, Trajectories]:
    """The truth of a scene and tracks as metrics compare them: horizontally where heights are open (`open_heights`)."""
    both = Trajectories.from_scene(scene), tracks
    if not open_heights(scene.sensors):
        return both
    truth, found = (Trajectories(paths.times, paths.ids, paths.positions[:, :2]) for paths in both)
    return truth, found


def _texts(values: list[str]) -> Array:
    """Texts as objects, (n,)."""
    found = np.empty(len(values), dtype=object)
    found[:] = values
    return found


class _Names:
    """How often each track was known by each number."""

    def __init__(self) -> None:
        # track, number, how often, in the order in which the pairs came first
        self._counted = np.zeros((0, 3), dtype=np.int64)
        self._new: list[Array] = []
        self._waiting = 0

    def count(self, ids: Array, known: Array) -> None:
        """Count numbers (n,) of tracks (n,)."""
        self._new.append(np.stack([ids, known, np.ones_like(ids)], axis=1))
        self._waiting += len(ids)
        # so that it is sorted anew only when it has grown by a share of its length
        if self._waiting > _ROWS + len(self._counted):
            self._settle()

    def _settle(self) -> None:
        every = np.concatenate([self._counted, *self._new])
        _, first, of = np.unique(every[:, :2], axis=0, return_index=True, return_inverse=True)
        counts = np.bincount(of.ravel(), weights=every[:, 2]).astype(np.int64)
        order = np.argsort(first)
        self._counted = np.column_stack([every[first, :2], counts])[order]
        self._new, self._waiting = [], 0

    def most(self, living: Collection[int]) -> dict[int, int]:
        """The number by which each track but the living was known most; of equals the one that came first."""
        self._settle()
        kept = np.isin(self._counted[:, 0], np.array([*living], dtype=np.int64))
        counted, self._counted = self._counted[~kept], self._counted[kept]
        # the last one of a track counts
        order = np.argsort(counted[::-1, 2], kind="stable")
        return {track: number for track, number, _ in counted[::-1][order].tolist()}


def _nees(mean: Array, covariance: Array, positions: Sequence[int], truth: Array) -> float:
    """Normalised estimation error squared over its components; NaN if no target is near."""
    axes = list(positions)
    off = truth[:, : len(axes)] - mean[axes]
    distance = np.linalg.norm(off, axis=1)
    if not (distance < FOLLOWED_WITHIN).any():
        return math.nan
    nearest = off[np.argmin(distance)]
    return float(nearest @ np.linalg.solve(covariance[np.ix_(axes, axes)], nearest)) / len(axes)


@explains_wrong_types
def track_scene(
    tracker: Tracker,
    scene: Scene,
    *,
    confirmed: bool = True,
    scans: Iterable[int] | None = None,
    identities: Sequence[Sequence[Array]] | None = None,
) -> tuple[TrackTable, list[Decision]]:
    """Run a tracker over the scans of a scene.

    Parameters
    ----------
    tracker : Tracker
    scene : Scene
    confirmed : bool
        Whether only tracks that are confirmed and not lost are listed (`Track.reported`).
    scans : iterable of int, optional
        Numbers of the scans; by default all.
    identities : sequence over scans of sequences over sensors of arrays (n, 2), optional
        Mode 3/A code and address of each measurement, 0 where there is none: tracks get the name that most of their
        measurements had, and trackers made with `identity` associate by them.

    Returns
    -------
    table, decisions
        The tracks after each scan, and the final decisions, including those still open at the end.
    """
    table = TrackTable(scene.origin)
    decisions: list[Decision] = []
    qualities = Qualities(len(tracker.sensors))
    for k in range(scene.num_scans) if scans is None else scans:
        scan, before = scene.scan(k), tracker.state
        try:
            known = None if identities is None else identities[k]
            step = tracker.step(scan.time, scan.measurements, scan.times, scan.sectors, known)
        except KeyboardInterrupt:
            if end_is_asked():
                # the tracker is as it was before this scan
                break
            raise
        decisions += step.final
        for ids, codes in zip(step.assigned, known or (), strict=False):
            table.count_identities(ids, codes)
        qualities.after(tracker, before, step, scan.measurements, scan.times)
        listed = tracker.track_columns()
        listed = listed.rows(listed.reported) if confirmed else listed
        truth = None if scene.truth is None else scene.truth.positions[k]
        table.add(listed, tracker.filter.motion.position, qualities=qualities, truth=truth)
    table.name_targets(scene)
    table.name_by_identities()
    return table, [*decisions, *tracker.flush()]
