"""Adapter to Stone Soup 1.9: its trackers with our solvers, fused detections, and scenes in both directions.

``pip install 'assoc[stonesoup]'``. Stone Soup knows it as the plugin ``stonesoup.plugins.assoc``, too. Sets are sorted
by content before use, so that results do not depend on their iteration order, which changes from run to run.
"""

from __future__ import annotations

try:
    import stonesoup as _stonesoup  # noqa: F401
except ImportError as error:
    raise ImportError("the adapter needs Stone Soup: pip install 'assoc[stonesoup]'") from error

from assoc._text.removed import removed
from assoc.errors import RemovedError
from assoc.integrations.stonesoup.adapted import AdaptedSensor, adapt
from assoc.integrations.stonesoup.associator import AssignmentAssociator, AssignmentInitiator
from assoc.integrations.stonesoup.fusion import FusionFeeder
from assoc.integrations.stonesoup.models import CartesianToSlantRangeBearing, measurement_model
from assoc.integrations.stonesoup.readers import SceneDetectionReader, SceneGroundTruthReader
from assoc.integrations.stonesoup.scenes import scene_from_detections

__all__ = [
    "AdaptedSensor",
    "AssignmentAssociator",
    "AssignmentInitiator",
    "CartesianToSlantRangeBearing",
    "FusionFeeder",
    "SceneDetectionReader",
    "SceneGroundTruthReader",
    "adapt",
    "measurement_model",
    "scene_from_detections",
]


def __getattr__(name: str) -> object:
    if line := removed(f"{__name__}.{name}"):
        raise RemovedError(line)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
