"""A scan of a tracker among many targets: the worst, which is one of the first, and the median of the later ones."""

from typing import Any

import numpy as np
from scipy.spatial import cKDTree

import assoc
from assoc.simulation import simulate
from assoc.tracking import TRACKERS
from experiments.common.measuring import processor_time
from experiments.scale.alone import Measured

SETTLED = 5
"""Scans before those whose median is taken."""
NEAR = 400.0
"""Metres from a target to a track that is its."""


def measure(kind: str, targets: int, scans: int) -> Measured:
    """Processor time of a scan, the worst and the median, and the share of targets near a confirmed track at the end.

    100 targets in 25 x 25 x 2 km, scans of 4 s, three position sensors of 100 m, P_d 0.9, 10 % false alarms.
    """
    about = {"scans": scans, "interval": 4.0, "width": 25_000.0, "constant_density": True}
    assoc.warm_up()
    for few in (30, 100, 300):
        follow(kind, few, 0, about)
    spent, found = follow(kind, targets, 1, about)
    return {"worst": max(spent), "worst scan": float(np.argmax(spent)) + 1.0,
            "median": float(np.median(spent[SETTLED:])), **found}  # fmt: skip


def follow(kind: str, targets: int, seed: int, about: dict[str, Any]) -> tuple[list[float], Measured]:
    """Processor time of each scan; the share of targets tracked and the confirmed tracks at the end."""
    scene = simulate("crowd", seed, targets=targets, **about)
    tracker = TRACKERS[kind].for_scene(scene)
    spent = []
    for k in range(scene.num_scans):
        spent.append(processor_time(tracker.step, scene.times[k], scene.measurements[k])[1])
    places = np.array([track.position for track in tracker.tracks if track.confirmed]).reshape(-1, 3)
    truth = scene.scan(scene.num_scans - 1).truth_positions
    near = np.asarray(cKDTree(places).query(truth)[0]) < NEAR
    return spent, {"tracked": 100.0 * float(near.mean()), "confirmed": float(len(places))}


AIRCRAFT = 500
HOUR: dict[str, Any] = {
    "scans": 900,
    "interval": 4.0,
    "sensor": "radar",
    "width": 400_000.0,
    "height": 12_000.0,
    "speed": 250.0,
}


def hour(kind: str) -> Measured:
    """Processor time and plots of an hour: three radars that turn in 4 s, 500 aircraft at a time."""
    assoc.warm_up()
    follow(kind, 100, 0, {**HOUR, "scans": 20})
    scene = simulate("crowd", 1, targets=AIRCRAFT, **HOUR)
    spent, found = follow(kind, AIRCRAFT, 1, HOUR)
    plots = sum(len(z) for scan in scene.measurements for z in scan)
    return {"seconds": sum(spent), "plots": float(plots), "tracked": found["tracked"]}
