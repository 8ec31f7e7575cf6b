"""Three trackers, one of each radar: which tracks are of one target, and one estimate of each."""

from associator import hypothesiser, with_associator
from scene import make, show
from stonesoup.dataassociator.neighbour import GNNWith2DAssignment
from stonesoup.feeder.multi import MultiDataFeeder
from stonesoup.feeder.track import Tracks2GaussianDetectionFeeder

from assoc.integrations.stonesoup import TrackFusionTracker


def sites(stream):
    """A tracker of each radar."""
    return [with_associator(GNNWith2DAssignment(hypothesiser), stream[radar::3], 4) for radar in range(3)]


def ways(seed):
    """One radar alone, Stone Soup's way (tracks as detections of another tracker), and ours."""
    stream, paths = make(seed)
    yield "first radar alone", sites(stream)[0], paths
    feeders = MultiDataFeeder([Tracks2GaussianDetectionFeeder(site) for site in sites(stream)])
    yield "tracks as detections", with_associator(GNNWith2DAssignment(hypothesiser), feeders), paths
    yield "fused", TrackFusionTracker(sites(stream)), paths


if __name__ == "__main__":
    show(ways)
