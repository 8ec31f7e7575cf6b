"""Recordings of radar plots: reading them from CSV, and grouping them by antenna rotation."""

from __future__ import annotations

from assoc.recordings.altitude import GARBLED_CODES, garbled_altitudes
from assoc.recordings.groupings import fixed_groups, groups_of_sizes, irregular_groups
from assoc.recordings.radar import radar_of, with_heights
from assoc.recordings.reading import read_plots
from assoc.recordings.recording import UNDECODED, Recording
from assoc.recordings.rotation import estimate_rotation
from assoc.recordings.several import scene_of_radars
from assoc.recordings.windows import Window, clustering_time_window
from assoc.recordings.writing import write_plots, write_tracks

__all__ = [
    "GARBLED_CODES",
    "UNDECODED",
    "Recording",
    "Window",
    "clustering_time_window",
    "estimate_rotation",
    "fixed_groups",
    "garbled_altitudes",
    "groups_of_sizes",
    "irregular_groups",
    "radar_of",
    "read_plots",
    "scene_of_radars",
    "with_heights",
    "write_plots",
    "write_tracks",
]
