"""Running our trackers and keeping what is judged: tracks, decisions, time per scan."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from assoc._types import Array
from assoc.filters import ConstantVelocity, Gaussian, KalmanFilter
from assoc.metrics import Trajectories
from assoc.scene import Scene
from assoc.tracking import Initiation, Tracker, TrackTable
from experiments.common.measuring import processor_time
from experiments.trackers.plane import ACCELERATION, SPEED, START_DEVIATION, Plane


@dataclass(frozen=True)
class Run:
    """A tracker's way through a scene.

    tracks: The confirmed tracks.
    confirmed: list over scans of (ids (n,), positions (n, 3)).
    seconds: array (K,). CPU time of each scan.
    """

    tracks: Trajectories
    confirmed: list[tuple[Array, Array]]
    seconds: Array


def through(tracker: Tracker, scene: Scene) -> Run:
    """Take a scene in, scan by scan."""
    table, confirmed, seconds = TrackTable(), [], []
    for k in range(scene.num_scans):
        scan = scene.scan(k)
        # CPU time: what else the machine does is not the tracker's
        seconds.append(processor_time(tracker.step, scan.time, scan.measurements, scan.times, scan.sectors)[1])
        tracks = [track for track in tracker.tracks if track.reported]
        table.add(tracks, tracker.filter.motion.position)
        places = np.array([track.position for track in tracks]).reshape(-1, 3)
        confirmed.append((np.array([track.track_id for track in tracks], dtype=np.int64), places))
    return Run(Trajectories(*table.arrays()), confirmed, np.array(seconds))


def in_plane(kind: type[Tracker], plane: Plane, **options: Any) -> Iterator[tuple[float, Array]]:
    """Our tracker on a plane: CPU seconds and positions of confirmed tracks (n, 2) of each scan."""
    motion = ConstantVelocity(ACCELERATION, dimensions=2, kind="continuous")
    tracker = kind([plane.sensor], KalmanFilter(motion), initiation=Initiation(speed=SPEED), **options)
    tracker.begin(0.0, Gaussian(plane.start, np.diag(START_DEVIATION**2)))
    for k, z in enumerate(plane.measurements, start=1):
        _, elapsed = processor_time(tracker.step, float(k), [z])
        yield elapsed, np.array([track.position[:2] for track in tracker.tracks if track.confirmed]).reshape(-1, 2)
