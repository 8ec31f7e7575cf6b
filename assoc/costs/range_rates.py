"""The price of range rates of a tuple that disagree under a prior of the velocity.

A tuple has one position and one velocity v. The position is that of the other components; seen from there, the
range rate of radar i is u_i v + noise, with u_i the direction from the radar to the target. With the prior
v ~ N(0, diag(speed^2)) integrated out, the range rates d of a tuple are Gaussian,

    d ~ N(0, D),    D = U diag(speed^2) U' + diag(r),

so that a tuple of one Doppler radar pays for improbable speeds, and one of four or more for range rates that no
velocity explains. Noise that is correlated with range or angles enters by its conditional mean and variance r.

The cost of a tuple (`assoc.costs.arrays.SensorArrays.gain`) holds -ln of the densities N(0; 0, r); to be
added is half of

    q = d' D^-1 d + ln det D - sum ln r,

which never falls when a tuple grows, as chi-square does not. A folded range rate takes part while its conditional
deviation is at most a third of the interval; else it is uniform on the interval.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from assoc._system.compiled import njit
from assoc._types import Array
from assoc.costs.arrays import ScanArrays, SensorArrays
from assoc.errors import InvalidInputError
from assoc.scene.scan import Scan
from assoc.scene.scene import Scene
from assoc.sensors import Radar3D
from assoc.sensors.kernels.records import TURN

SPEED = 300.0
"""Standard deviation of a target's velocity along each axis, m/s: the default."""


class RangeRates(NamedTuple):
    """The range rates of a scan of N measurements by S sensors, in the form the kernels take."""

    value: Array
    """(N,), m/s; 0 where there is none."""
    variance: Array
    """Of a range rate, given the sensor's other residuals, (S,); 0: the sensor measures none."""
    slope: Array
    """By which the other residuals shift it, (S, 3)."""
    prior: Array
    """Variances of the velocity, (3,)."""
    folding: Array
    """Interval at which a sensor's fold, m/s, (S,); infinite: they do not."""


def checked_speed(speed: float | Sequence[float]) -> Array:
    """One positive number, or one for each axis, as (3,); a third axis is like the one before it."""
    try:
        given = np.atleast_1d(np.asarray(speed, dtype=np.float64))
    except (TypeError, ValueError):
        given = np.zeros(0)
    if given.ndim != 1 or not 1 <= len(given) <= 3 or not (np.isfinite(given) & (given > 0)).all():
        raise InvalidInputError(f"speed must be a number above 0, or one for each axis, got {speed!r}")
    return np.append(given, np.full(3 - len(given), given[-1]))


def range_rates(scene: Scene, scan: Scan, speed: float | Sequence[float]) -> RangeRates | None:
    """The range rates of a scan; None where no sensor measures any."""
    sigma = checked_speed(speed)
    if not any(sensor.measures_velocity for sensor in scene.sensors):
        return None
    for number, sensor in enumerate(scene.sensors):
        if sensor.measures_velocity and not isinstance(sensor, Radar3D):
            raise InvalidInputError(
                f"{sensor.label(number)}: costs know velocities from range rates of a Radar3D alone; give a sensor of "
                "your own without them"
            )
    variance, slope, values = np.zeros(len(scene.sensors)), np.zeros((len(scene.sensors), 3)), []
    for s, (sensor, measured) in enumerate(zip(scene.sensors, scan.measurements, strict=True)):
        values.append(measured[:, 3] if sensor.measures_velocity else np.zeros(len(measured)))
        if sensor.measures_velocity:
            R = sensor.covariance
            slope[s] = np.linalg.solve(R[:3, :3], R[:3, 3])
            variance[s] = R[3, 3] - slope[s] @ R[:3, 3]
    folding = np.array([getattr(sensor, "interval", math.inf) for sensor in scene.sensors])
    return RangeRates(np.concatenate(values), variance, slope, sigma**2, folding)


@njit
def prices(sensors: SensorArrays, scan: ScanArrays, rates: RangeRates, rows: Array, positions: Array) -> Array:
    """The price q of the range rates of tuples, (K,), twice what it adds to a cost, by a Kalman filter.

    `rows`, int32 (K, S), are the row of `scan` for each sensor, or -1, `positions` (K, 3) those of the tuples.
    """
    result = np.zeros(len(rows))
    P, v, k, u = np.empty((3, 3)), np.empty(3), np.empty(3), np.empty(3)
    for t in range(len(rows)):
        P[:] = 0.0
        for i in range(3):
            P[i, i], v[i] = rates.prior[i], 0.0
        for s in range(rows.shape[1]):
            n = rows[t, s]
            r = rates.variance[s]
            if n < 0 or r == 0.0:
                continue
            for i in range(3):
                u[i] = positions[t, i] - sensors.position[s, i]
            flat = math.hypot(u[0], u[1])
            slant = max(math.hypot(flat, u[2]), 1e-9)
            turn = scan.z[n, 1] - math.atan2(u[1], u[0])
            turn -= TURN * round(turn / TURN)
            off = rates.value[n] - rates.slope[s, 0] * (scan.z[n, 0] - slant) - rates.slope[s, 1] * turn
            off -= rates.slope[s, 2] * (scan.z[n, 2] - math.atan2(u[2], flat))
            variance = r
            for i in range(3):
                u[i] /= slant
            for i in range(3):
                k[i] = P[i, 0] * u[0] + P[i, 1] * u[1] + P[i, 2] * u[2]
                off -= u[i] * v[i]
            variance += u[0] * k[0] + u[1] * k[1] + u[2] * k[2]
            interval = rates.folding[s]
            if interval < math.inf:
                if 9.0 * variance > interval * interval:
                    # of no use, and uniform on the interval
                    result[t] += math.log(interval * interval / (TURN * r))
                    continue
                off -= interval * math.floor(off / interval + 0.5)
            result[t] += off * off / variance + math.log(variance / r)
            for i in range(3):
                v[i] += k[i] * off / variance
                for j in range(3):
                    P[i, j] -= k[i] * k[j] / variance
    return result
