"""The labelled multi-Bernoulli filter (LMB) of multisensor-lmb-filters-rs on the same detections.

The package is there for Python 3.12 and later only, so the experiment does without it elsewhere. The filter is told of
the targets at time 0, as ours are, and starts no others; by loopy belief propagation, as its authors advise for one
sensor.
"""

import importlib.util
import math
from collections.abc import Iterator

import numpy as np

from assoc._types import Array
from assoc.tracking import LifeCycle
from experiments.common.measuring import processor_time
from experiments.trackers.plane import ACCELERATION, NOISE, START_DEVIATION, Plane

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
