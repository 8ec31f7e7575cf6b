"""Stone Soup's multi-frame assignment, global nearest neighbour and JPDA on the same detections.

All are given the targets at time 0, as ours are, and none starts or ends tracks. JPDA by loopy belief propagation: its
enumeration of all joint events is for a few targets.
"""

import time
import warnings
from collections.abc import Callable, Iterator
from datetime import datetime, timedelta
from typing import Any

import numpy as np
from stonesoup.dataassociator.mfa import MFADataAssociator
from stonesoup.dataassociator.neighbour import GNNWith2DAssignment
from stonesoup.dataassociator.probability import JPDAwithLBP
from stonesoup.functions import gm_reduce_single
from stonesoup.hypothesiser.mfa import MFAHypothesiser
from stonesoup.hypothesiser.probability import PDAHypothesiser
from stonesoup.models.measurement.linear import LinearGaussian
from stonesoup.models.transition.linear import CombinedLinearGaussianTransitionModel, ConstantVelocity
from stonesoup.predictor.kalman import KalmanPredictor
from stonesoup.types.detection import Detection
from stonesoup.types.mixture import GaussianMixture
from stonesoup.types.numeric import Probability
from stonesoup.types.state import GaussianState, TaggedWeightedGaussianState
from stonesoup.types.track import Track
from stonesoup.types.update import GaussianStateUpdate
from stonesoup.updater.kalman import KalmanUpdater

from assoc._types import Array
from experiments.trackers.plane import ACCELERATION, NOISE, START_DEVIATION, Plane

_START = datetime(2026, 1, 1)


def _parts(plane: Plane, gate: float) -> tuple[Any, Any, Any]:
    axis = ConstantVelocity(ACCELERATION**2)
    model = LinearGaussian(ndim_state=4, mapping=(0, 2), noise_covar=NOISE**2 * np.eye(2))
    predictor = KalmanPredictor(CombinedLinearGaussianTransitionModel([axis, axis]))
    updater = KalmanUpdater(model)
    sensor = plane.sensor
    hypothesiser = PDAHypothesiser(
        predictor,
        updater,
        clutter_spatial_density=sensor.false_alarm_rate / sensor.volume,
        prob_detect=Probability(sensor.detection_probability),
        prob_gate=Probability(gate),
    )
    return model, updater, hypothesiser


def _scans(plane: Plane, model: Any) -> Iterator[tuple[datetime, set[Any]]]:
    for k, measured in enumerate(plane.measurements, start=1):
        when = _START + timedelta(seconds=k)
        yield when, {Detection(z[:, None], timestamp=when, measurement_model=model) for z in measured}


def multi_frame(plane: Plane, window: int, gate: float) -> Iterator[tuple[float, Array]]:
    """Multi-frame assignment: seconds and estimated positions (T, 2) of each scan."""
    model, updater, inner = _parts(plane, gate)
    associator = MFADataAssociator(MFAHypothesiser(inner), slide_window=window)
    covariance = np.diag((START_DEVIATION**2)[[0, 2, 1, 3]])
    tracks = set()
    for x in plane.start:
        prior = TaggedWeightedGaussianState(x[[0, 2, 1, 3], None], covariance, _START, weight=Probability(1), tag=[])
        tracks.add(Track([GaussianMixture([prior])]))
    for when, detections in _scans(plane, model):
        started = time.process_time()
        with warnings.catch_warnings():
            # where its shortcut finds nothing it says so, and solves the whole problem
            warnings.filterwarnings("ignore", "Infeasible primal problem")
            found = associator.associate(tracks, detections, when)
        for track, hypotheses in found.items():
            components = [updater.update(h) if h else h.prediction for h in hypotheses]
            track.append(GaussianMixture(components))
        elapsed = time.process_time() - started
        best = [max(track.state.components, key=lambda part: float(part.weight)) for track in tracks]
        yield elapsed, np.array([np.asarray(part.mean, dtype=float)[[0, 2], 0] for part in best]).reshape(-1, 2)


def nearest(plane: Plane, gate: float) -> Iterator[tuple[float, Array]]:
    """Global nearest neighbour by 2-D assignment of likelihoods: seconds and positions of each scan."""

    def corrected(updater: Any, found: Any, when: datetime) -> Any:
        return updater.update(found) if found else found.prediction

    return _one_state(plane, gate, GNNWith2DAssignment, corrected)


def probabilistic(plane: Plane, gate: float) -> Iterator[tuple[float, Array]]:
    """JPDA: each track's mixture of all its measurements as one Gaussian; seconds and positions of each scan."""

    def corrected(updater: Any, many: Any, when: datetime) -> Any:
        after = [updater.update(h) if h else h.prediction for h in many]
        weights = np.array([float(h.probability) for h in many])
        means = np.concatenate([np.asarray(state.mean, dtype=float) for state in after], axis=1)
        covariances = np.stack([np.asarray(state.covar, dtype=float) for state in after], axis=2)
        mean, covar = gm_reduce_single(means, covariances, weights / weights.sum())
        return GaussianStateUpdate(mean, covar, many, when)

    return _one_state(plane, gate, JPDAwithLBP, corrected)


def _one_state(
    plane: Plane, gate: float, kind: Any, corrected: Callable[[Any, Any, datetime], Any]
) -> Iterator[tuple[float, Array]]:
    """Tracks with one state each, corrected by what an associator of this kind finds."""
    model, updater, hypothesiser = _parts(plane, gate)
    associator = kind(hypothesiser)
    covariance = np.diag((START_DEVIATION**2)[[0, 2, 1, 3]])
    tracks = {Track(GaussianState(x[[0, 2, 1, 3], None], covariance, _START)) for x in plane.start}
    for when, detections in _scans(plane, model):
        started = time.process_time()
        for track, found in associator.associate(tracks, detections, when).items():
            track.append(corrected(updater, found, when))
        elapsed = time.process_time() - started
        yield elapsed, np.array([np.asarray(track.mean, dtype=float)[[0, 2], 0] for track in tracks]).reshape(-1, 2)
