"""What sensors can see: the share of a target's density in a sensor's view, and what a miss then says.

Where the detection probability is known by bands of range, a sensor's is the largest of them, and the share of a
target in a band is lowered by what the band has less.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.special import ndtr

from assoc._system.compiled import njit
from assoc._types import Array
from assoc.filters.base import Filter
from assoc.filters.imm import Mixture
from assoc.sensors import PositionSensor, Radar3D, Sensor
from assoc.sensors.codes import CODES
from assoc.sensors.kernels.dispatch import linearise

# shares nearer to 0 or 1 than this are 0 or 1
_SURE = 1e-6
# inside by so many standard deviations, times the root of two, is inside for certain
_DEEP = 8.0
_FULL_TURN = 2.0 * math.pi * (1.0 - 1e-9)
BANDS = 10
"""Bands of range, equally wide, up to a sensor's reach."""
# places along each axis of a region at which a view is tried
_TRIED = (9, 9, 5)


def share_in_view(sensor: Sensor, positions: Array, covariances: Array | None) -> Array:
    """Probability (B,) that targets lie in a sensor's view; 0 or 1 where it is within 1e-6 of either.

    Each component of a measurement is taken as Gaussian, with the sensor's derivatives at the mean, and as independent
    of the others. Positions (B, 3), metres, are exact without covariances (B, 3, 3).
    """
    share = np.ones(len(positions))
    limits = sensor.position_part.limits
    if len(positions) and limits:
        mean = sensor.position_part.measure(positions)
        spread = np.zeros_like(mean)
        if covariances is not None:
            slope = sensor.position_part.jacobian(positions)
            spread = np.sqrt(((slope @ covariances) * slope).sum(axis=2))
        for axis, low, high in limits:
            share *= _within(mean[:, axis], spread[:, axis], (low, high), sensor.angular[axis])
    return _rounded(share)


def share_in_sector(sensor: Sensor, positions: Array, covariances: Array, sector: Array) -> Array:
    """The same of the sector (2,) that a sensor covered in a scan: first and last azimuth, see `assoc.Scene`; (B,)."""
    if not sector[1] > sector[0]:
        return np.zeros(len(positions))
    if sector[1] - sector[0] >= _FULL_TURN:
        return np.ones(len(positions))
    away = positions - sensor.position
    ground = np.maximum(away[:, 0] ** 2 + away[:, 1] ** 2, 1e-18)
    slope = np.stack([-away[:, 1], away[:, 0]], axis=1) / ground[:, None]
    across = np.sqrt(np.einsum("bi,bij,bj->b", slope, covariances[:, :2, :2], slope))
    limits = float(sector[0]), float(sector[1])
    return _rounded(_within(np.arctan2(away[:, 1], away[:, 0]), across, limits, True))


def _rounded(share: Array) -> Array:
    share[share < _SURE] = 0.0
    share[share > 1.0 - _SURE] = 1.0
    return share


def _within(mean: Array, spread: Array, limits: tuple[float, float], angular: bool) -> Array:
    """Probability of an interval under normal densities, (B,)."""
    low, high = limits[0] - mean, limits[1] - mean
    if angular:
        # the turn of the interval that lies nearest to the mean
        turn = 2.0 * math.pi * np.round((low + high) / (4.0 * math.pi))
        low, high = low - turn, high - turn
    spread = np.maximum(spread, 1e-12)
    return np.asarray(ndtr(high / spread) - ndtr(low / spread))


def beside_notch(sensor: Sensor, states: Any, axes: Array) -> Array:
    """Probability (B,) that range rates of states are outside of a radar's notch; 1 where none is known.

    A radar that is blind to targets across its line of sight learns nothing from their misses.
    """
    columns = np.concatenate([axes, axes + len(axes)])
    if not (isinstance(sensor, Radar3D) and sensor.notch > 0.0 and len(states)) or columns[-1] >= states.mean.shape[1]:
        return np.ones(len(states))
    both, spread = np.zeros((len(states), 6)), np.zeros((len(states), 6, 6))
    put = np.concatenate([np.arange(len(axes)), 3 + np.arange(len(axes))])
    both[:, put] = states.mean[:, columns]
    spread[:, put[:, None], put] = states.covariance[:, columns[:, None], columns]
    slope = sensor.jacobian(both[:, :3], both[:, 3:])[:, 3]
    rate = sensor.measure(both[:, :3], both[:, 3:])[:, 3]
    wide = np.sqrt(np.maximum(np.einsum("bi,bij,bj->b", slope, spread, slope), 1e-12))
    if math.isfinite(sensor.interval):
        # blind speeds come back with each interval
        wide = np.minimum(wide, sensor.interval)
        rate = rate - sensor.interval * (np.round(rate / sensor.interval) + np.arange(-3.0, 4.0)[:, None])
    blind = ndtr((sensor.notch - rate) / wide) - ndtr((-sensor.notch - rate) / wide)
    return np.asarray(1.0 - np.atleast_2d(blind).sum(axis=0))


class Views:
    """The views of S sensors, for targets of a filter's states; one kernel for all of them.

    `axes` are the components of a state that are the position; `by_range` (S, BANDS): see
    `assoc.costs.tracks.scores.ScoreTerms`.
    """

    def __init__(self, sensors: Sequence[Sensor], axes: Sequence[int], by_range: Array | None = None) -> None:
        self._sensors, self._axes = tuple(sensors), np.array(axes, dtype=np.int64)
        self._by_range = np.ones((len(self._sensors), BANDS)) if by_range is None else by_range
        rows = zip(self._sensors, self._by_range, strict=True)
        self._bounds = np.stack([np.append(_bounds(sensor), [reach(sensor), *bands]) for sensor, bands in rows])

    def shares(self, states: Any, sensors: slice = slice(None), sectors: Array | None = None) -> Array:
        """`share_in_view` of B targets for these sensors, less in bands that detect less, (B, S).

        `sectors` (S, 2) are those that all sensors covered in a scan; None: whole turns.
        """
        shares = self._looked(states, self._bounds[sensors], True)
        for column, sensor in self._users(sensors):
            shares[:, column] = share_in_view(sensor, *_places(states, self._axes))
            shares[:, column] *= self._at(states, sensors, column)
        for column, sensor in enumerate(self._sensors[sensors]):
            if getattr(sensor, "notch", 0.0) > 0.0:
                shares[:, column] *= beside_notch(sensor, states, self._axes)
            if sectors is not None:
                shares[:, column] *= share_in_sector(sensor, *_places(states, self._axes), sectors[sensors][column])
        return shares

    def at_means(self, states: Any) -> Array:
        """`shares` as if B targets were where their means are, (B, S): 0 out of view."""
        shares = self._looked(states, self._bounds, False)
        for s, sensor in self._users(slice(None)):
            view = sensor.position_part
            shares[:, s] = view.in_view(view.measure(_places(states, self._axes)[0]))
            shares[:, s] *= self._at(states, slice(None), s)
        return shares

    def _at(self, states: Any, sensors: slice, column: int) -> Array:
        """Relative detection probability of targets by one of these sensors, (B,)."""
        band = bands_of(self._sensors[sensors][column], _places(states, self._axes)[0])
        return np.asarray(self._by_range[sensors][column, band])

    def _users(self, sensors: slice) -> list[tuple[int, Sensor]]:
        """Sensors of users' own classes, which have no compiled model."""
        return [(s, sensor) for s, sensor in enumerate(self._sensors[sensors]) if type(sensor) not in CODES]

    def _looked(self, states: Any, bounds: Array, soft: bool) -> Array:
        if isinstance(states, Mixture):
            parts = states.weights, states.means, states.covariances
        else:
            parts = np.ones((len(states), 1)), states.mean[:, None], states.covariance[:, None]
        weights, means, covariances = map(np.ascontiguousarray, parts)
        return np.asarray(_looked(bounds, weights, means, covariances, self._axes, soft))


def _bounds(sensor: Sensor) -> Array:
    """A sensor for `_looked`: code, dimension, position; for each of three components whether an angle, low, high."""
    part = sensor.position_part
    row = np.array([CODES.get(type(part), -1), part.dim, *part.position, *(3 * [0.0, -math.inf, math.inf])])
    for axis, low, high in part.limits:
        row[5 + 3 * axis : 8 + 3 * axis] = part.angular[axis], low, high
    return row


@njit
def _looked(bounds: Array, weights: Array, means: Array, covariances: Array, axes: Array, soft: bool) -> Array:
    """`share_in_view` of B mixtures of m Gaussians, or (not `soft`) of their means alone; (B, S).

    `bounds` (S, 15 + BANDS): see `_bounds`; then reach and relative detection probability in each band. Mixtures are
    weights (B, m), means (B, m, n), covariances (B, m, n, n); `axes`: components that are the position.
    """
    B, m = weights.shape
    S, d = bounds.shape[0], axes.size
    result = np.zeros((B, S))
    position, spread, h, H = np.empty(3), np.empty((3, 3)), np.empty(3), np.empty((3, 3))
    for b in range(B):
        position[:], spread[:] = 0.0, 0.0
        for j in range(m):
            for i in range(d):
                position[i] += weights[b, j] * means[b, j, axes[i]]
        for j in range(m if soft else 0):
            for i in range(d):
                for k in range(d):
                    away = (means[b, j, axes[i]] - position[i]) * (means[b, j, axes[k]] - position[k])
                    spread[i, k] += weights[b, j] * (covariances[b, j, axes[i], axes[k]] + away)
        for s in range(S):
            code, dim, share = int(bounds[s, 0]), int(bounds[s, 1]), 1.0
            if code < 0:
                continue
            linearise(code, dim, bounds[s, 2:5], position[0], position[1], position[2], h, H)
            for a in range(dim):
                low, high = bounds[s, 6 + 3 * a] - h[a], bounds[s, 7 + 3 * a] - h[a]
                if bounds[s, 5 + 3 * a] != 0.0:
                    # the turn of the interval that lies nearest to the mean
                    turn = 2.0 * math.pi * round((low + high) / (4.0 * math.pi))
                    low, high = low - turn, high - turn
                if not soft:
                    share = share if low <= 0.0 <= high else 0.0
                    continue
                variance = 0.0
                for i in range(3):
                    for k in range(3):
                        variance += H[a, i] * spread[i, k] * H[a, k]
                unit = math.sqrt(2.0) * max(math.sqrt(max(variance, 0.0)), 1e-12)
                if min(high, -low) > _DEEP * unit:
                    # the error functions below are 2 and 0 to the last digit
                    continue
                share *= 0.5 * (math.erfc(-high / unit) - math.erfc(-low / unit))
            share = 0.0 if share < _SURE else 1.0 if share > 1.0 - _SURE else share
            if bounds[s, 14] > 0.0:
                away = 0.0
                for i in range(3):
                    away = math.hypot(away, position[i] - bounds[s, 2 + i])
                share *= bounds[s, 15 + min(int(BANDS * away / bounds[s, 14]), BANDS - 1)]
            result[b, s] = share
    return result


def reach(sensor: Sensor) -> float:
    """How far a sensor sees, metres; 0 where its measurements have no range or place."""
    view = sensor.field_of_view
    if sensor.components[0] == "range":
        return float(view[0, 1])
    if isinstance(sensor, PositionSensor):
        # to the farthest corner
        return float(np.linalg.norm(np.abs(view - sensor.position[: sensor.dim, None]).max(axis=1)))
    return 0.0


def bands_of(sensor: Sensor, positions: Array) -> Array:
    """Band of range of positions (B, 3), or of the x and y of them; int (B,)."""
    far = reach(sensor)
    if not far:
        return np.zeros(len(positions), dtype=np.int64)
    away = positions - sensor.position[: positions.shape[1]]
    return _bands(np.sqrt(np.einsum("bi,bi->b", away, away)), far)


def bands_of_measured(sensor: Sensor, measured: Array) -> Array:
    """Band of range of measurements (n, d), int (n,)."""
    if sensor.components[0] == "range":
        return _bands(measured[:, 0], reach(sensor))
    return bands_of(sensor, measured)


def _bands(distance: Array, far: float) -> Array:
    return np.clip((BANDS / far * distance).astype(np.int64), 0, BANDS - 1)


def places_of(filter: Filter[Any], states: Any) -> tuple[Array, Array]:
    """Positions (B, 3) and their covariances (B, 3, 3) of states; 0 along axes that the motion model lacks."""
    return _places(states, np.array(filter.motion.position))


def _places(states: Any, axes: Array) -> tuple[Array, Array]:
    d = len(axes)
    positions, covariances = np.zeros((len(states), 3)), np.zeros((len(states), 3, 3))
    positions[:, :d] = states.mean[:, axes]
    covariances[:, :d, :d] = states.covariance[:, axes[:, None], axes]
    return positions, covariances


def log_missed(miss: Array | float, share: Array) -> Array:
    """ln(1 - P_d share) of a sensor with ln(1 - P_d) = `miss`; exactly `miss` and 0 where the share is 1 and 0."""
    return np.where(share == 1.0, miss, np.log1p(share * np.expm1(miss)))


def blind_somewhere(sensors: Sequence[Sensor], region: Array) -> Array:
    """Which sensors do not see the whole region, tried on a grid; bool (S,)."""
    # not quite to its edge, where views often end
    inner = region + 0.01 * (region[:, 1:] - region[:, :1]) * np.array([1.0, -1.0])
    axes = [np.linspace(low, high, count) for (low, high), count in zip(inner, _TRIED, strict=True)]
    tried = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 3)
    return np.array([bool((share_in_view(sensor, tried, None) < 1.0).any()) for sensor in sensors])
