"""How the trackers of all experiments are judged: GOSPA, OSPA(2), HOTA, identity switches, CPU time of a scan."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from assoc._types import Array
from assoc.metrics import Trajectories, gospa_over_time, hota, identity, mean_gospa, ospa2
from assoc.scene import Scene
from assoc.tracking import TRACKERS, Tracker
from experiments.common.claims import GOAL, Claim
from experiments.common.command import mean_interval
from experiments.trackers.oracle import OracleTracker
from experiments.trackers.running import through

CUTOFF = 500.0
"""Of GOSPA (order 2), OSPA(2) and HOTA, metres."""
NAMES = ("oracle", *TRACKERS, "GNN")


class Judged(NamedTuple):
    """One tracker on one scene."""

    distances: Array
    """GOSPA of each scan, metres."""
    parts: dict[str, float]
    """What it consists of: localisation, missed, false; metres, root mean squares."""
    ospa2: float
    hota: float
    switches: int
    milliseconds: float
    """CPU time of a scan, the median of all but the first."""


def make(name: str, scene: Scene) -> Tracker:
    """Make a tracker of this name, default settings."""
    if name == "oracle":
        return OracleTracker(scene)
    if name == "GNN":
        return TRACKERS["nearest-neighbour"].for_scene(scene, rule="assignment")
    return TRACKERS[name].for_scene(scene)


def judge(name: str, scene: Scene) -> Judged:
    """Run a tracker over a scene."""
    done, truth = through(make(name, scene), scene), Trajectories.from_scene(scene)
    _, windows = ospa2(truth, done.tracks, CUTOFF)
    return Judged(
        distances(scene, done.tracks),
        mean_gospa(gospa_over_time(truth, done.tracks, CUTOFF)[1]),
        float(np.mean([window.distance for window in windows])) if windows else 0.0,
        hota(truth, done.tracks, CUTOFF).hota,
        identity(truth, done.tracks, CUTOFF).switches,
        1e3 * float(np.median(done.seconds[1:])),
    )


def distances(scene: Scene, tracks: Trajectories, cutoff: float = CUTOFF) -> Array:
    """GOSPA of each scan, metres; 0 where neither a target nor a track is."""
    times, values = gospa_over_time(Trajectories.from_scene(scene), tracks, cutoff)
    by_time = dict(zip(times.tolist(), values, strict=True))
    return np.array([by_time[t].distance if t in by_time else 0.0 for t in scene.times.tolist()])


def means(runs: Sequence[Judged]) -> Array:
    """Mean GOSPA of each run, metres."""
    return np.array([run.distances.mean() for run in runs])


def claims_of(label: str, name: str, runs: Sequence[Judged]) -> list[Claim]:
    """What a tracker did on the scenes of one kind."""
    return [
        mean_claim(f"{label}, {name}: GOSPA", "m", means(runs)),
        mean_claim(f"{label}, {name}: OSPA(2)", "m", np.array([run.ospa2 for run in runs])),
        mean_claim(f"{label}, {name}: HOTA", "", np.array([run.hota for run in runs])),
        mean_claim(f"{label}, {name}: switches", "", np.array([float(run.switches) for run in runs])),
        Claim(f"{label}, {name}: CPU time of a scan", "ms", ours=float(np.median([run.milliseconds for run in runs]))),
    ]


def mean_claim(quantity: str, unit: str, values: Array) -> Claim:
    """The mean over scenes, with its interval where there are several."""
    interval = mean_interval(values) if len(values) > 1 else None
    return Claim(quantity, unit, ours=float(values.mean()), interval=interval)


def goal(quantity: str, unit: str, values: Array, most: float, *, surely: bool = True) -> Claim:
    """A goal for a mean over scenes: at most so much, with the whole interval, or if not `surely` with a part of it."""
    claim = mean_claim(f"goal: {quantity}", unit, values)
    low, high = claim.interval or (claim.ours, claim.ours)
    return replace(claim, band=(None, most), holds=(high if surely else low) <= most, source=GOAL)
