"""Sensors and their measurements, scan by scan, with the truth where it is known."""

from assoc.scene.scene import Scan, Scene, Truth

__all__ = ["Scan", "Scene", "Truth"]
