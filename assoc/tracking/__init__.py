"""Trackers: measurements of scan after scan become tracks; see docs/tracking.md."""

from __future__ import annotations

from assoc.tracking.initiation import Initiation
from assoc.tracking.life_cycle import LifeCycle
from assoc.tracking.track import Decision, Step, Track
from assoc.tracking.track_oriented import TrackOrientedMHT
from assoc.tracking.tracker import Tracker

__all__ = ["Decision", "Initiation", "LifeCycle", "Step", "Track", "TrackOrientedMHT", "Tracker"]
