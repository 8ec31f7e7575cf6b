"""The project's multiple hypothesis trackers on windows of plots."""

from typing import Any

import numpy as np

from assoc._types import Array
from assoc.filters import ConstantVelocity, ExtendedKalmanFilter
from assoc.filters.base import Filter
from assoc.recordings import Window
from assoc.sensors import Radar2D
from assoc.tracking import Decision, HypothesisOrientedMHT, Initiation, LifeCycle, TrackOrientedMHT
from experiments.papers.clustering_time_window.judging import Taken


class HypothesisTracker:
    """A multiple hypothesis tracker that takes windows.

    clock: Seconds from window to window; without it each plot has its own time stamp.
    kind: `TrackOrientedMHT` or `HypothesisOrientedMHT`.
    process_noise: m/s^1.5.
    filter: In place of an extended Kalman filter of constant velocity with this noise.
    taking_up: Whether a new track takes up a lost one that it continues, as our trackers do; the thesis's does not.
    options: Further settings of the tracker.
    """

    def __init__(
        self,
        radar: Radar2D,
        clock: float | None = None,
        kind: type[TrackOrientedMHT | HypothesisOrientedMHT] = TrackOrientedMHT,
        process_noise: float = 5.0,
        taking_up: bool = True,
        filter: Filter[Any] | None = None,
        **options: Any,
    ) -> None:
        reach = float(radar.field_of_view[0, 1])
        settings: dict[str, Any] = {
            # the slant plane: no heights
            "region": np.array([[-reach, reach], [-reach, reach], [0.0, 0.0]]),
            "life_cycle": LifeCycle(deletion_time=60.0, false_probability=1e-3),
            "initiation": Initiation(speed=200.0, birth_rate=0.1),
            "depth": 4,
        }
        if issubclass(kind, TrackOrientedMHT):
            # a plot that two aircraft contest scores above 10: who must do without it shall keep that branch
            settings |= {"max_branches": 30, "branch_drop": 25.0}
        settings |= options
        motion = ConstantVelocity(process_noise, kind="continuous", dimensions=2)
        self.tracker = kind([radar], filter or ExtendedKalmanFilter(motion), **settings)
        self.forgotten: dict[str, Any] = {} if taking_up else {"lost": self.tracker.state.lost}
        self.clock = clock
        self.rows: list[Array] = []
        self.final: list[Decision] = []

    def take(self, window: Window) -> tuple[Array, Array]:
        """Take a window; return the track of each plot (-1: a false plot) and whether it is confirmed then."""
        self.rows.append(window.rows)
        self.tracker.state = self.tracker.state._replace(**self.forgotten)
        if self.clock is None:
            done = self.tracker.step(float(window.times[-1]), [window.measurements], times=[window.times])
        else:
            done = self.tracker.step(len(self.rows) * self.clock, [window.measurements])
        self.final.extend(done.final)
        return _tracks(done), done.confirmed[0]

    def decided(self) -> Taken:
        """What the tracker has decided for good about every window, with the depth's delay."""
        final = sorted([*self.final, *self.tracker.flush()], key=lambda decision: decision.scan)
        return Taken(
            np.repeat([decision.scan for decision in final], [len(decision.assigned[0]) for decision in final]),
            np.concatenate([self.rows[decision.scan] for decision in final]),
            np.concatenate([_tracks(decision) for decision in final]),
            np.concatenate([decision.confirmed[0] for decision in final]),
        )


def _tracks(done: Decision) -> Array:
    ids = done.assigned[0]
    return np.where(ids > 0, ids, -1)
