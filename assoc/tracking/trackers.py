"""The trackers: how each associates is told by a file of `assoc.tracking.associate`."""

from __future__ import annotations

from assoc._types import Array
from assoc.tracking.associate.joint_probabilistic import JointProbabilistic, PairProbabilities
from assoc.tracking.associate.mht import TrackTrees
from assoc.tracking.associate.mht_hypothesis import ClusteredHypotheses
from assoc.tracking.associate.multi_sensor import MultiSensor
from assoc.tracking.associate.nearest_neighbour import NearestNeighbour
from assoc.tracking.associate.static import StaticFusion
from assoc.tracking.tracker import Tracker


class MultiSensorTracker(Tracker):
    """Tracks and S sensors in one (S+1)-D assignment problem for each scan.

    Tracks are the first list. A tuple (track, z_1, ..., z_S) costs the negative log likelihood ratio of its
    measurements under the track's predicted density, misses included, averaged over whether the track is a target
    at all, which its score tells; a tuple without a track is a new target
    and costs what `assoc.build_problem` says, with the birth density in it. Measurements in no tuple are false
    alarms, and begin tentative tracks.

    Parameters
    ----------
    sensors, filter, **options
        As for `Tracker`.

    References
    ----------
    Y. Bar-Shalom, P. Willett, X. Tian, Tracking and Data Fusion, 2011, chapter 9.
    """

    name = "multi-sensor"
    method = MultiSensor


class StaticFusionTracker(Tracker):
    """S-D fusion of each scan by itself, then a 2-D assignment of the fused tuples to the tracks.

    The S-D problem knows nothing of the tracks: what it puts together stays together. Single measurements go
    to the tracks as tuples of one. A tuple's cost for a track is that of all its measurements under the
    track's predicted density, misses included, averaged over whether the track is a target at all.

    Parameters
    ----------
    sensors, filter, **options
        As for `Tracker`.
    """

    name = "static"
    method = StaticFusion


class TrackOrientedMHT(Tracker):
    """Multiple hypothesis tracker with track trees.

    Parameters
    ----------
    sensors, filter, ...
        As for `Tracker`. Sensors of a scan are taken in one after the other.
    depth : int
        Scans in the window, N: a measurement's track is final N - 1 scans later. 1 decides at once; at most 1000.
    max_branches : int
        The most branches of a tree (30).
    branch_drop : float
        A branch is cut if every global hypothesis that contains it scores this much less than the best one: 7 is a
        thousandth of its probability. Of more than `max_branches` those stay that cost the best hypothesis least.
    **options
        As for `Tracker`.
    """

    name = TrackTrees.name
    method = TrackTrees


class HypothesisOrientedMHT(Tracker):
    """Multiple hypothesis tracker that keeps the m best hypotheses about each cluster of tracks.

    Parameters
    ----------
    sensors, filter, ...
        As for `Tracker`. Sensors of a scan are taken in one after the other. The `solver` is not used: the ranking is
        Murty's.
    max_hypotheses : int
        m (50).
    depth : int
        Scans after which a decision is final, n (3); at most 1000.
    hypothesis_drop : float
        A hypothesis whose log-probability is this far below the best of its cluster is dropped (15).
    **options
        As for `Tracker`.
    """

    name = "mht-hypothesis"
    method = ClusteredHypotheses

    @property
    def probabilities(self) -> Array:
        """Probabilities of the best hypotheses about everything, the best first; at most `max_hypotheses` of them."""
        found: Array = self.settings.method.probabilities(self.state.own)
        return found


class NearestNeighbourTracker(Tracker):
    """The plain tracker that others are measured against.

    The sensors of a scan are taken in one after the other, whatever the measurements' times. Pairs of tracks and
    measurements within the gate are taken by falling likelihood, averaged over whether the track is a target at all;
    what is left over starts a track at once, which the next sensor may confirm.

    Parameters
    ----------
    sensors, filter, ...
        As for `Tracker`.
    rule : "greedy" or "assignment"
        "assignment" takes the best 2-D assignment instead (global nearest neighbour), by the tracker's solver.
    **options
        As for `Tracker`.
    """

    name = "nearest-neighbour"
    method = NearestNeighbour


class JointProbabilisticTracker(Tracker):
    """Joint integrated probabilistic data association, with certified probabilities.

    Parameters
    ----------
    sensors, filter, ...
        As for `Tracker`; the filter's states must be Gaussian or mixtures of models. The `solver` is not used.
    max_events : int
        Joint events, as far as they are summed, that are kept apart at a time in a cluster of tracks and measurements
        (4096). Where a cluster would need more, its least likely pairs are left out: more make the intervals narrower.
    **options
        As for `Tracker`.
    """

    name = "joint-probabilistic"
    method = JointProbabilistic

    @property
    def probabilities(self) -> tuple[PairProbabilities, ...]:
        """Of the last step, for each sensor."""
        found: tuple[PairProbabilities, ...] = self.state.own
        return found
