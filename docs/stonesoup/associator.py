"""Our solvers as data associator of Stone Soup's trackers, beside its global nearest neighbour."""

from scene import deleter, make, predictor, prior, show, updater
from stonesoup.dataassociator.neighbour import GNNWith2DAssignment
from stonesoup.hypothesiser.distance import DistanceHypothesiser
from stonesoup.initiator.simple import MultiMeasurementInitiator
from stonesoup.measures import Mahalanobis
from stonesoup.tracker.simple import MultiTargetTracker

from assoc.integrations.stonesoup import AssignmentAssociator

hypothesiser = DistanceHypothesiser(predictor, updater, Mahalanobis(), missed_distance=3)


def with_associator(associator, stream, points=7):
    """A tracker that starts tracks with so many detections."""
    initiator = MultiMeasurementInitiator(prior, deleter, associator, updater, min_points=points)
    return MultiTargetTracker(initiator, deleter, stream, associator, updater)


def ways(seed):
    """Theirs and ours; any other solver takes its name and parameters, as "aco", {"ants": 10}."""
    stream, paths = make(seed)
    yield "Stone Soup's GNN", with_associator(GNNWith2DAssignment(hypothesiser), stream), paths
    yield "exact", with_associator(AssignmentAssociator(hypothesiser), stream), paths


if __name__ == "__main__":
    show(ways)
