"""Time of one prediction and correction against filterpy and Stone Soup, on the same problem in one run.

The problem: tracks of nearly constant velocity; position measurements for the Kalman filter, a radar (range, azimuth,
elevation) for the others, N = 100 for the ensemble. The other packages take one track at a time. Ours takes all tracks
in one call, which is how its filters are meant to be used, and in separate rows one track at a time: all steps of its
recording in one call (`run`), one call a step (`step`), and two calls a step (`predict`, `update`). Each row is a
prediction and an update together, the least of several rounds, in which the packages alternate. Times are processor
times, which depend less on the load of the machine. Full size: 12 rounds, batches of 10,000 tracks (1,000 for the
ensemble).
"""

import datetime
import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from assoc._system.interpreted import compiled_only
from assoc._types import Array
from assoc.filters import (
    ConstantVelocity,
    EnsembleKalmanFilter,
    ExtendedKalmanFilter,
    Gaussian,
    KalmanFilter,
    UnscentedKalmanFilter,
)
from assoc.filters.base import Filter
from assoc.sensors import PositionSensor, Sensor
from experiments.common.claims import Claim, with_goal
from experiments.common.command import main
from experiments.filters.b1 import radar_of

NOISE, DT, MEMBERS = 1.0, 1.0, 100
ROUNDS = 12

MEAN = np.array([50e3, 40e3, 10e3, -150.0, -200.0, -10.0])
COVARIANCE = np.diag([1e4, 1e4, 1e4, 100.0, 100.0, 100.0])
RADAR = radar_of([30.0, 2e-3, 2e-3])
PLACE = PositionSensor(position=np.zeros(3), noise=np.full(3, 50.0), field_of_view=np.array([[-1e6, 1e6]] * 3))
KINDS: dict[str, tuple[Callable[[ConstantVelocity], Filter[Any]], Sensor]] = {
    "Kalman": (KalmanFilter, PLACE),
    "EKF": (ExtendedKalmanFilter, RADAR),
    "UKF": (UnscentedKalmanFilter, RADAR),
    "EnKF": (lambda motion: EnsembleKalmanFilter(motion, MEMBERS, 1), RADAR),
}


def microseconds(step: Callable[[], object], repeats: int, rounds: int = 1) -> float:
    """Return the processor time of a step in microseconds, the least of the rounds."""
    step()
    times = []
    for _ in range(rounds):
        begin = time.process_time()
        for _ in range(repeats):
            step()
        times.append((time.process_time() - begin) / repeats)
    return 1e6 * float(np.min(times))


def _begun(kind: str, tracks: int = 1, steps: int = 1) -> tuple[Filter[Any], Any, Array, Sensor]:
    """Our filter, its first states, measurements of all steps (tracks or steps, 3), and the sensor."""
    make, sensor = KINDS[kind]
    filter_ = make(ConstantVelocity(NOISE))
    places = MEAN[None, :3] + MEAN[None, 3:] * DT * np.arange(1, steps + 1)[:, None]
    z = np.tile(sensor.measure(places) + 0.5 * sensor.noise, (tracks, 1))
    return filter_, filter_.start(Gaussian(np.tile(MEAN, (tracks, 1)), COVARIANCE)), z, sensor


def ours(kind: str, tracks: int, repeats: int) -> float:
    """Time of our filter a track, `tracks` in one call, microseconds."""
    filter_, state, z, sensor = _begun(kind, tracks)
    return microseconds(lambda: filter_.update(filter_.predict(state, DT), z, sensor), repeats) / tracks


def stepping(kind: str, repeats: int) -> float:
    """Time of our filter for one track, prediction and correction in one call, microseconds."""
    filter_, state, z, sensor = _begun(kind)
    return microseconds(lambda: filter_.step(state, DT, z, sensor), repeats)


def recording(kind: str, steps: int, repeats: int) -> float:
    """Time of our filter a step, one track through all steps of a recording in one call, microseconds."""
    filter_, state, z, sensor = _begun(kind, steps=steps)
    return microseconds(lambda: filter_.run(state, z, sensor, DT), repeats) / steps


def _models() -> tuple[Array, Array]:
    F, Q = ConstantVelocity(NOISE).matrices(DT)
    return F[0], Q[0]


def filterpy(kind: str, repeats: int) -> float:
    """Time of filterpy's filter, microseconds."""
    from filterpy import kalman

    F, Q = _models()
    _, sensor = KINDS[kind]
    z = sensor.measure(MEAN[None, :3] + MEAN[None, 3:])[0] + 0.5 * sensor.noise

    def see(x: Array) -> Array:
        d = np.asarray(x).ravel()
        ground = math.hypot(d[0], d[1])
        return np.array([math.hypot(ground, d[2]), math.atan2(d[1], d[0]), math.atan2(d[2], ground)])

    def slopes(x: Array) -> Array:
        return np.hstack([sensor.jacobian(np.asarray(x).reshape(1, -1)[:, :3])[0], np.zeros((3, 3))])

    if kind == "Kalman":
        f = kalman.KalmanFilter(dim_x=6, dim_z=3)
        f.F, f.Q, f.R, f.H = F, Q, sensor.covariance, np.eye(3, 6)
        f.x, update = MEAN.copy(), lambda: f.update(z)
    elif kind == "EKF":
        f = kalman.ExtendedKalmanFilter(dim_x=6, dim_z=3)
        f.F, f.Q, f.R = F, Q, sensor.covariance
        f.x, update = MEAN.copy(), lambda: f.update(z, slopes, see)
    elif kind == "UKF":
        points = kalman.MerweScaledSigmaPoints(6, alpha=1.0, beta=2.0, kappa=0.0)
        f = kalman.UnscentedKalmanFilter(6, 3, DT, hx=see, fx=lambda x, dt: F @ x, points=points)
        f.Q, f.R = Q, sensor.covariance
        f.x, update = MEAN.copy(), lambda: f.update(z)
    else:
        f = kalman.EnsembleKalmanFilter(MEAN, COVARIANCE, 3, DT, MEMBERS, see, lambda x, dt: F @ x)
        f.Q, f.R, update = Q, sensor.covariance, lambda: f.update(z)
    f.P = COVARIANCE.copy()

    def step() -> None:
        f.predict()
        update()
        if kind != "EnKF":
            f.x, f.P = MEAN.copy(), COVARIANCE.copy()

    return microseconds(step, repeats)


def stonesoup(kind: str, repeats: int) -> float:
    """Time of Stone Soup's predictor and updater, microseconds."""
    from stonesoup.models.measurement.linear import LinearGaussian
    from stonesoup.models.measurement.nonlinear import CartesianToElevationBearingRange
    from stonesoup.models.transition.linear import CombinedLinearGaussianTransitionModel
    from stonesoup.models.transition.linear import ConstantVelocity as WhiteAcceleration
    from stonesoup.predictor import ensemble, kalman
    from stonesoup.types.detection import Detection
    from stonesoup.types.hypothesis import SingleHypothesis
    from stonesoup.types.state import EnsembleState, GaussianState
    from stonesoup.updater import ensemble as ensemble_updater
    from stonesoup.updater import kalman as updaters

    order = [0, 3, 1, 4, 2, 5]
    transition = CombinedLinearGaussianTransitionModel([WhiteAcceleration(NOISE)] * 3)
    _, sensor = KINDS[kind]
    if kind == "Kalman":
        model: Any = LinearGaussian(6, (0, 2, 4), sensor.covariance)
    else:
        model = CartesianToElevationBearingRange(6, (0, 2, 4), sensor.covariance[::-1, ::-1].copy())
    begin = datetime.datetime(2026, 1, 1)
    later = begin + datetime.timedelta(seconds=DT)
    prior: Any = GaussianState(MEAN[order, None], COVARIANCE[np.ix_(order, order)], timestamp=begin)
    predictor, updater = {
        "Kalman": (kalman.KalmanPredictor, updaters.KalmanUpdater),
        "EKF": (kalman.ExtendedKalmanPredictor, updaters.ExtendedKalmanUpdater),
        "UKF": (kalman.UnscentedKalmanPredictor, updaters.UnscentedKalmanUpdater),
        "EnKF": (ensemble.EnsemblePredictor, ensemble_updater.EnsembleUpdater),
    }[kind]
    predict, update = predictor(transition), updater(model)
    if kind == "EnKF":
        prior = EnsembleState.from_gaussian_state(prior, MEMBERS)
    middle = GaussianState(MEAN[order, None], COVARIANCE, timestamp=later)
    z = model.function(middle, noise=False)
    detection = Detection(z, timestamp=later, measurement_model=model)

    def step() -> None:
        # each step predicts anew: Stone Soup would otherwise remember the prediction
        prediction = predict.predict(prior, timestamp=later)
        update.update(SingleHypothesis(prediction, detection))

    def fresh() -> None:
        for cached in (predict, update):
            for function in ("_predict_over_interval", "predict", "predict_measurement"):
                clear = getattr(getattr(type(cached), function, None), "cache_clear", None)
                if clear is not None:
                    clear()
        step()

    return microseconds(fresh, repeats)


def experiment(quick: bool, rng: np.random.Generator) -> list[Claim]:
    """Time every filter of the three packages, ours compiled from the first call on."""
    with compiled_only():
        return _time_all(quick)


def _time_all(quick: bool) -> list[Claim]:
    repeats = 10 if quick else 200
    tracks = 1_000 if quick else 10_000
    claims: list[Claim] = []
    for kind in KINDS:
        slow = 1 if kind == "EnKF" else 10
        rounds = [
            {
                "filterpy": filterpy(kind, max(repeats // slow // 2, 2)),
                "Stone Soup": stonesoup(kind, max(repeats // slow // 5, 2)),
                "assoc, two calls": ours(kind, 1, repeats),
                "assoc, one call": stepping(kind, repeats),
                "assoc, a recording": recording(kind, 100, max(repeats // 100, 1)),
                "assoc, batch": ours(kind, tracks if kind != "EnKF" else tracks // 10, 1),
            }
            for _ in range(ROUNDS)
        ]
        row = {name: float(np.min([times[name] for times in rounds])) for name in rounds[0]}
        faster = min(row["filterpy"], row["Stone Soup"])
        claims += [Claim(f"{kind}: {name}", "us", None, value) for name, value in row.items()]
        for words, name in (
            ("in a batch", "assoc, batch"),
            ("one track's recording in a call", "assoc, a recording"),
            ("one track, a step in one call", "assoc, one call"),
            ("one track, a step in two calls", "assoc, two calls"),
        ):
            claims.append(with_goal(f"{kind}: faster of the two / assoc, {words}", "", faster / row[name], least=10))
    return claims


if __name__ == "__main__":
    raise SystemExit(main("filters.benchmark", experiment, __doc__))
