"""A good call of each public function; what is not here is called with wrong arguments alone."""

from functools import cache
from typing import Any

import numpy as np

import assoc
from assoc import sweeps
from assoc.metrics import Trajectories
from assoc.simulation import simulate
from assoc.solvers.greedy.parameters import GreedyParameters
from assoc.tracking import TRACKERS, TrackTable


@cache
def scene() -> assoc.Scene:
    return simulate("three-radar", 1, scans=2)


@cache
def problem() -> assoc.AssignmentProblem:
    return assoc.build_problem(scene(), 0)


@cache
def solution() -> assoc.Solution:
    return assoc.assign(problem())


def tracker() -> Any:
    return TRACKERS["multi-sensor"].for_scene(scene())


def trajectories() -> Trajectories:
    return Trajectories.from_scene(scene())


def examples() -> dict[str, dict[str, Any]]:
    """By the name of the room and the function: its arguments by name."""
    one, points = scene(), np.zeros((2, 3))
    radar = {
        "position": [0.0, 0.0, 0.0],
        "noise": [10.0, 0.01, 0.01],
        "field_of_view": [[0, 1e5], [-3.14, 3.14], [0, 1.5]],
    }
    pair = {"truth": trajectories(), "tracks": trajectories(), "cutoff": 10.0}
    return {
        "assoc.AssignmentProblem": {"tuples": [[1, 0], [0, 1], [1, 1]], "costs": [0.0, 0.0, -1.0], "sizes": [1, 1]},
        "assoc.Scene": {
            "sensors": one.sensors,
            "times": one.times,
            "measurements": one.measurements,
            "region": one.region,
            "truth": one.truth,
            "name": "x",
            "measurement_times": None,
            "sectors": None,
            "origin": None,
            "notes": {},
        },
        "assoc.assign": {
            "problem": problem(),
            "solver": "aco",
            "seed": 1,
            "time_limit": 5.0,
            "callback": lambda point: None,
            "start": solution(),
            "watch": lambda cycle: None,
            "advise": True,
            "proof": None,
        },
        "assoc.associate": {
            "scene": one,
            "solver": "exact",
            "seed": 1,
            "time_limit": 5.0,
            "jobs": 1,
            "gating": {},
        },
        "assoc.build_problem": {
            "scene": one,
            "scan": 0,
            "gate_probability": 0.99,
            "max_tuples": 1000,
            "speed": 100.0,
            "target_density": None,
            "all_tuples": False,
        },
        "assoc.kbest": {"problem": problem(), "k": 2, "time_limit": 5.0},
        "assoc.load": {"path": "missing.npz"},
        "assoc.marginals": {"problem": problem(), "time_limit": 5.0},
        "assoc.scene.Truth": {
            "target_ids": one.truth.target_ids,
            "positions": one.truth.positions,
            "sources": None,
            "names": {},
        },
        "assoc.sensors.Radar3D": radar,
        "assoc.solvers.register": {"name": "greedy", "parameters": GreedyParameters, "solve": print},
        "assoc.sweeps.Study": {
            "sources": one,
            "settings": sweeps.grid("greedy", {}),
            "repeats": 1,
            "seed": 0,
            "time_limit": None,
            "gating": {},
            "scans": None,
        },
        "assoc.sweeps.grid": {"solver": "aco", "space": {"alpha": [1.0]}},
        "assoc.tracking.track_scene": {"tracker": tracker(), "scene": one, "confirmed": True, "scans": None},
        "assoc.metrics.gospa": {"truth": points, "estimates": points, "cutoff": 10.0, "order": 2.0},
        "assoc.metrics.ospa": {"truth": points, "estimates": points, "cutoff": 10.0, "order": 2.0},
        "assoc.metrics.identity": pair,
        "assoc.simulation.simulate": {"name": "three-radar", "seed": 1},
        "assoc.plotting.plot_tracks": {"tracks": TrackTable()},
    }
