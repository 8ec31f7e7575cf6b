"""Trackers: measurements of scan after scan become tracks; see docs/tracking.md."""

from __future__ import annotations

from assoc.tracking.associate.joint_probabilistic import JointProbabilisticTracker, PairProbabilities
from assoc.tracking.associate.mht import TrackOrientedMHT
from assoc.tracking.associate.mht_hypothesis import HypothesisOrientedMHT
from assoc.tracking.associate.multi_sensor import MultiSensorTracker
from assoc.tracking.associate.nearest_neighbour import NearestNeighbourTracker
from assoc.tracking.associate.static import StaticFusionTracker
from assoc.tracking.associate.track_problem import track_problem
from assoc.tracking.live.late_plots import LatePlots
from assoc.tracking.live.live_tracker import LiveTracker
from assoc.tracking.live.pictures import Picture
from assoc.tracking.moving import MovingTargets
from assoc.tracking.offline.smoothing import smoothed
from assoc.tracking.records.identity_evidence import IdentityParameters
from assoc.tracking.records.initiation import Initiation
from assoc.tracking.records.life_cycle import LifeCycle
from assoc.tracking.records.track import Decision, Step, Track
from assoc.tracking.track_table import TrackTable, track_scene
from assoc.tracking.tracker import Tracker

TRACKERS: dict[str, type[Tracker]] = {
    kind.name: kind
    for kind in (
        MultiSensorTracker,
        StaticFusionTracker,
        TrackOrientedMHT,
        HypothesisOrientedMHT,
        NearestNeighbourTracker,
        JointProbabilisticTracker,
    )
}
"""Trackers by the names that programs use."""

__all__ = [
    "TRACKERS",
    "Decision",
    "HypothesisOrientedMHT",
    "IdentityParameters",
    "Initiation",
    "JointProbabilisticTracker",
    "LatePlots",
    "LifeCycle",
    "LiveTracker",
    "MovingTargets",
    "MultiSensorTracker",
    "NearestNeighbourTracker",
    "PairProbabilities",
    "Picture",
    "StaticFusionTracker",
    "Step",
    "Track",
    "TrackOrientedMHT",
    "TrackTable",
    "Tracker",
    "smoothed",
    "track_problem",
    "track_scene",
]
