"""Tracks of a system as it reports them: positions and velocities with covariances."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.filters.motion.models import Motion
from assoc.tracking.records.initiation import velocity_components
from assoc.tracking.records.track import Track

_OPEN_HEIGHT, _OPEN_VELOCITY = 5e3, 200.0
"""Standard deviations of a height and of velocities that a system does not report, metres and m/s."""


class SystemTracks(NamedTuple):
    """The n tracks of one system at one time: positions and velocities."""

    ids: Array
    """Whole numbers above 0, (n,)."""
    mean: Array
    """x, y, z, vx, vy, vz; metres, m/s, (n, 6)."""
    covariance: Array
    """(n, 6, 6)."""
    existence: Array
    """Probability that there is a target, (n,)."""

    @staticmethod
    def of(tracks: Iterable[Track], motion: Motion) -> SystemTracks:
        """Those of a tracker, whose filter has this motion model."""
        tracks = list(tracks)
        components = np.concatenate([np.array(motion.position), velocity_components(motion)]).astype(np.int64)
        axes = len(motion.position)
        kept = np.concatenate([np.arange(axes), 3 + np.arange(len(components) - axes)])
        mean, covariance = open_states(len(tracks))
        for row, track in enumerate(tracks):
            mean[row, kept] = track.mean[components]
            covariance[row, kept[:, None], kept] = track.covariance[components[:, None], components]
        ids, existence = [track.track_id for track in tracks], [track.existence for track in tracks]
        return SystemTracks(np.array(ids, dtype=np.int64), mean, covariance, np.array(existence, dtype=np.float64))

    def moved(self, seconds: float | Array, noise: float) -> SystemTracks:
        """The tracks so many seconds later, with constant velocity and accelerations of this spectral density."""
        dt = np.broadcast_to(np.asarray(seconds, dtype=np.float64), (len(self.ids),))
        if not dt.any():
            return self
        F, Q = np.zeros((2, len(dt), 6, 6))
        F[:], i = np.eye(6), np.arange(3)
        F[:, i, i + 3] = dt[:, None]
        size = np.abs(dt)[:, None]
        Q[:, i, i], Q[:, i + 3, i + 3] = size**3 / 3.0, size
        Q[:, i, i + 3] = Q[:, i + 3, i] = dt[:, None] * size / 2.0
        mean = np.einsum("nij,nj->ni", F, self.mean)
        return self._replace(mean=mean, covariance=F @ self.covariance @ F.transpose(0, 2, 1) + noise**2 * Q)


def open_states(count: int) -> tuple[Array, Array]:
    """Means (n, 6) and covariances of tracks of which nothing is known but that they are near the plane z = 0."""
    covariance = np.zeros((count, 6, 6))
    covariance[:] = np.diag([0.0, 0.0, _OPEN_HEIGHT, *[_OPEN_VELOCITY] * 3]) ** 2
    return np.zeros((count, 6)), covariance


def check_tracks(tracks: SystemTracks, s: int) -> None:
    """Refuse tracks of system s of wrong shapes, equal ids, or states that are none."""
    n = len(tracks.ids)
    shapes = np.shape(tracks.mean), np.shape(tracks.covariance)
    if shapes != ((n, 6), (n, 6, 6)):
        raise InvalidInputError(f"tracks of system {s}: expected shapes {((n, 6), (n, 6, 6))}, got {shapes}")
    if len(np.unique(tracks.ids)) < n or (n and tracks.ids.min() < 1):
        raise InvalidInputError(f"tracks of system {s}: expected different ids above 0")
    if not np.isfinite(tracks.mean).all() or (n and not np.linalg.eigvalsh(tracks.covariance).min() > 0.0):
        raise InvalidInputError(f"tracks of system {s}: expected finite states and positive definite covariances")
