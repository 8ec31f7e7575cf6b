"""Point targets in a plane, with clutter: what ours, Stone Soup's and the LMB filter are given alike.

The labelled multi-Bernoulli filter (LMB) is that of multisensor-lmb-filters-rs, which is there for Python 3.12 and
later only. It is told of the targets at time 0, as ours are, and starts no others; by loopy belief propagation, as its
authors advise for one sensor.
"""

import importlib.util
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from assoc._types import Array
from assoc.filters import ConstantVelocity, Gaussian, KalmanFilter
from assoc.sensors import PositionSensor
from assoc.tracking import Initiation, LifeCycle, Tracker
from experiments.common.measuring import processor_time

SPACING = 150.0
"""Side of the square that a target has to itself on average, metres."""
NOISE, SPEED, ACCELERATION = 10.0, 10.0, 1.0
"""Measurement noise (m), speed along an axis (m/s), process noise (m/s^1.5)."""
DETECTION = 0.9
FAR = 2_000.0
"""Farther beyond the clutter than any target flies, metres."""


@dataclass(frozen=True)
class Plane:
    """One scenario.

    truth: array (K, T, 4). [x, y, vx, vy] at times 0, 1, ..., K - 1 seconds; the trackers know the first with some
        error.
    start: array (T, 4). What they are told of time 0.
    measurements: list over times 1 .. K - 1 of arrays (n, 2).
    """

    sensor: PositionSensor
    truth: Array
    start: Array
    measurements: list[Array]


START_DEVIATION = np.array([NOISE, NOISE, 2.0, 2.0])


def simulate(targets: int, clutter: float, scans: int, seed: int) -> Plane:
    """Simulate a plane; `clutter` is the mean number of false alarms in a scan for each target."""
    rng = np.random.default_rng(seed)
    side = SPACING * np.sqrt(targets)
    field = np.array([[-0.2 * side, 1.2 * side]] * 2)
    state = np.concatenate([rng.uniform(0, side, (targets, 2)), rng.normal(0, SPEED, (targets, 2))], axis=1)
    F = np.kron([[1.0, 1.0], [0.0, 1.0]], np.eye(2))
    root = np.linalg.cholesky(ACCELERATION**2 * np.kron([[1 / 3, 1 / 2], [1 / 2, 1.0]], np.eye(2)))
    # clutter is uniform, the targets' own square has its share
    rate = clutter * targets * 1.4**2
    truth, measurements = [state], []
    for _ in range(scans):
        state = state @ F.T + rng.standard_normal(state.shape) @ root.T
        truth.append(state)
        seen = state[rng.random(targets) < DETECTION, :2]
        false = rng.uniform(field[:, 0], field[:, 1], (rng.poisson(rate), 2))
        z = np.concatenate([seen + rng.normal(0, NOISE, seen.shape), false])
        measurements.append(rng.permutation(z))
    # targets are detected where they have flown out of the clutter, too: our trackers expect no measurement where their
    # sensor does not see, and the others know of no field of view
    seen_field = field + [-FAR, FAR]
    share = np.prod(np.diff(seen_field)) / np.prod(np.diff(field))
    sensor = PositionSensor(
        position=np.zeros(3),
        noise=[NOISE, NOISE],
        detection_probability=DETECTION,
        false_alarm_rate=rate * share,
        field_of_view=seen_field,
    )
    start = truth[0] + rng.standard_normal(truth[0].shape) * START_DEVIATION
    return Plane(sensor, np.stack(truth), start, measurements)


def in_plane(kind: type[Tracker], plane: Plane, **options: Any) -> Iterator[tuple[float, Array]]:
    """Our tracker on a plane: CPU seconds and positions of confirmed tracks (n, 2) of each scan."""
    motion = ConstantVelocity(ACCELERATION, dimensions=2, kind="continuous")
    tracker = kind([plane.sensor], KalmanFilter(motion), initiation=Initiation(speed=SPEED), **options)
    tracker.begin(0.0, Gaussian(plane.start, np.diag(START_DEVIATION**2)))
    for k, z in enumerate(plane.measurements, start=1):
        _, elapsed = processor_time(tracker.step, float(k), [z])
        yield elapsed, np.array([track.position[:2] for track in tracker.tracks if track.confirmed]).reshape(-1, 2)


PACKAGE = "multisensor_lmb_filters_rs"
AVAILABLE = importlib.util.find_spec(PACKAGE) is not None
_ITERATIONS, _TOLERANCE = 1_000, 1e-6
_AT_FIRST = 0.999
"""Probability that a target that it was told of is there."""


def labelled(plane: Plane) -> Iterator[tuple[float, Array]]:
    """CPU seconds and positions (n, 2) of each scan."""
    module = importlib.import_module(PACKAGE)
    inside = importlib.import_module(f"{PACKAGE}._{PACKAGE}")
    sensor = plane.sensor
    # x, y, vx, vy
    motion = module.MotionModel(
        np.kron([[1.0, 1.0], [0.0, 1.0]], np.eye(2)),
        ACCELERATION**2 * np.kron([[1 / 3, 1 / 2], [1 / 2, 1.0]], np.eye(2)),
        np.zeros(4),
        math.exp(-1.0 / LifeCycle().lifetime),
    )
    seen = module.SensorModel(
        np.eye(2, 4), NOISE**2 * np.eye(2), sensor.detection_probability, sensor.false_alarm_rate, sensor.volume
    )
    known = np.diag(START_DEVIATION**2)
    nowhere = module.BirthModel([], 0.0, 0.0)
    filter = module.FilterLmb(motion, seen, nowhere, module.AssociatorConfig.lbp(_ITERATIONS, _TOLERANCE), seed=0)
    filter.set_tracks(
        [
            inside._TrackData((0, k), _AT_FIRST, x[None], known[None], np.ones(1))
            for k, x in enumerate(np.asarray(plane.start, dtype=np.float64))
        ]
    )
    for k, measured in enumerate(plane.measurements, start=1):
        detections = [np.ascontiguousarray(z) for z in measured]
        found, elapsed = processor_time(filter.step, detections, k)
        yield elapsed, np.array([track.mean[:2] for track in found.tracks]).reshape(-1, 2)
