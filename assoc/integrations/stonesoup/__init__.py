"""Adapter to Stone Soup 1.9: its trackers with our solvers, and scenes in both directions.

``pip install 'assoc[stonesoup]'``. Stone Soup knows it as the plugin ``stonesoup.plugins.assoc``, too. Sets are sorted
by content before use, so that results do not depend on their iteration order, which changes from run to run.
"""

from __future__ import annotations

try:
    import stonesoup as _stonesoup  # noqa: F401
except ImportError as error:
    raise ImportError("the adapter needs Stone Soup: pip install 'assoc[stonesoup]'") from error

from assoc.integrations.stonesoup.adapted import AdaptedSensor, adapt
from assoc.integrations.stonesoup.associator import AssignmentAssociator
from assoc.integrations.stonesoup.fusion import FusionFeeder
from assoc.integrations.stonesoup.initiator import AssignmentInitiator
from assoc.integrations.stonesoup.models import CartesianToSlantRangeBearing, measurement_model
from assoc.integrations.stonesoup.readers import SceneDetectionReader, SceneGroundTruthReader
from assoc.integrations.stonesoup.registration import RegistrationFeeder
from assoc.integrations.stonesoup.scenes import scene_from_detections
from assoc.integrations.stonesoup.track_fusion import TrackFusionTracker
from assoc.integrations.stonesoup.tracker import AssocTracker

__all__ = [
    "AdaptedSensor",
    "AssignmentAssociator",
    "AssignmentInitiator",
    "AssocTracker",
    "CartesianToSlantRangeBearing",
    "FusionFeeder",
    "RegistrationFeeder",
    "SceneDetectionReader",
    "SceneGroundTruthReader",
    "TrackFusionTracker",
    "adapt",
    "measurement_model",
    "scene_from_detections",
]
