"""The measurements of one scan."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from assoc._text.times import moment
from assoc._types import Array
from assoc.sensors import Platform, Sensor


@dataclass(frozen=True, eq=False, repr=False)
class Scan:
    """All measurements of one instant, or with their own times those up to it.

    Attributes
    ----------
    index, time : int, float
        Number of the scan from 0, time stamp in seconds.
    measurements : tuple over sensors of arrays (n_s, d_s)
    sources : tuple over sensors of int arrays (n_s,), or None
        Target id of each measurement, -1 for a false alarm; None where unknown.
    truth_ids, truth_positions : arrays (T,) and (T, 3), or None
    times : tuple over sensors of arrays (n_s,), or None
        When each measurement was made, seconds; None: all at `time`.
    sectors : array (S, 2), or None
        First and last azimuth that each sensor covered, see `assoc.Scene`; None: all directions.
    identities : tuple over sensors of int arrays (n_s, 2), or None
        Mode 3/A code and ICAO address of each measurement, 0 where it has none.
    paths : tuple over sensors of Platform or None
        Where sensors were that moved while they measured; see `aligned`.
    clutter : tuple over sensors of arrays (n_s,), or None
        Logarithm of the density of false alarms over the detection probability at each measurement, relative to those
        of its sensor; None: the same everywhere. Trackers that adapt find it.
    copies : int array (S,), or None
        How many of the last measurements of each sensor are others once more, as plots of two targets are to trackers.
    """

    index: int
    time: float
    measurements: tuple[Array, ...]
    sources: tuple[Array, ...] | None = None
    truth_ids: Array | None = None
    truth_positions: Array | None = None
    times: tuple[Array, ...] | None = None
    sectors: Array | None = None
    identities: tuple[Array, ...] | None = None
    paths: tuple[Platform | None, ...] = ()
    clutter: tuple[Array, ...] | None = None
    copies: Array | None = None

    @property
    def sizes(self) -> Array:
        """Measurements per sensor, int32 (S,)."""
        return np.array([len(z) for z in self.measurements], dtype=np.int32)

    def own_times(self) -> tuple[Array, ...]:
        """When each measurement was made, sequence over sensors of arrays (n_s,), seconds."""
        if self.times is not None:
            return self.times
        return tuple(np.full(len(z), self.time) for z in self.measurements)

    @property
    def at_once(self) -> bool:
        """Whether all sensors covered all directions at the scan's time."""
        return self.times is None and self.sectors is None

    def aligned(self, sensors: Sequence[Sensor]) -> Scan:
        """The scan as sensors would measure it that stand as these do (`Sensor.at`) at the scan's time.

        Angles and positions are then in the axes of the scene's frame. Where measurements have times of their own,
        `paths` gives the positions from which they were made.
        """
        if all(sensor.platform is None for sensor in sensors):
            return self
        stamps = self.own_times()
        found = tuple(s.aligned(z, t) for s, z, t in zip(sensors, self.measurements, stamps, strict=True))
        moved = [t.size > 0 and bool((t != self.time).any()) for t in stamps]
        paths = tuple(
            sensor.platform.of(sensor.position) if sensor.platform is not None and late else None
            for sensor, late in zip(sensors, moved, strict=True)
        )
        return replace(self, measurements=found, paths=paths)

    def crowding(self, rows: Array) -> Array:
        """Sum of the measurements' `clutter` for tuples (K, S) of 1-based measurements, 0 for none; (K,)."""
        total = np.zeros(len(rows))
        for s, clutter in enumerate(self.clutter or ()):
            total += np.append(0.0, clutter)[rows[:, s]]
        return total

    def crowd(self, s: int, numbers: Array) -> Array:
        """The `clutter` of measurements of sensor s (numbers from 0), (K,)."""
        return np.zeros(len(numbers)) if self.clutter is None else self.clutter[s][numbers]

    def with_copies(self, measurements: Sequence[Array], numbers: Sequence[Sequence[int]]) -> Scan:
        """The scan with these measurements, for each sensor the last of them copies of its `numbers` (from 0)."""

        def longer(parts: tuple[Array, ...] | None) -> tuple[Array, ...] | None:
            both = () if parts is None else zip(parts, numbers, strict=True)
            return None if parts is None else tuple(np.concatenate([part, part[list(rows)]]) for part, rows in both)

        return replace(
            self, measurements=tuple(measurements), times=longer(self.times), identities=longer(self.identities),
            clutter=longer(self.clutter), copies=np.array([len(rows) for rows in numbers]),
        )  # fmt: skip

    def true_tuples(self) -> NDArray[np.int32] | None:
        """The tuples of the targets that at least two sensors detected.

        Returns
        -------
        int32 array (T, S), or None
            In order of target id; None where the sources are unknown. A target of which one sensor has several
            measurements has no tuple and is left out.
        """
        if self.sources is None:
            return None
        count = len(self.sources)
        ids = np.unique(np.concatenate([*self.sources, np.zeros(0, np.int64)]))
        ids = ids[ids >= 0]
        tuples = np.zeros((len(ids), count), dtype=np.int32)
        single = np.ones(len(ids), dtype=bool)
        for sensor, source in enumerate(self.sources):
            detected = np.flatnonzero(source >= 0)
            row = np.searchsorted(ids, source[detected])
            tuples[row, sensor] = detected + 1
            single &= np.bincount(row, minlength=len(ids)) <= 1
        return tuples[single & (np.count_nonzero(tuples, axis=1) >= 2)]

    def __repr__(self) -> str:
        sizes = " + ".join(str(len(z)) for z in self.measurements)
        return f"Scan({self.index}, t = {moment(self.time)}, {sizes} measurements)"
