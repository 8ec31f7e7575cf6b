"""Simulated scenes and recordings: trajectories, sensors that observe them, and named scenarios."""

from __future__ import annotations

from assoc.simulation.observation import observe
from assoc.simulation.scenarios import names, parameters, recording_names, simulate, simulate_recording
from assoc.simulation.trajectories import Trajectory

__all__ = [
    "Trajectory",
    "names",
    "observe",
    "parameters",
    "recording_names",
    "simulate",
    "simulate_recording",
]
