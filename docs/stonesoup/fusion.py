"""One set of fused detections in front of a tracker, in place of three radars' one after the other."""

from associator import hypothesiser, with_associator
from scene import SENSORS, make, show
from stonesoup.dataassociator.neighbour import GNNWith2DAssignment

from assoc.integrations.stonesoup import FusionFeeder


def ways(seed):
    """The same tracker, which counts four fused detections as much as seven of single radars."""
    stream, paths = make(seed)
    gnn = GNNWith2DAssignment(hypothesiser)
    yield "Stone Soup's GNN", with_associator(gnn, stream), paths
    yield "fused", with_associator(gnn, FusionFeeder(stream, SENSORS), points=4), paths


if __name__ == "__main__":
    show(ways)
