"""Benchmark B1: one radar, a target 100 km away, bearings so coarse that an EKF fails."""

import math
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from assoc._types import Array
from assoc.filters import Gaussian, nees
from assoc.filters.base import Filter
from assoc.filters.motion.models import ConstantVelocity
from assoc.sensors import Radar3D


def radar_of(noise: ArrayLike) -> Radar3D:
    """Return a radar at the origin that sees all directions, of this noise."""
    everywhere = [[0.0, 1e6], [-math.pi, math.pi], [-math.pi / 2, math.pi / 2]]
    return Radar3D(position=np.zeros(3), noise=noise, field_of_view=everywhere)


@dataclass(frozen=True)
class Setting:
    """A radar and a target of nearly constant velocity; the defaults are B1."""

    distance: float = 100_000.0
    elevation: float = math.radians(10.0)
    range_noise: float = 30.0
    angle_noise: float = math.radians(1.5)
    interval: float = 1.0
    steps: int = 100
    velocity: tuple[float, float, float] = (-150.0, -200.0, -10.0)
    acceleration_noise: float = 0.01
    azimuth: float = math.radians(45.0)

    @property
    def beta(self) -> float:
        """What decides whether an EKF can be trusted: r sigma_angle^2 / sigma_range."""
        return self.distance * self.angle_noise**2 / self.range_noise

    @property
    def radar(self) -> Radar3D:
        """The radar, at the origin."""
        return radar_of([self.range_noise, self.angle_noise, self.angle_noise])

    @property
    def motion(self) -> ConstantVelocity:
        """The motion model, that of the target."""
        return ConstantVelocity(self.acceleration_noise)


@dataclass(frozen=True)
class Runs:
    """Truth (K + 2, runs, 6) and measurements (K + 2, runs, 3); the first two start the filters."""

    setting: Setting
    truth: Array
    measured: Array

    @classmethod
    def draw(cls, setting: Setting, count: int, rng: np.random.Generator) -> Self:
        """Draw independent runs, azimuths spread evenly unless the setting gives one."""
        s = setting
        F, Q = (matrix[0] for matrix in s.motion.matrices(s.interval))
        factor = np.linalg.cholesky(Q + 1e-18 * np.eye(6))
        flat = s.distance * math.cos(s.elevation)
        position = (flat * math.cos(s.azimuth), flat * math.sin(s.azimuth), s.distance * math.sin(s.elevation))
        states = [np.tile(np.array([*position, *s.velocity]), (count, 1))]
        for _ in range(s.steps + 1):
            states.append(states[-1] @ F.T + rng.standard_normal((count, 6)) @ factor.T)
        truth = np.stack(states)
        exact = s.radar.measure(truth.reshape(-1, 6)[:, :3]).reshape(*truth.shape[:2], 3)
        measured = exact + rng.standard_normal(exact.shape) * s.radar.noise
        return cls(setting, truth, measured)

    def start(self) -> Gaussian:
        """Two-point start: positions and velocities of the first two measurements, converted plainly."""
        s, R = self.setting, self.setting.radar.covariance
        positions, spreads = zip(*(converted(z, R) for z in self.measured[:2]), strict=True)
        T = s.interval
        mean = np.concatenate([positions[1], (positions[1] - positions[0]) / T], axis=1)
        P = np.zeros((len(mean), 6, 6))
        P[:, :3, :3] = spreads[1]
        P[:, :3, 3:] = P[:, 3:, :3] = spreads[1] / T
        P[:, 3:, 3:] = (spreads[0] + spreads[1]) / T**2 + s.acceleration_noise**2 * T**2 * np.eye(3)
        return Gaussian(mean, P)


def converted(z: Array, R: Array) -> tuple[Array, Array]:
    """Positions that radar measurements (B, 3) point at, and their covariances."""
    r, t, p = z.T
    ct, st, cp, sp = np.cos(t), np.sin(t), np.cos(p), np.sin(p)
    position = np.stack([r * ct * cp, r * st * cp, r * sp], axis=1)
    J = np.empty((len(z), 3, 3))
    J[:, 0] = np.stack([ct * cp, -r * st * cp, -r * ct * sp], axis=1)
    J[:, 1] = np.stack([st * cp, r * ct * cp, -r * st * sp], axis=1)
    J[:, 2] = np.stack([sp, np.zeros_like(r), r * cp], axis=1)
    # along the line of sight the curvature adds to the spread
    curved = 0.5 * r**2 * (R[1, 1] ** 2 + R[2, 2] ** 2)
    sight = J[:, :, 0]
    return position, J @ R @ J.transpose(0, 2, 1) + curved[:, None, None] * sight[:, :, None] * sight[:, None, :]


@dataclass(frozen=True)
class Result:
    """Second half of the runs: squared position errors (K/2, runs), and NEES of the same shape."""

    squared: Array
    nees: Array

    @property
    def rmse(self) -> float:
        """Root mean squared position error, m."""
        return float(np.sqrt(self.squared.mean()))


def run(filter_: Filter[Any], runs: Runs, start: Gaussian | None = None) -> Result:
    """Filter all runs at once; errors of the second half."""
    state = filter_.start(runs.start() if start is None else start)
    radar, steps = runs.setting.radar, runs.setting.steps
    squared, all_nees = [], []
    for k in range(2, len(runs.truth)):
        state = filter_.predict(state, runs.setting.interval)
        state = filter_.update(state, runs.measured[k], radar).state
        if k >= 2 + steps // 2:
            error = state.mean[:, :3] - runs.truth[k][:, :3]
            squared.append((error**2).sum(axis=1))
            all_nees.append(nees(state, runs.truth[k]))
    return Result(np.array(squared), np.array(all_nees))


def ratio_interval(numerator: Array, denominator: Array, rng: np.random.Generator) -> tuple[float, float]:
    """Bootstrap 95 % interval of a ratio of RMSEs over paired runs; squared errors (K, runs)."""
    top, bottom = numerator.mean(axis=0), denominator.mean(axis=0)
    index = rng.integers(len(top), size=(1000, len(top)))
    ratios = np.sqrt(top[index].mean(axis=1) / bottom[index].mean(axis=1))
    low, high = np.percentile(ratios, [2.5, 97.5])
    return float(low), float(high)
