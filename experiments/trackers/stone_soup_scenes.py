"""Stone Soup's global nearest neighbour on a scene, sensor after sensor, composed as its documentation does.

Extended Kalman filter with constant velocity, hypotheses by what is declared of each sensor, tracks from three
detections, ended after five scans without one. A sensor that measures no position begins no track.
"""

from collections.abc import Iterator
from datetime import timedelta
from typing import Any

import numpy as np
from stonesoup.dataassociator.neighbour import GNNWith2DAssignment
from stonesoup.deleter.time import UpdateTimeDeleter
from stonesoup.hypothesiser.probability import PDAHypothesiser
from stonesoup.initiator.simple import MultiMeasurementInitiator
from stonesoup.models.measurement.nonlinear import CartesianToElevationBearingRangeRate
from stonesoup.models.transition.linear import CombinedLinearGaussianTransitionModel, ConstantVelocity
from stonesoup.predictor.kalman import KalmanPredictor
from stonesoup.tracker.simple import MultiTargetTracker
from stonesoup.types.array import StateVector
from stonesoup.types.detection import Detection
from stonesoup.types.numeric import Probability
from stonesoup.types.state import GaussianState
from stonesoup.updater.kalman import ExtendedKalmanUpdater

from assoc.integrations.stonesoup.models import measurement_model
from assoc.integrations.stonesoup.readers import EPOCH, moment
from assoc.metrics import Trajectories
from assoc.scene import Scene
from assoc.sensors import Radar3D, Sensor
from assoc.tracking.filter_choice import planar
from experiments.trackers.plain_gnn import GATE, MISSES, NEEDED, NOISE

PLACES, RATES = (0, 2, 4), (1, 3, 5)
# elevation, bearing, range there; range, azimuth, elevation here
_ORDER = [2, 1, 0, 3]


def _model(sensor: Sensor, dim: int) -> Any:
    """The measurement model of a sensor for states of constant velocity."""
    if not isinstance(sensor, Radar3D) or not sensor.measures_velocity:
        return measurement_model(sensor, dim, PLACES[: dim // 2])
    return CartesianToElevationBearingRangeRate(
        ndim_state=dim, mapping=PLACES, velocity_mapping=RATES, translation_offset=StateVector(sensor.position),
        noise_covar=sensor.covariance[np.ix_(_ORDER, _ORDER)],
    )  # fmt: skip


def stone_soup(scene: Scene, speed: float) -> Trajectories:
    """The tracks after each scan; a speed (m/s) along an axis is usual."""
    axes = 2 if planar(scene.sensors, scene.region) else 3
    dim, places, numbers = 2 * axes, list(PLACES[:axes]), dict[str, int]()
    predictor = KalmanPredictor(CombinedLinearGaussianTransitionModel([ConstantVelocity(NOISE)] * axes))
    updater = ExtendedKalmanUpdater()
    hypothesiser = PDAHypothesiser(predictor, updater, 1.0, Probability(0.9), Probability(GATE))
    nearest, pace = GNNWith2DAssignment(hypothesiser), float(np.median(np.diff(scene.times)))
    deleter, early = (UpdateTimeDeleter(timedelta(seconds=(n + 0.5) * pace)) for n in (MISSES, 2))
    prior = GaussianState(np.zeros((dim, 1)), np.diag([100.0**2, speed**2] * axes), timestamp=EPOCH)
    initiator = MultiMeasurementInitiator(prior, early, nearest, updater, min_points=NEEDED, skip_non_reversible=True)

    def detections() -> Iterator[Any]:
        for k in range(scene.num_scans):
            scan = scene.scan(k).aligned(scene.sensors)
            now = moment(scan.time, EPOCH)
            for sensor, measured in zip(scene.at(scan.time).sensors, scan.measurements, strict=True):
                hypothesiser.clutter_spatial_density = sensor.false_alarm_rate / sensor.volume
                hypothesiser.prob_detect = Probability(sensor.detection_probability)
                model, polar = _model(sensor, dim), sensor.components[0] == "range"
                order = [i for i in _ORDER if i < sensor.dim] if polar else range(sensor.dim)
                yield now, {Detection(StateVector(z[order]), timestamp=now, measurement_model=model) for z in measured}

    rows = []
    for n, (_, tracks) in enumerate(MultiTargetTracker(initiator, deleter, detections(), nearest, updater), start=1):
        for track in tracks if n % len(scene.sensors) == 0 else ():
            where = np.asarray(track.state.mean, dtype=float)[places, 0]
            number = numbers.setdefault(track.id, len(numbers) + 1)
            rows.append((scene.times[n // len(scene.sensors) - 1], number, *where, *np.zeros(3 - axes)))
    table = np.array(rows).reshape(-1, 5)
    return Trajectories(table[:, 0], table[:, 1].astype(np.int64), table[:, 2:])
