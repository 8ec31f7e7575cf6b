"""The scans that a multiple hypothesis tracker has not decided yet, and its branches' measurements in them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from assoc._parameters import is_whole
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.scene.scan import Scan
from assoc.tracking.file import Saved
from assoc.tracking.method import Method
from assoc.tracking.records.track import Decision, owners
from assoc.tracking.records.track_batch import TrackBatch

MOST_SCANS = 1000
"""The longest window, in scans: every branch stores its history in it."""

MOST_MEASUREMENTS = 10_000_000
"""The most measurements of a sensor in a scan that a file may claim."""


class Window(NamedTuple):
    """The W open scans, the latest first, and the history of B branches in them."""

    history: Array
    """Measurements of each branch (1-based, 0 missed), int32 (B, depth * S): the last scan's sensors first."""
    times: Array
    """Seconds, (W,)."""
    sizes: Array
    """Measurements of each sensor, int64 (W, S)."""
    copies: Array
    """How many of them, the last, are others once more (`assoc.scene.scan.Scan.copies`), int64 (W, S)."""

    @staticmethod
    def empty(branches: int, depth: int, sensors: int) -> Window:
        """The window before the first scan."""
        history = np.zeros((branches, depth * sensors), dtype=np.int32)
        return Window(history, np.zeros(0), *np.zeros((2, 0, sensors), dtype=np.int64))

    def opened(self, scan: Scan, history: Array) -> Window:
        """The window with this scan added, and the new history."""
        times, sizes = np.append(scan.time, self.times), np.concatenate([scan.sizes[None].astype(np.int64), self.sizes])
        copies = np.zeros_like(scan.sizes) if scan.copies is None else scan.copies
        return Window(history, times, sizes, np.concatenate([copies[None].astype(np.int64), self.copies]))

    def closed(self) -> Window:
        """The window without its oldest scan."""
        return self._replace(times=self.times[:-1], sizes=self.sizes[:-1], copies=self.copies[:-1])

    def of(self, rows: Array) -> Window:
        """The window of these branches alone."""
        return self._replace(history=self.history[rows])

    def decision(self, age: int, scan: int, tracks: TrackBatch, rows: Array) -> Decision:
        """Tracks of the measurements of the scan `age` scans before number `scan`, by these rows."""
        sizes, confirmed = self.sizes[age], tracks.confirmed[rows].astype(np.int64)
        history = self.history[rows, age * sizes.size : (age + 1) * sizes.size]
        assigned, sure = owners(history, tracks.track_id[rows], sizes), owners(history, confirmed, sizes)
        own = (sizes - self.copies[age]).tolist()
        ids = tuple(taken[:size] for taken, size in zip(assigned, own, strict=True))
        known = tuple(flags[:size].astype(np.bool_) for flags, size in zip(sure, own, strict=True))
        return Decision(scan - age, float(self.times[age]), ids, known)

    def decisions(self, scan: int, tracks: TrackBatch, rows: Array) -> tuple[Decision, ...]:
        """Decisions of these rows about all open scans, oldest first."""
        return tuple(self.decision(age, scan, tracks, rows) for age in reversed(range(len(self.times))))

    def arrays(self) -> Mapping[str, Array]:
        """The window for a file."""
        return {"history": self.history, "window_times": self.times, "window_sizes": self.sizes,
                "window_copies": self.copies}  # fmt: skip

    @staticmethod
    def restored(saved: Saved, branches: int, depth: int, sensors: int) -> Window:
        """The window that a file holds, checked."""
        times, sizes, history = saved["window_times"], saved["window_sizes"], saved["history"]
        saved.require(len(times) < depth or len(times) == 0, "window_times", f"fewer than {depth} scans")
        saved.require(np.isfinite(times).all(), "window_times", "finite numbers")
        saved.require(sizes.shape == (len(times), sensors), "window_sizes", f"the shape {(len(times), sensors)}")
        saved.require(((sizes >= 0) & (sizes <= MOST_MEASUREMENTS)).all(), "window_sizes", "numbers of measurements")
        copies = saved["window_copies"]
        good = copies.shape == sizes.shape and ((copies >= 0) & (copies <= sizes)).all()
        saved.require(good, "window_copies", "numbers of measurements, no more than there are")
        shape = branches, depth * sensors
        saved.require(history.shape == shape, "history", f"the shape {shape}")
        most = np.full(depth * sensors, MOST_MEASUREMENTS)
        most[: sizes.size] = sizes.ravel()
        known = ((history >= 0) & (history <= most)).all()
        saved.require(known, "history", "numbers of measurements of the scans in the window")
        return Window(history.astype(np.int32), times, sizes, copies)


@dataclass(frozen=True)
class DeferringMethod(Method):
    """A method that decides each scan `depth` - 1 scans later."""

    depth: int = 3

    def _check(self, whole: str, drop: str) -> None:
        """Check depth, the number of hypotheses or branches (`whole`), and the drop of their scores."""
        for what in ("depth", whole):
            if not is_whole(getattr(self, what), 1):
                raise InvalidInputError(f"{what} must be a whole number above 0, got {getattr(self, what)!r}")
            object.__setattr__(self, what, int(getattr(self, what)))
        if self.depth > MOST_SCANS:
            raise InvalidInputError(f"depth must be at most {MOST_SCANS} scans, got {self.depth}")
        value = getattr(self, drop)
        if not isinstance(value, (int, float)) or not value > 0:
            raise InvalidInputError(f"{drop} must be a number above 0, got {value!r}")
        object.__setattr__(self, drop, float(value))
