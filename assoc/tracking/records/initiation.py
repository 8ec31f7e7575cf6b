"""How a track begins: a position with its covariance, and a prior for the other components of the state."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from assoc._parameters import described, positive
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.filters.base import Filter
from assoc.filters.motion.models import Motion
from assoc.filters.state import gaussian
from assoc.sensors.arrays import numbers


@dataclass(frozen=True)
class Initiation:
    """Prior of a new track.

    The second detection then determines the velocity, like two-point differencing combined with a prior of speeds.

    Parameters
    ----------
    speed : float or sequence of float
        Standard deviation of the velocity along each axis, m/s.
    rest : float
        Standard deviation of all other components: acceleration, m/s^2, or turn rate, rad/s.
    birth_rate : float
        Mean number of new targets in a scan.
    widest : float
        A single measurement starts a track only if the standard deviation of its position is at most this share
        of the region's diagonal; a bearing alone starts none.
    closed : sequence of array_like (n, 2)
        Areas in which no track starts, as a wind farm or a road: polygons, x and y of their corners, metres. Tracks
        that began elsewhere go on there.
    """

    speed: float | tuple[float, ...] = described(300.0, "usual speed along an axis, m/s")
    rest: float = described(0.1, "usual size of further components of the state")
    birth_rate: float = described(0.1, "mean number of new targets in a scan")
    widest: float = described(0.1, "widest start of a track, as a share of the region")
    closed: tuple[tuple[tuple[float, float], ...], ...] = ()

    def __post_init__(self) -> None:
        corners = [numbers(area, "closed: an area") for area in self.closed]
        for area in corners:
            if area.ndim != 2 or area.shape[1:] != (2,) or len(area) < 3 or not np.isfinite(area).all():
                raise InvalidInputError(
                    f"closed: an area must be at least 3 finite corners x, y, got shape {area.shape}"
                )
        object.__setattr__(self, "closed", tuple(tuple(map(tuple, area.tolist())) for area in corners))
        for name in ("rest", "birth_rate", "widest"):
            positive(getattr(self, name), name)
        speeds = self.speed if isinstance(self.speed, (tuple, list)) else (self.speed,)
        if not speeds:
            raise InvalidInputError("speed must be one number, or one for each axis")
        for speed in speeds:
            positive(speed, "speed")
        if not isinstance(self.speed, (int, float, tuple, list)):
            object.__setattr__(self, "speed", float(self.speed))  # a number of numpy's

    def warning(self, region: Array) -> str:
        """One line if a closed area lies outside of the region, "" else."""
        for number, area in enumerate(self.closed, 1):
            low, high = np.min(area, axis=0), np.max(area, axis=0)
            if (high < region[:2, 0]).any() or (low > region[:2, 1]).any():
                return f"closed: area {number} lies outside of the region: of another frame, or not in metres?"
        return ""

    def opens(self, positions: Array) -> Array:
        """Which positions (K, 3) are outside of the closed areas, bool (K,)."""
        found = np.ones(len(positions), dtype=np.bool_)
        x, y = positions[:, 0, None], positions[:, 1, None]
        for area in self.closed:
            (x1, y1), (x2, y2) = np.array(area).T, np.roll(area, -1, axis=0).T
            # edges that a line from the position towards +x crosses
            across = (y1 > y) != (y2 > y)
            with np.errstate(divide="ignore", invalid="ignore"):
                crossed = across & (x < x1 + (y - y1) * (x2 - x1) / (y2 - y1))
            found &= crossed.sum(axis=1) % 2 == 0
        return found

    def prior(self, motion: Motion) -> tuple[Array, Array]:
        """Indices of the position in a state, and the prior covariance of a new track, position not set.

        Raises
        ------
        InvalidInputError
            The number of speeds does not match the motion model's axes.
        """
        axes = len(motion.position)
        speed = self.speed if isinstance(self.speed, (int, float)) else tuple(self.speed)
        if isinstance(speed, tuple) and len(speed) not in (1, axes):
            raise InvalidInputError(f"speed must be one number, or one for each of {axes} axes, got {self.speed!r}")
        return _prior(motion.dim, tuple(motion.position), speed, self.rest)

    def start(self, filter: Filter[Any], positions: Array, covariances: Array, lag: Array | None = None) -> Any:
        """States of new tracks, of the filter's kind.

        Parameters
        ----------
        filter : Filter
        positions, covariances : arrays (K, 3), (K, 3, 3)
        lag : array (K,), optional
            Seconds by which the states precede the times of the positions.
        """
        motion = filter.motion
        axes = len(motion.position)
        index, prior = self.prior(motion)
        mean = np.zeros((len(positions), motion.dim))
        mean[:, index] = positions[:, :axes]
        covariance = np.empty((len(positions), *prior.shape))
        covariance[:] = prior
        covariance[:, index[:, None], index] = covariances[:, :axes, :axes]
        if lag is not None and lag.any():
            velocity = velocity_components(motion)
            moving = index[: len(velocity)]
            variances = prior[velocity, velocity]
            covariance[:, moving, moving] += lag[:, None] ** 2 * variances
            covariance[:, moving, velocity] = covariance[:, velocity, moving] = -lag[:, None] * variances
        return filter.start(gaussian(mean, covariance))


@lru_cache(maxsize=64)
def _prior(dim: int, position: tuple[int, ...], speed: float | tuple[float, ...], rest: float) -> tuple[Array, Array]:
    index = np.array(position)
    deviation = np.full(dim, rest)
    velocity = _velocities(dim, index)
    deviation[velocity] = np.broadcast_to(np.asarray(speed, dtype=np.float64), (len(index),))[: len(velocity)]
    return index, np.diag(deviation**2)


def velocity_components(motion: Motion) -> Array:
    """Indices of the velocities in a state: they follow the positions."""
    return _velocities(motion.dim, np.array(motion.position))


def _velocities(dim: int, position: Array) -> Array:
    index = position + len(position)
    return np.asarray(index[index < dim])
