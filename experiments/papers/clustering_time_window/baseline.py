"""A small nearest-neighbour tracker, as strong or as weak as its settings: the yardstick of the experiment."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.optimize import linear_sum_assignment

from assoc._types import Array
from assoc.recordings import Window


@dataclass(frozen=True)
class NearestSettings:
    """What the tracker knows and how it keeps house.

    clock: Each plot's own time stamp, or the same number of seconds from group to group.
    deletion: A track ends after `patience` seconds, or after `patience` groups, without a plot.
    confirmation: Plots that make a track confirmed.
    gate: Largest squared Mahalanobis distance, two degrees of freedom.
    process_noise: Root of the acceleration's spectral density, m/s^1.5.
    speed: Standard deviation of a new track's velocity along each axis, m/s.
    """

    clock: Literal["stamps"] | float = "stamps"
    deletion: Literal["time", "groups"] = "time"
    patience: float = 40.0
    confirmation: int = 3
    gate: float = 16.0
    process_noise: float = 10.0
    speed: float = 200.0


class NearestNeighbourTracker:
    """Global nearest neighbour on a planar Kalman filter: at most one plot a track and group, all others start tracks.

    range_noise, azimuth_noise: Standard deviations of a plot, metres and radians.
    """

    def __init__(self, range_noise: float, azimuth_noise: float, settings: NearestSettings) -> None:
        self.noise = np.array([range_noise, azimuth_noise]) ** 2
        self.settings = settings
        self.mean = np.zeros((0, 4))
        self.covariance = np.zeros((0, 4, 4))
        self.when, self.group, self.hits, self.ids = (np.zeros(0) for _ in range(4))
        self.groups = 0
        self.next_id = 0

    def take(self, window: Window) -> tuple[Array, Array]:
        """Take a group of plots; return the track of each and whether it is confirmed then."""
        s = self.settings
        self.groups += 1
        now = window.times if s.clock == "stamps" else np.full(len(window), self.groups * float(s.clock))
        latest = float(now.max()) if len(now) else -np.inf
        silent = latest - self.when if s.deletion == "time" else self.groups - 1 - self.group
        self._keep(silent < s.patience if s.deletion == "groups" else silent <= s.patience)
        places, noises = self._plane(window.measurements)
        tracks, plots, mean, covariance = self._associate(places, noises, now)
        taken = np.full(len(window), -1)
        taken[plots] = tracks
        new = np.flatnonzero(taken < 0)
        self.mean[tracks], self.covariance[tracks] = mean, covariance
        self.when[tracks], self.group[tracks] = now[plots], self.groups
        self.hits[tracks] += 1
        taken[new] = np.arange(len(self.ids), len(self.ids) + len(new))
        self._start(places[new], noises[new], now[new])
        return self.ids[taken].astype(np.int64), self.hits[taken] >= s.confirmation

    def _keep(self, rows: Array) -> None:
        for name in ("mean", "covariance", "when", "group", "hits", "ids"):
            setattr(self, name, getattr(self, name)[rows])

    def _plane(self, measurements: Array) -> tuple[Array, Array]:
        """Plots as places (n, 2) with covariances (n, 2, 2)."""
        distance, azimuth = measurements.T
        cos, sin = np.cos(azimuth), np.sin(azimuth)
        J = np.stack([np.stack([cos, -distance * sin], axis=1), np.stack([sin, distance * cos], axis=1)], axis=1)
        return distance[:, None] * np.stack([cos, sin], axis=1), (J * self.noise) @ J.transpose(0, 2, 1)

    def _associate(self, places: Array, noises: Array, now: Array) -> tuple[Array, Array, Array, Array]:
        """Pairs of tracks and plots at the least total distance, and the corrected states."""
        T, n = len(self.mean), len(places)
        if not T or not n:
            nothing = np.zeros(0, dtype=np.int64)
            return nothing, nothing, np.zeros((0, 4)), np.zeros((0, 4, 4))
        # every track at the time of every plot
        dt = np.maximum(now - self.when[:, None], 0.0)
        F = np.broadcast_to(np.eye(4), (T, n, 4, 4)).copy()
        F[:, :, 0, 2] = F[:, :, 1, 3] = dt
        Q = np.zeros((T, n, 4, 4))
        for axis in (0, 1):
            Q[:, :, axis, axis] = dt**3 / 3
            Q[:, :, axis, axis + 2] = Q[:, :, axis + 2, axis] = dt**2 / 2
            Q[:, :, axis + 2, axis + 2] = dt
        mean = np.einsum("tnij,tj->tni", F, self.mean)
        covariance = F @ self.covariance[:, None] @ F.transpose(0, 1, 3, 2) + self.settings.process_noise**2 * Q
        S = covariance[:, :, :2, :2] + noises
        off = places - mean[:, :, :2]
        distance = np.einsum("tni,tnij,tnj->tn", off, np.linalg.inv(S), off)
        cost = np.where(distance <= self.settings.gate, distance, 1e6)
        tracks, plots = linear_sum_assignment(cost)
        good = cost[tracks, plots] < 1e6
        tracks, plots = tracks[good], plots[good]
        P, z = covariance[tracks, plots], off[tracks, plots]
        K = P[:, :, :2] @ np.linalg.inv(S[tracks, plots])
        return (tracks, plots, mean[tracks, plots] + np.einsum("kij,kj->ki", K, z), P - K @ P[:, :2])

    def _start(self, places: Array, noises: Array, now: Array) -> None:
        count = len(places)
        covariance = np.zeros((count, 4, 4))
        covariance[:, :2, :2] = noises
        covariance[:, 2:, 2:] = self.settings.speed**2 * np.eye(2)
        self.mean = np.concatenate([self.mean, np.concatenate([places, np.zeros((count, 2))], axis=1)])
        self.covariance = np.concatenate([self.covariance, covariance])
        self.when = np.concatenate([self.when, now])
        self.group = np.concatenate([self.group, np.full(count, self.groups)])
        self.hits = np.concatenate([self.hits, np.ones(count)])
        self.ids = np.concatenate([self.ids, self.next_id + np.arange(count)])
        self.next_id += count
