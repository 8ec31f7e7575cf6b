"""A tracker that is told which measurement is whose: what no tracker with the same filter can beat by association."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from assoc._types import Array
from assoc.scene import Scene
from assoc.tracking import Tracker
from assoc.tracking.associate.all_sensors import whole_scan
from assoc.tracking.associate.mht import TrackTrees
from assoc.tracking.filter_choice import manoeuvre_noise, open_heights, pace_of, two_speeds
from assoc.tracking.method import Method
from assoc.tracking.progress import Association, Progress
from assoc.tracking.records.track_batch import TrackBatch
from assoc.tracking.settings import TrackerSettings


@dataclass(frozen=True)
class Oracle(Method):
    """The targets of all measurements, scan by scan; its own part of a state is the target of each track."""

    starter = TrackTrees()

    sources: Any

    def begun(self, settings: TrackerSettings, tracks: TrackBatch) -> dict[int, int]:
        """No track has a target."""
        return {}

    def associate(self, progress: Progress) -> Association:
        """Correct each track by its target's measurements."""
        rows, fresh = self._true_rows(progress)
        scan = whole_scan(progress)
        return self._noted(progress, scan.associated(scan.follow(np.arange(len(rows)), rows), rows, fresh))

    def _true_rows(self, progress: Progress) -> tuple[Array, Array]:
        """Measurements of each track, and of the targets without one."""
        sources = self.sources[progress.scan.index]
        known = [progress.state.method_state[i] for i in progress.state.tracks.track_id.tolist()]
        fresh = sorted({t for source in sources for t in source.tolist() if t >= 0} - set(known))
        return _rows(sources, known), _rows(sources, fresh)

    def _noted(self, progress: Progress, found: Association) -> Association:
        """Take note of which target each track has."""
        target_of = dict(progress.state.method_state)
        for source, ids in zip(self.sources[progress.scan.index], found.assigned, strict=True):
            target_of |= {i: t for i, t in zip(ids.tolist(), source.tolist(), strict=True) if i}
        return found._replace(method_state=target_of)


class OracleTracker(Tracker):
    """Tracks by the sources of the measurements, with the filter and the life of tracks of any other tracker.

    scene: With truth.
    **options: As for `Tracker`.
    """

    name = "oracle"
    method = Oracle

    def __init__(self, scene: Scene, **options: Any) -> None:
        noise = manoeuvre_noise(pace_of(scene.times))
        filter = two_speeds(noise, unscented=open_heights(scene.sensors))
        options = {"filter": filter, "region": scene.region} | options
        super().__init__(scene.sensors, sources=scene.truth.sources, **options)


def _rows(sources: Any, targets: list[int]) -> Array:
    """1-based measurements (T, S) of these targets, 0 where missed."""
    rows = np.zeros((len(targets), len(sources)), dtype=np.int32)
    for s, source in enumerate(sources):
        number = {t: m + 1 for m, t in enumerate(source.tolist()) if t >= 0}
        rows[:, s] = [number.get(t, 0) for t in targets]
    return rows
