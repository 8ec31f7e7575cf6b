"""Fuse and track a scene, all sets shuffled by the seed given; print the sets' order and every bit of the tracks."""

import random
import sys

import numpy as np
from stonesoup.base import Property
from stonesoup.buffered_generator import BufferedGenerator
from stonesoup.dataassociator.base import DataAssociator
from stonesoup.deleter.time import UpdateTimeStepsDeleter
from stonesoup.hypothesiser.distance import DistanceHypothesiser
from stonesoup.initiator.simple import MultiMeasurementInitiator
from stonesoup.measures import Mahalanobis
from stonesoup.models.transition.linear import CombinedLinearGaussianTransitionModel, ConstantVelocity
from stonesoup.predictor.kalman import KalmanPredictor
from stonesoup.reader import DetectionReader
from stonesoup.tracker.simple import MultiTargetTracker
from stonesoup.types.array import StateVector
from stonesoup.types.state import GaussianState
from stonesoup.updater.kalman import KalmanUpdater

from assoc.integrations.stonesoup import (
    AssignmentAssociator,
    FusionFeeder,
    SceneDetectionReader,
    adapt,
    measurement_model,
)
from assoc.simulation import simulate


class Shuffled(DetectionReader):
    """The detections as a list in an order that depends on the seed, standing for a set's."""

    reader: DetectionReader = Property()
    seed: int = Property()

    @BufferedGenerator.generator_method
    def detections_gen(self):
        order = random.Random(self.seed)
        for time, found in self.reader.detections_gen():
            mixed = list(found)
            order.shuffle(mixed)
            yield time, mixed


class ShuffledTracks(DataAssociator):
    """Hands tracks and detections to the associator in an order that depends on the seed."""

    associator: DataAssociator = Property()
    seed: int = Property()

    def __init__(self, *args, **kwargs):
        super().__init__(*args, **kwargs)
        self.random = random.Random(self.seed)

    def associate(self, tracks, detections, timestamp, **kwargs):
        tracks, detections = list(tracks), list(detections)
        self.random.shuffle(tracks)
        self.random.shuffle(detections)
        chosen = self.associator.associate(tracks, detections, timestamp, **kwargs)
        for hypothesis in chosen.values():
            print("assigned", *numbers(hypothesis.prediction), bool(hypothesis))
        return chosen


def numbers(state):
    """Every bit of a state vector."""
    return [value.hex() for value in np.asarray(state.state_vector, dtype=float).ravel().tolist()]


def main(seed: int) -> None:
    scene = simulate("three-radar", seed=5, scans=12, false_alarms=4.0)
    sensors = [
        adapt(measurement_model(one), false_alarm_rate=4.0, field_of_view=one.field_of_view, name=one.name)
        for one in scene.sensors
    ]
    reader = Shuffled(SceneDetectionReader(scene), seed)
    print([d.metadata["measurement"] for d in next(iter(Shuffled(SceneDetectionReader(scene), seed)))[1]])
    print("---")
    # the ant colony draws random numbers: they must meet the same tuples
    feeder = FusionFeeder(reader, sensors, solver="aco", parameters={"ants": 5, "iterations": 20}, seed=1)
    predictor = KalmanPredictor(CombinedLinearGaussianTransitionModel([ConstantVelocity(100.0)] * 3))
    updater = KalmanUpdater()
    hypothesiser = DistanceHypothesiser(predictor, updater, Mahalanobis(), missed_distance=5.0)
    associator = ShuffledTracks(hypothesiser, AssignmentAssociator(hypothesiser, solver="aco", seed=2), seed)
    deleter = UpdateTimeStepsDeleter(3)
    prior = GaussianState(StateVector(np.zeros(6)), np.diag([0.0, 1e5, 0.0, 1e5, 0.0, 1e5]))
    tracker = MultiTargetTracker(
        initiator=MultiMeasurementInitiator(prior, deleter, associator, updater, min_points=3),
        deleter=deleter,
        detector=feeder,
        data_associator=associator,
        updater=updater,
    )
    for time, tracks in tracker:
        print(time, feeder.association.targets.tolist())
        for row in sorted(numbers(track) for track in tracks):
            print(*row)


if __name__ == "__main__":
    main(int(sys.argv[1]))
