"""The project's multiple hypothesis trackers on windows of plots."""

from __future__ import annotations

from typing import Any

import numpy as np

from assoc.filters import ConstantVelocity, ExtendedKalmanFilter
from assoc.recordings import Window
from assoc.sensors import Radar2D
from assoc.tracking import Initiation, LifeCycle, TrackOrientedMHT

Array = np.ndarray[Any, np.dtype[Any]]


class HypothesisTracker:
    """A multiple hypothesis tracker that takes windows.

    Parameters
    ----------
    radar : Radar2D
    clock : float, optional
        Seconds from window to window; without it each plot has its own time stamp.
    process_noise : float
        m/s^1.5.
    options
        Further settings of `TrackOrientedMHT`.
    """

    def __init__(
        self, radar: Radar2D, clock: float | None = None, process_noise: float = 10.0, **options: Any
    ) -> None:
        reach = float(radar.field_of_view[0, 1])
        settings: dict[str, Any] = {
            # the slant plane: no heights
            "region": np.array([[-reach, reach], [-reach, reach], [0.0, 0.0]]),
            "life_cycle": LifeCycle(deletion_time=60.0, false_probability=1e-3),
            "initiation": Initiation(speed=200.0, birth_rate=0.1),
            **options,
        }
        motion = ConstantVelocity(process_noise, kind="continuous", dimensions=2)
        self.tracker = TrackOrientedMHT([radar], ExtendedKalmanFilter(motion), **settings)
        self.clock = clock
        self.steps = 0

    def take(self, window: Window) -> tuple[Array, Array]:
        """Take a window; return the track of each plot (-1: a false plot) and whether it is confirmed then."""
        self.steps += 1
        if self.clock is None:
            done = self.tracker.step(float(window.times[-1]), [window.measurements], times=[window.times])
        else:
            done = self.tracker.step(self.steps * self.clock, [window.measurements])
        ids = done.assigned[0]
        return np.where(ids > 0, ids, -1), done.confirmed[0]
