"""Truth and tracks as metrics take them: rows of time, identity and position."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from assoc._system.wrong_types import explains_wrong_types
from assoc._text.shown import Shown
from assoc._text.times import moment
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.scene.scene import Scene
from assoc.sensors.arrays import numbers, require_finite

SAME_TIME = 1e-6
"""Time stamps that differ by less than about this (s) are one epoch."""


@explains_wrong_types
@dataclass(frozen=True, eq=False, repr=False)
class Trajectories(Shown):
    """Targets, or tracks, over time.

    Parameters
    ----------
    times : array_like (n,)
        Seconds, in any order.
    ids : array_like of int (n,)
        The target or track of each row; each at most once at an instant.
    positions : array_like (n, d)
        Metres, in two or three dimensions.

    Raises
    ------
    InvalidInputError
        Shapes that do not agree, values that are not finite, or an identity twice at one instant.
    """

    times: Array
    ids: Array
    positions: Array

    def __post_init__(self) -> None:
        times = require_finite(numbers(self.times, "times"), "times")
        ids = np.asarray(self.ids)
        if ids.size == 0:
            ids = ids.astype(np.int64)
        if times.ndim != 1 or ids.shape != times.shape:
            raise InvalidInputError(f"times and ids must both have shape (n,), got {times.shape} and {ids.shape}")
        if ids.dtype.kind not in "iu":
            raise InvalidInputError(f"ids must be integers, got {ids.dtype}")
        positions = require_finite(numbers(self.positions, "positions"), "positions")
        if len(times) == 0 and positions.size == 0:
            positions = positions.reshape(0, positions.shape[1] if positions.ndim == 2 else 3)
        if positions.ndim != 2 or len(positions) != len(times) or positions.shape[1] not in (2, 3):
            raise InvalidInputError(
                f"positions must have shape ({len(times)}, 2) or ({len(times)}, 3), got {positions.shape}"
            )
        order = np.lexsort((ids, times))
        for name, value in (("times", times), ("ids", ids.astype(np.int64)), ("positions", positions)):
            value = np.ascontiguousarray(value[order])
            value.setflags(write=False)
            object.__setattr__(self, name, value)
        once = last_at_each_instant(self.times, self.ids)
        if len(once) < len(self.times):
            row = int(np.setdiff1d(np.arange(len(self.times)), once)[0])
            raise InvalidInputError(f"ids: {self.ids[row]} occurs twice at {self.times[row]:.6g} s")

    @classmethod
    def from_scene(cls, scene: Scene) -> Trajectories:
        """Take the truth of a scene; of scans of one time, the last that each target is in.

        Raises
        ------
        InvalidInputError
            The scene has no truth.
        """
        truth = scene.truth
        if truth is None:
            raise InvalidInputError("the scene has no truth to compare with")
        counts = [len(ids) for ids in truth.target_ids]
        times, ids = np.repeat(scene.times, counts), np.concatenate(truth.target_ids)
        kept = last_at_each_instant(times, ids)
        return cls(times[kept], ids[kept], np.concatenate(truth.positions)[kept])

    @property
    def dim(self) -> int:
        """Dimensions of a position, 2 or 3."""
        return int(self.positions.shape[1])

    def __len__(self) -> int:
        return len(self.times)

    def __repr__(self) -> str:
        span = f", {moment(self.times[0])} to {moment(self.times[-1])}" if len(self) else ""
        return f"Trajectories({len(np.unique(self.ids))} identities, {len(self)} rows{span})"


def columns_of_rows(**columns: Array) -> list[Array]:
    """Columns as arrays of one shape (n,); refused where their shapes differ."""
    arrays = [np.asarray(column) for column in columns.values()]
    if arrays[0].ndim != 1 or any(array.shape != arrays[0].shape for array in arrays):
        *names, last = columns
        shapes = ", ".join(str(array.shape) for array in arrays)
        raise InvalidInputError(f"{', '.join(names)} and {last} must have one shape (n,), got {shapes}")
    return arrays


def last_at_each_instant(times: Array, ids: Array) -> Array:
    """Rows that are the last of their identity at their instant, ascending.

    Several scans may have the same time, as of sensors that report in turn: each lists targets and tracks again.
    """
    ticks = np.round(np.asarray(times, dtype=np.float64) / SAME_TIME)
    order = np.lexsort((ids, ticks))
    again = (np.diff(ticks[order]) == 0) & (np.diff(np.asarray(ids)[order]) == 0)
    return np.sort(order[np.append(~again, True)[: len(order)]])


def epochs(truth: Trajectories, tracks: Trajectories) -> Iterator[tuple[float, Array, Array]]:
    """Each instant of the truth or the tracks, earliest first: its time and the rows of both, by their ids.

    Both have the same dimension (an empty one goes with any).
    """
    if len(truth) and len(tracks) and truth.dim != tracks.dim:
        raise InvalidInputError(f"positions: the truth has {truth.dim} dimensions, the tracks have {tracks.dim}")
    ticks = np.round(np.concatenate([truth.times, tracks.times]) / SAME_TIME)
    # stamps of one instant may differ by rounding: the order of the rows is then not that of the ids
    order = np.lexsort((np.concatenate([truth.ids, tracks.ids]), np.arange(len(ticks)) >= len(truth), ticks))
    for group in np.split(order, np.flatnonzero(np.diff(ticks[order])) + 1):
        if group.size:
            real = group < len(truth)
            time = truth.times[group[0]] if real[0] else tracks.times[group[0] - len(truth)]
            yield float(time), group[real], group[~real] - len(truth)
