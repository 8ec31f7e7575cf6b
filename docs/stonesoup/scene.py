"""What the examples track: four targets that cross, seen by three radars, and Stone Soup's GOSPA of a tracker."""

import time
from datetime import datetime, timedelta

import numpy as np
from stonesoup.deleter.time import UpdateTimeStepsDeleter
from stonesoup.hypothesiser.probability import PDAHypothesiser
from stonesoup.measures import Euclidean
from stonesoup.metricgenerator.manager import MultiManager
from stonesoup.metricgenerator.ospametric import GOSPAMetric
from stonesoup.models.measurement.nonlinear import CartesianToBearingRange
from stonesoup.models.transition.linear import CombinedLinearGaussianTransitionModel, ConstantVelocity
from stonesoup.predictor.kalman import ExtendedKalmanPredictor
from stonesoup.types.detection import Detection
from stonesoup.types.groundtruth import GroundTruthPath, GroundTruthState
from stonesoup.types.state import GaussianState, State
from stonesoup.types.track import Track
from stonesoup.updater.kalman import ExtendedKalmanUpdater

from assoc.integrations.stonesoup import adapt

START = datetime(2026, 1, 1)
TARGETS = np.array([[-3e3, 90, -2e3, 60], [3e3, -90, -2e3, 60], [0, 30, 3e3, -80], [-2e3, 0, -4e3, 70.0]])
# bearings with 6 mrad, ranges with 30 m; P_d 0.9 and 5 false alarms a scan in a square of 10 km
RADARS = [
    CartesianToBearingRange(4, (0, 2), np.diag([0.006, 30.0]) ** 2, translation_offset=np.array([[x], [y]]))
    for x, y in [(-8e3, -8e3), (8e3, -8e3), (0, 9e3)]
]
SENSORS = [adapt(radar, detection_probability=0.9, false_alarm_rate=5, max_range=2e4) for radar in RADARS]

# what Stone Soup's trackers are made of
predictor = ExtendedKalmanPredictor(CombinedLinearGaussianTransitionModel([ConstantVelocity(1.0)] * 2))
updater, deleter = ExtendedKalmanUpdater(), UpdateTimeStepsDeleter(3)
prior = GaussianState(np.zeros((4, 1)), np.diag([0.0, 100.0, 0.0, 100.0]) ** 2, timestamp=START)
pda = PDAHypothesiser(predictor, updater, clutter_spatial_density=3e-6, prob_detect=0.9, prob_gate=0.999)


def make(seed):
    """Detections, a set of each radar every 4 s, and true paths."""
    rng = np.random.default_rng(seed)
    paths, stream = [GroundTruthPath() for _ in TARGETS], []
    for k in range(20):
        now, there = START + timedelta(seconds=4 * k), TARGETS.copy()
        there[:, [0, 2]] += 4.0 * k * there[:, [1, 3]]
        for path, state in zip(paths, there, strict=True):
            path.append(GroundTruthState(state[:, None], timestamp=now))
        for radar in RADARS:
            seen = there[rng.random(4) < 0.9]
            false = np.insert(rng.uniform(-5e3, 5e3, (rng.poisson(5), 2)), [1, 2], 0.0, axis=1)
            noise = rng.normal(0, 1, (len(seen) + len(false), 2)) * [0.006, 30.0]
            found = [
                radar.function(State(x[:, None])) + z[:, None] for x, z in zip([*seen, *false], noise, strict=True)
            ]
            stream.append((now, {Detection(z, now, measurement_model=radar) for z in found}))
    return stream, set(paths)


def score(tracker, paths):
    """Mean GOSPA (order 2, cutoff 500 m) of the tracks as they are yielded, and milliseconds a scan."""
    began, shown, times = time.process_time(), {}, set()
    for now, tracks in tracker:
        times.add(now)
        for track in tracks:
            place = State(np.asarray(track.state.mean), timestamp=now)
            shown.setdefault(track.id, {})[now] = place  # the last of a time counts
    took = time.process_time() - began
    manager = MultiManager([GOSPAMetric(p=2, c=500, measure=Euclidean((0, 2)))])
    manager.add_data({"tracks": {Track(list(one.values())) for one in shown.values()}, "groundtruth_paths": paths})
    values = manager.generate_metrics()["gospa_generator"]["GOSPA Metrics"].value
    return float(np.mean([one.value["distance"] for one in values])), 1e3 * took / len(times)


def show(ways, seed=1):
    """Print the GOSPA of each way to track."""
    for name, tracker, paths in ways(seed):
        print(f"{name}: {score(tracker, paths)[0]:.0f} m", flush=True)
