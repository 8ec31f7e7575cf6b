"""Recordings of radar plots: reading them from CSV, and grouping them by antenna rotation."""

from __future__ import annotations

from assoc._system.imports import lazy_names
from assoc.recordings.altitude import GARBLED_CODES, garbled_altitudes
from assoc.recordings.radar import radar_of, with_heights
from assoc.recordings.reading import read_plots
from assoc.recordings.recording import UNDECODED, Recording
from assoc.recordings.rotation import estimate_rotation
from assoc.recordings.several import scene_of_radars
from assoc.recordings.windows import Window, clustering_time_window, irregular_groups
from assoc.recordings.writing import write_plots, write_tracks

__all__ = [
    "GARBLED_CODES",
    "UNDECODED",
    "Recording",
    "Window",
    "clustering_time_window",
    "estimate_rotation",
    "garbled_altitudes",
    "irregular_groups",
    "radar_of",
    "read_plots",
    "scene_of_radars",
    "with_heights",
    "write_plots",
    "write_tracks",
]

__getattr__, __dir__ = lazy_names(__name__, {})
