"""What a multi-sensor tracker must reach on the three-radar scene, and its time with a thousand targets."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from assoc import simulation
from assoc._types import Array
from assoc.scene import Scene
from assoc.tracking import MultiSensorTracker, Tracker
from experiments.trackers.running import through

NEAR = 400.0
"""A track within this distance of a target is that target's; further from every target it is false, metres."""


class ThreeRadar(NamedTuple):
    """Sums over seeds of the three-radar scene."""

    late: int
    """Targets without a confirmed track after their second scan."""
    lost: int
    """Instants after the second scan at which a target has no confirmed track."""
    instants: int
    false: int
    """Confirmed tracks that were far from every target when they were confirmed."""
    multi: float
    """Mean squared position error of tracks."""
    best: float
    """The same of the best radar alone."""


def three_radar(seed: int, scans: int, single: bool) -> ThreeRadar:
    """One seed; `single` also tracks with each radar alone, the same tracker with one sensor."""
    scene = simulation.simulate("three-radar", seed, scans=scans)
    run = through(MultiSensorTracker.for_scene(scene), scene)
    late = lost = instants = false = 0
    known: set[int] = set()
    errors = []
    for k in range(scene.num_scans):
        ids, places = run.confirmed[k]
        truth = scene.scan(k).truth_positions
        away = np.linalg.norm(truth[:, None] - places[None], axis=2)
        near = away.min(axis=1, initial=np.inf)
        if k >= 1:
            late += int((near > NEAR).sum()) if k == 1 else 0
            lost += int((near > NEAR).sum())
            instants += len(near)
            errors.append(near[near <= NEAR])
        for column, i in enumerate(ids.tolist()):
            if i not in known:
                known.add(i)
                false += bool(away[:, column].min() > NEAR)
    multi = float(np.mean(np.concatenate(errors) ** 2))
    best = min(_alone(scene, s) for s in range(len(scene.sensors))) if single else np.nan
    return ThreeRadar(late, lost, instants, false, multi, best)


def _alone(scene: Scene, s: int) -> float:
    """Mean squared position error with one radar, where it has a track of the target."""
    truth = scene.truth
    sources = [[scan[s]] for scan in truth.sources]
    measurements = [[scan[s]] for scan in scene.measurements]
    known = replace(truth, sources=sources)
    seen = replace(scene, sensors=[scene.sensors[s]], measurements=measurements, truth=known)
    run = through(MultiSensorTracker.for_scene(seen), seen)
    errors = []
    for k in range(1, seen.num_scans):
        away = np.linalg.norm(truth.positions[k][:, None] - run.confirmed[k][1][None], axis=2)
        near = away.min(axis=1, initial=np.inf)
        errors.append(near[near <= 2 * NEAR])
    return float(np.mean(np.concatenate(errors) ** 2))


def crowd(kind: type[Tracker], targets: int, scans: int, seed: int) -> tuple[Array, Array, int]:
    """Many targets, three radars: CPU seconds and confirmed tracks of each scan, targets tracked at the end."""
    scene = simulation.simulate(
        "crowd", seed, targets=targets, scans=scans, sensor="radar", width=10_000.0, height=5_000.0, noise=100.0
    )
    run = through(kind.for_scene(scene), scene)
    truth = scene.scan(scans - 1).truth_positions
    away = np.linalg.norm(truth[:, None] - run.confirmed[-1][1][None], axis=2)
    counts = np.array([len(ids) for ids, _ in run.confirmed])
    return run.seconds, counts, int((away.min(axis=1, initial=np.inf) < 3 * 100.0).sum())
