"""Trackers: measurements of scan after scan become tracks; see docs/tracking.md."""

from __future__ import annotations

from assoc.tracking.associate.joint_probabilistic import PairProbabilities
from assoc.tracking.births.initiation import Initiation
from assoc.tracking.identity_evidence import IdentityParameters
from assoc.tracking.life_cycle import LifeCycle
from assoc.tracking.live.late_plots import LatePlots
from assoc.tracking.live.live_tracker import LiveTracker
from assoc.tracking.live.pictures import Picture
from assoc.tracking.smoothing import smoothed
from assoc.tracking.track import Decision, Step, Track
from assoc.tracking.track_table import TrackTable, track_scene
from assoc.tracking.tracker import Tracker
from assoc.tracking.trackers import (
    HypothesisOrientedMHT,
    JointProbabilisticTracker,
    MultiSensorTracker,
    NearestNeighbourTracker,
    StaticFusionTracker,
    TrackOrientedMHT,
)

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
"""Trackers by the names that programs know them by."""

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
    "track_scene",
]
