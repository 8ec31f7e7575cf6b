"""A plain tracker to compare with: global nearest neighbour, one process noise, three detections of four scans."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.stats import chi2

from assoc._types import Array
from assoc.costs.positions import single_positions
from assoc.filters import ConstantVelocity, ExtendedKalmanFilter, UnscentedKalmanFilter
from assoc.filters.batches import concatenate
from assoc.scene import Scene
from assoc.tracking import Initiation
from assoc.tracking.filter_choice import open_heights, planar

GATE, NOISE, NEEDED, OF, MISSES = 0.999, 5.0, 3, 4, 5


class Shown(NamedTuple):
    """A track as it is judged."""

    track_id: int
    position: Array
    reported: bool


class PlainGNN:
    """Sensor after sensor, each by one assignment of squared distances; a scan is taken for one instant."""

    def __init__(self, scene: Scene, initiation: Initiation) -> None:
        self.scene, self.initiation = scene, initiation
        flat = planar(scene.sensors, scene.region)
        kind = UnscentedKalmanFilter if not flat and open_heights(scene.sensors) else ExtendedKalmanFilter
        self.filter: Any = kind(ConstantVelocity(NOISE, dimensions=2 if flat else 3, kind="continuous"))
        self.states: Any = None
        self.ids: list[int] = []
        self.seen: list[list[bool]] = []
        self.sure: set[int] = set()
        self.time, self.born = 0.0, 0

    def step(self, time: float, measurements: Sequence[Array], times: Any = None, sectors: Any = None) -> None:
        """Predict, associate sensor by sensor, start, confirm and end tracks."""
        if self.ids and time > self.time:
            self.states = self.filter.predict(self.states, time - self.time)
        self.time, self.now, hit = time, self.scene.at(time), np.zeros(len(self.ids), dtype=bool)
        for s, (z, sensor) in enumerate(zip(measurements, self.now.sensors, strict=True)):
            z = self.scene.sensors[s].aligned(z, np.full(len(z), time))
            free = np.ones(len(z), dtype=bool)
            if len(z) and self.ids:
                expected, gate = self.filter.expected(self.states, sensor), chi2.ppf(GATE, sensor.dim)
                off = np.stack([sensor.residual(z, mean) for mean in expected.mean])
                square = np.einsum("tmi,tij,tmj->tm", off, np.linalg.inv(expected.covariance), off)
                pairs = zip(*linear_sum_assignment(np.minimum(square, gate)), strict=True)
                taken = np.array([(t, m) for t, m in pairs if square[t, m] < gate]).reshape(-1, 2).astype(int)
                if len(taken):
                    done = self.filter.update(self.states[taken[:, 0]], z[taken[:, 1]], sensor).state
                    left = np.setdiff1d(np.arange(len(self.ids)), taken[:, 0])
                    order = np.argsort(np.concatenate([taken[:, 0], left]))
                    self.states = concatenate([done, self.states[left]])[order]
                    hit[taken[:, 0]], free[taken[:, 1]] = True, False
            hit = self._begin(s, z[free], hit)
        for seen, now in zip(self.seen, hit.tolist(), strict=True):
            seen.append(now)
        self.sure |= {i for i, seen in zip(self.ids, self.seen, strict=True) if sum(seen[-OF:]) >= NEEDED}
        kept = [k for k, (i, seen) in enumerate(zip(self.ids, self.seen, strict=True))
                if any(seen[-(MISSES if i in self.sure else 2) :])]  # fmt: skip
        if self.ids:
            self.states, self.ids, self.seen = (
                self.states[kept],
                [self.ids[k] for k in kept],
                [self.seen[k] for k in kept],
            )

    def _begin(self, s: int, z: Array, hit: Array) -> Array:
        """Start a track at each measurement that says where it is; whether tracks were detected, (T,)."""
        if not len(z):
            return hit
        places, covariances = single_positions(self.now, s, z)
        diagonal = float(np.linalg.norm(np.diff(self.scene.region, axis=1)))
        fit = np.flatnonzero((covariances[:, [0, 1], [0, 1]] <= (self.initiation.widest * diagonal) ** 2).all(axis=1))
        if not len(fit):
            return hit
        new = self.initiation.start(self.filter, places[fit], covariances[fit])
        self.states = new if not self.ids else concatenate([self.states, new])
        self.ids += range(self.born + 1, self.born + 1 + len(fit))
        self.born += len(fit)
        self.seen += [[] for _ in fit]
        return np.append(hit, np.ones(len(fit), dtype=bool))

    @property
    def tracks(self) -> list[Shown]:
        """All tracks; those are reported that were confirmed."""
        found = []
        for i, mean in zip(self.ids, self.states.mean if self.ids else (), strict=True):
            position = np.zeros(3)
            axes = list(self.filter.motion.position)
            position[: len(axes)] = mean[axes]
            found.append(Shown(i, position, i in self.sure))
        return found
