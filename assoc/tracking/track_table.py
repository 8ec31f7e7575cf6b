"""Tracks as a table: one row for each track and scan, the columns of tracks.csv."""

from __future__ import annotations

import math
import os
import pickle
import tempfile
import weakref
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from assoc._files.tables import table_writer
from assoc._system.door import door, doors
from assoc._system.interrupts import end_is_asked
from assoc._text.shown import Shown
from assoc._types import Array
from assoc.exports.maps import FOLLOWED_WITHIN, coordinates, followed_targets
from assoc.metrics.trajectories import Trajectories, last_at_each_instant
from assoc.scene.geodesy import Origin
from assoc.scene.scene import Scene
from assoc.tracking.filter_choice import open_heights
from assoc.tracking.quality import Qualities
from assoc.tracking.track import Decision, Track
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


# rows that wait to be written together
_ROWS = 20_000


@doors
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
        Address (hexadecimal) and Mode 3/A code (octal) that most plots of each track had, empty where none had one:
        columns address_hex and mode3_oct.
    """

    def __repr__(self) -> str:
        return f"TrackTable({len({row[0] for row in self._rows})} tracks, {len(self._rows)} rows)"

    def __init__(self, origin: Origin | None = None) -> None:
        self.origin = origin
        self.targets: dict[int, str] = {}
        self.identities: dict[int, tuple[str, str]] = {}
        self._known: dict[int, tuple[Counter[str], Counter[str]]] = {}
        self._rows: list[tuple[Any, ...]] = []
        self._quality: list[dict[str, Any]] = []

    def add(
        self,
        tracks: Iterable[Track],
        positions: Sequence[int] = (0, 1, 2),
        altitudes: Mapping[int, float] | None = None,
        qualities: Qualities | None = None,
        truth: Array | None = None,
    ) -> None:
        """Add the tracks of one scan.

        Parameters
        ----------
        tracks : iterable of Track
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
        listed = list(tracks)
        if not listed:
            return
        axes, sigmas = list(positions), np.zeros((len(listed), 3))
        variances = np.diagonal(np.stack([track.covariance for track in listed]), axis1=1, axis2=2)
        sigmas[:, : len(axes)] = np.sqrt(variances[:, axes])
        for track, sigma in zip(listed, sigmas.tolist(), strict=True):
            x, y, z = track.position.tolist()
            vx, vy, vz = track.velocity.tolist()
            altitude = z if altitudes is None and len(axes) > 2 else math.nan
            speed, heading = math.hypot(vx, vy), math.degrees(math.atan2(vx, vy)) % 360.0
            altitude = altitude if altitudes is None else altitudes.get(track.track_id, math.nan)
            self._rows.append((
                track.track_id, track.time, x, y, z, vx, vy, vz, track.confirmed, track.score, track.hits,
                track.started, track.last_detection, *sigma, track.existence, speed, heading, altitude, track.status,
                track.parent,
            ))  # fmt: skip
            quality: dict[str, Any] = {}
            if qualities is not None:
                one = qualities.of_track(track.track_id)
                quality = {"nis": one.nis, "consistent": one.consistent}
                quality |= {f"hits_{s}": count for s, count in enumerate(one.hits.tolist(), 1)}
            if truth is not None:
                quality["nees"] = _nees(track, positions, truth)
            self._quality.append(quality)

    def name_targets(self, scene: Scene) -> None:
        """Find the target that each track followed most, where the truth of its scene has names."""
        if scene.truth is not None and scene.truth.names:
            self.targets = followed_targets(*self.arrays(), scene)

    def count_identities(self, ids: Array, known: Array) -> None:
        """Count the codes and addresses (n, 2) of measurements by the tracks (n,) that took them."""
        for number, (code, address) in zip(ids.tolist(), known.tolist(), strict=True):
            for kind, known_as in enumerate((f"{address:06x}" if address else "", f"{code:04o}" if code else "")):
                if known_as and number > 0:
                    self._known.setdefault(number, (Counter(), Counter()))[kind][known_as] += 1

    def name_by_identities(self) -> None:
        """Take the codes and addresses that were counted most."""
        for number, counted in self._known.items():
            address, code = ("".join(name for name, _ in one.most_common(1)) for one in counted)
            self.identities[number] = address, code
            self.targets.setdefault(number, address or code)

    def take_names(self, other: TrackTable) -> None:
        """Take targets and identities of a table of the same tracks."""
        self.targets, self.identities = other.targets, other.identities

    def __len__(self) -> int:
        return len(self._rows)

    def to_frame(self) -> pd.DataFrame:
        """Return the table; see `COLUMNS`."""
        import pandas as pd

        frame = pd.DataFrame.from_records(self._rows, columns=list(COLUMNS))
        kinds = dict.fromkeys(COLUMNS, "float64") | {
            "track_id": "int64",
            "confirmed": "bool",
            "hits": "int64",
            "status": "str",
            "parent": "int64",
        }
        frame = frame.astype(kinds)
        if self.origin is not None:
            latitude, longitude, height = coordinates(frame[["x", "y", "z"]].to_numpy(dtype=float), self.origin).T
            # planar tracks have no z; altitudes by transponders stay
            frame["altitude"] = np.where(frame["sigma_z"] > 0, height, frame["altitude"])
            frame = frame.assign(latitude=latitude, longitude=longitude)
        if any(self._quality):
            frame = frame.join(pd.DataFrame.from_records(self._quality))
        return self.with_names(frame)

    def with_names(self, frame: pd.DataFrame) -> pd.DataFrame:
        """The frame with the columns of targets and identities, where there are any."""
        ids = frame["track_id"].tolist()
        if self.targets:
            frame = frame.assign(target=[self.targets.get(number, "") for number in ids])
        if self.identities:
            names = [self.identities.get(number, ("", "")) for number in ids]
            addresses, codes = zip(*names, strict=True) if names else ((), ())
            frame = frame.assign(address_hex=addresses, mode3_oct=codes)
        return frame

    def to_csv(self, path: str | os.PathLike[str]) -> None:
        """Write the table as CSV; the file appears whole or not at all."""
        from assoc._files.output import write_text
        from assoc._text.plain import spreadsheet_text

        frame = self.to_frame()
        if self.targets:
            frame["target"] = frame["target"].map(spreadsheet_text)
        write_text(path, frame.to_csv(index=False))

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
        for row, quality in zip(self._rows, self._quality, strict=True):
            if not quality.get("consistent", True):
                found[row[0]] = max(found.get(row[0], 0.0), quality["nis"])
        return found

    def confirmed_ids(self) -> set[int]:
        """Ids of tracks that were confirmed at any time."""
        return {row[0] for row in self._rows if row[8]}

    def arrays(self, *, confirmed: bool = True) -> tuple[Array, Array, Array]:
        """Times (n,), track ids (n,) and positions (n, 3) of confirmed tracks or of all, for metrics.

        Of several scans at one time, the last row of each track.
        """
        rows = [row for row in self._rows if row[8] or not confirmed]
        times = np.array([row[1] for row in rows], dtype=np.float64)
        ids = np.array([row[0] for row in rows], dtype=np.int64)
        positions = np.array([row[2:5] for row in rows], dtype=np.float64).reshape(-1, 3)
        kept = last_at_each_instant(times, ids)
        return times[kept], ids[kept], positions[kept]


class LongTable:
    """A `TrackTable` that grows on the disk, in a temporary file: names of tracks are known at the end alone.

    Parameters
    ----------
    origin : tuple of latitude, longitude, height, optional
        As of `TrackTable`.
    """

    def __init__(self, origin: Origin | None = None) -> None:
        self._origin, self._table, self.names = origin, TrackTable(origin), TrackTable()
        self._file = tempfile.TemporaryFile()
        weakref.finalize(self, self._file.close)
        self._ids: set[int] = set()
        self._inconsistent: dict[int, float] = {}
        self._rows = 0

    def __len__(self) -> int:
        return self._rows + len(self._table)

    def add(self, *arguments: Any) -> None:
        """Add the tracks of a scan; see `TrackTable.add`."""
        self._table.add(*arguments)
        if len(self._table) >= _ROWS:
            self._put_away()

    def finish(self) -> None:
        """Name the tracks; to be called when all are there."""
        self.names.name_by_identities()
        self._put_away()

    def _put_away(self) -> None:
        table, self._table = self._table, TrackTable(self._origin)
        self.add_frame(table.to_frame())

    def add_frame(self, frame: pd.DataFrame) -> None:
        """Add rows of a table."""
        pickle.dump(frame, self._file, pickle.HIGHEST_PROTOCOL)
        self._rows += len(frame)
        if len(frame):
            self._ids |= {*frame.track_id[frame.confirmed].tolist()}
            wrong = frame[~frame.consistent]
            for track, nis in zip(wrong.track_id.tolist(), wrong.nis.tolist(), strict=True):
                self._inconsistent[track] = max(self._inconsistent.get(track, 0.0), nis)

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write all rows: Parquet if the name ends so, else CSV."""
        from assoc._text.plain import spreadsheet_text

        end = self._file.tell()
        self._file.seek(0)
        with table_writer(path) as writer:
            while self._file.tell() < end:
                frame = self.names.with_names(pickle.load(self._file))
                if "target" in frame and not writer.parquet:
                    frame["target"] = frame["target"].map(spreadsheet_text)
                writer.add(frame)

    def confirmed_ids(self) -> set[int]:
        """As of `TrackTable`."""
        return self._ids

    def inconsistent(self) -> dict[int, float]:
        """As of `TrackTable`."""
        return self._inconsistent


def against_truth(scene: Scene, tracks: Trajectories) -> tuple[Trajectories, Trajectories]:
    """The truth of a scene and tracks as metrics compare them: horizontally where heights are open (`open_heights`)."""
    both = Trajectories.from_scene(scene), tracks
    if not open_heights(scene.sensors):
        return both
    truth, found = (Trajectories(one.times, one.ids, one.positions[:, :2]) for one in both)
    return truth, found


def _nees(track: Track, positions: Sequence[int], truth: Array) -> float:
    """Normalised estimation error squared over its components; NaN if no target is near."""
    axes = list(positions)
    off = truth[:, : len(axes)] - track.mean[axes]
    distance = np.linalg.norm(off, axis=1)
    if not (distance < FOLLOWED_WITHIN).any():
        return math.nan
    nearest = off[np.argmin(distance)]
    return float(nearest @ np.linalg.solve(track.covariance[np.ix_(axes, axes)], nearest)) / len(axes)


@door
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
        listed = (track for track in tracker.tracks if track.reported or not confirmed)
        truth = None if scene.truth is None else scene.truth.positions[k]
        table.add(listed, tracker.filter.motion.position, qualities=qualities, truth=truth)
    table.name_targets(scene)
    table.name_by_identities()
    return table, [*decisions, *tracker.flush()]
