"""Tracks of several systems as one picture."""

from assoc.tracking.fusion.systems import SystemTracks, open_states
from assoc.tracking.fusion.tables import fuse_tables
from assoc.tracking.fusion.track_fusion import FusedPicture, FusionParameters, TrackFusion, intersected

__all__ = [
    "FusedPicture", "FusionParameters", "SystemTracks", "TrackFusion", "fuse_tables", "intersected", "open_states",
]  # fmt: skip
