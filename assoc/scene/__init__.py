"""Sensors and their measurements, scan by scan, with the truth where it is known."""

from assoc.scene.scan import Scan
from assoc.scene.scene import Scene
from assoc.scene.truth import Truth

__all__ = ["Scan", "Scene", "Truth"]
