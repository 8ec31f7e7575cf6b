"""Rows of tracks, written as the tracks end: memory does not grow with the length of a recording."""

from __future__ import annotations

import tempfile
import weakref
from typing import TYPE_CHECKING, Any

import numpy as np

from assoc._files.tables import TableWriter, escaped
from assoc._types import Array
from assoc.errors import AssocError, LimitExceededError
from assoc.scene.geodesy import Origin
from assoc.tracking.track_table import TrackTable

if TYPE_CHECKING:
    import pandas as pd


# rows of ended tracks that are written together
_ROWS = 10_000


class EndedTracks:
    """Writes the rows of a `TrackTable` track by track, each when it has ended and its name is known.

    Until then they are in a temporary file. Tracks come in the order in which they end, those that end about the same
    time by their ids, the rows of a track in the order of time.

    Parameters
    ----------
    writer : TableWriter
    origin : tuple of latitude, longitude, height, optional
        As of `TrackTable`.
    identified : bool
        Whether tracks are named by codes and addresses (`count_identities`): columns target, address_hex, mode3_oct.
    """

    def __init__(self, writer: TableWriter, origin: Origin | None, identified: bool) -> None:
        self._writer, self._origin, self._identified = writer, origin, identified
        self._table, self._names = TrackTable(origin), TrackTable(origin)
        self._file = tempfile.TemporaryFile()
        weakref.finalize(self, self._file.close)
        # where the rows of each track are in the file: first row, and how many
        self._parts: dict[int, list[tuple[int, int]]] = {}
        self._row: np.dtype[Any] = np.dtype([])
        self._count = 0
        self._before: set[int] = set()
        self._confirmed: set[int] = set()
        self._inconsistent: dict[int, float] = {}
        # of writing; after it rows are only counted
        self._error: AssocError | None = None

    def __len__(self) -> int:
        return self._count + len(self._table)

    def count_identities(self, ids: Array, known: Array) -> None:
        """As of `TrackTable`."""
        if self._identified:
            self._names.count_identities(ids, known)

    def add(self, *arguments: Any) -> None:
        """Add the tracks of a scan; see `TrackTable.add`."""
        self._table.add(*arguments)

    def add_frame(self, frame: pd.DataFrame) -> None:
        """Add rows of a table, later than those before."""
        if not len(frame):
            return
        self._confirmed |= {*frame.track_id[frame.confirmed].tolist()}
        wrong = frame[~frame.consistent] if "consistent" in frame else frame[:0].assign(nis=0.0)
        for track, nis in zip(wrong.track_id.tolist(), wrong.nis.tolist(), strict=True):
            self._inconsistent[track] = max(self._inconsistent.get(track, 0.0), nis)
        if self._error is None:
            self._store(frame)
        self._count += len(frame)

    def _store(self, frame: pd.DataFrame) -> None:
        frame = frame.sort_values("track_id", kind="stable")
        columns = {str(name): frame[name].to_numpy() for name in frame}
        columns["status"] = columns["status"].astype("S10")
        if not self._count:
            self._row = np.dtype([(name, column.dtype) for name, column in columns.items()])
        rows = np.empty(len(frame), self._row)
        for name, column in columns.items():
            rows[name] = column
        try:
            self._file.seek(0, 2)
            self._file.write(rows.tobytes())
            self._file.flush()
        except OSError as error:
            self._error = LimitExceededError(
                f"tracks cannot be kept in {tempfile.gettempdir()} ({error.strerror or error}); "
                "set TMPDIR to a folder with more room"
            )
        ids, first, counts = np.unique(columns["track_id"], return_index=True, return_counts=True)
        for track, begin, count in zip(ids.tolist(), first.tolist(), counts.tolist(), strict=True):
            self._parts.setdefault(track, []).append((self._count + begin, count))

    def end(self, living: set[int]) -> None:
        """Write the tracks that are not among the living, nor were when this was last called."""
        table, self._table = self._table, TrackTable(self._origin)
        if len(table):
            self.add_frame(table.to_frame())
        kept, self._before = living | self._before, living
        self._names.name_by_identities(kept)
        try:
            if self._error is None:
                self._write(sorted(self._parts.keys() - kept))
        except AssocError as error:
            self._error = error
        self._names.targets, self._names.identities = {}, {}

    def finish(self) -> None:
        """Write all that is left.

        Raises
        ------
        AssocError
            Tracks could not be written, now or before.
        """
        self.end(set())
        self.end(set())
        if self._error is not None:
            raise self._error
        if not self._count:
            self._writer.add(self._named(TrackTable(self._origin).to_frame()))

    def _write(self, ended: list[int]) -> None:
        parts: list[bytes] = []
        waiting = 0
        for track in ended:
            for begin, count in self._parts.pop(track):
                self._file.seek(begin * self._row.itemsize)
                parts.append(self._file.read(count * self._row.itemsize))
                waiting += count
            if waiting >= _ROWS or track == ended[-1]:
                self._writer.add(self._named(self._frame(b"".join(parts))))
                parts, waiting = [], 0

    def _frame(self, content: bytes) -> pd.DataFrame:
        import pandas as pd

        rows = np.frombuffer(content, self._row)
        frame = pd.DataFrame({name: np.ascontiguousarray(rows[name]) for name in rows.dtype.names or ()})
        texts, of = np.unique(rows["status"], return_inverse=True)
        frame["status"] = texts.astype(np.str_).astype(object)[of]
        return frame

    def _named(self, frame: pd.DataFrame) -> pd.DataFrame:
        if not self._identified:
            return frame
        frame = self._names.with_names(frame.assign(target="", address_hex="", mode3_oct=""))
        if not self._writer.parquet:
            frame["target"] = escaped(frame["target"])
        return frame

    def confirmed_ids(self) -> set[int]:
        """As of `TrackTable`."""
        return self._confirmed

    def inconsistent(self) -> dict[int, float]:
        """As of `TrackTable`."""
        return self._inconsistent
