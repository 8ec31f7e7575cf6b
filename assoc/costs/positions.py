"""Maximum-likelihood positions and costs of tuples of measurements of one time."""

from __future__ import annotations

import weakref
from collections.abc import Sequence
from functools import partial

import numpy as np

from assoc._types import Array
from assoc.costs.arrays import ScanArrays, SensorArrays, scan_arrays, sensor_arrays
from assoc.costs.arrivals.fit import any_arrivals, arrival_costs, fit_arrivals, receivers_of, times_of
from assoc.costs.estimation import Fit, fit
from assoc.costs.own_sensors import any_own, fit_own, flat_scan
from assoc.costs.prices import position_prior, prices, with_prior
from assoc.costs.range_rates import SPEED, range_rates
from assoc.errors import InvalidInputError
from assoc.scene.scan import Scan
from assoc.scene.scene import Scene
from assoc.sensors.codes import POSITION


def tuple_costs(
    scene: Scene,
    scan: int | Scan,
    tuples: Array,
    *,
    speed: float | Sequence[float] = SPEED,
    target_density: float | str | None = None,
) -> Array:
    """Cost of given tuples of measurements of one time; see `assoc.costs.tuple_costs`."""
    return costs_and_positions(scene, scan, tuples, speed=speed, target_density=target_density)[0]


def costs_and_positions(
    scene: Scene,
    scan: int | Scan,
    tuples: Array,
    *,
    speed: float | Sequence[float] = SPEED,
    target_density: float | str | None = None,
) -> tuple[Array, Array, Array]:
    """`tuple_costs` and `positions_and_covariances` of the same tuples, fitted once."""
    prior = position_prior(scene, sensor_arrays(scene), target_density)
    sensors = with_prior(sensor_arrays(scene), prior)
    if any_arrivals(scene):
        times, fitted = fitted_arrivals(scene, scan, tuples)
        return arrival_costs(scene, sensors, times, prior, fitted), fitted[2], fitted[3]
    flat, rows, chi, positions, covariances = _fit_tuples(scene, scan, tuples)
    rates = range_rates(scene, scan_of(scene, scan), speed)
    if rates is not None or prior is not None:
        chi = chi + prices(sensors, flat, rows, rates, prior, positions, covariances)
    detected = rows >= 0
    costs = 0.5 * chi - detected @ sensors.gain + sensors.base
    return np.where(detected.sum(axis=1) == 1, 0.0, costs), positions, covariances


def positions_and_covariances(scene: Scene, scan: int | Scan, tuples: Array) -> tuple[Array, Array]:
    """Maximum-likelihood positions of measurements of one time; see `assoc.costs.positions_and_covariances`."""
    if any_arrivals(scene):
        _, (_, _, positions, covariances) = fitted_arrivals(scene, scan, tuples)
        return positions, covariances
    positions, covariances = _fit_tuples(scene, scan, tuples)[3:]
    return positions, covariances


def fitted_arrivals(scene: Scene, scan: int | Scan, tuples: Array) -> tuple[Array, tuple[Array, ...]]:
    """Arrival times (K, S) of tuples, and what is fitted to them."""
    chosen = scan_of(scene, scan)
    times = times_of(chosen, checked_tuples(tuples, chosen.sizes))
    return times, fit_arrivals(receivers_of(scene, sensor_arrays(scene)), times)


def single_positions(scene: Scene, sensor: int, measured: Array) -> tuple[Array, Array]:
    """`positions_and_covariances` of checked measurements (n, d) of one sensor, by its number, each by itself."""
    sensors = sensor_arrays(scene)
    if sensors.code[sensor] == POSITION:
        # the covariance of a position sensor does not depend on the position
        known = _known_positions.setdefault(scene, {})
        if len(measured):
            if sensor not in known:
                known[sensor] = _positions(scene, sensors, sensor, measured[:1])[1]
            points = np.empty((len(measured), 3))
            points[:] = sensors.middle
            points[:, : measured.shape[1]] = measured
            return points, np.broadcast_to(known[sensor], (len(measured), 3, 3))
    return _positions(scene, sensors, sensor, measured)


def positions_of_scan(scene: Scene, scan: Scan, sensor: int) -> tuple[Array, Array]:
    """`single_positions` of a sensor's measurements in a scan, from where it stood when it made each."""
    positions, covariances = single_positions(scene, sensor, scan.measurements[sensor])
    path = scan.paths[sensor] if scan.paths else None
    if path is not None and len(positions):
        positions = positions + path.poses(scan.own_times()[sensor])[0] - scene.sensors[sensor].position
    return positions, covariances


_known_positions: weakref.WeakKeyDictionary[Scene, dict[int, Array]] = weakref.WeakKeyDictionary()


def _positions(scene: Scene, sensors: SensorArrays, sensor: int, measured: Array) -> tuple[Array, Array]:
    count = len(scene.sensors)
    parts = tuple(measured if s == sensor else np.empty((0, other.dim)) for s, other in enumerate(scene.sensors))
    _, index, fitted = measured_and_fit(scene, sensors, Scan(0, 0.0, parts))
    rows = np.full((len(measured), count), -1, dtype=np.int32)
    rows[index - 1, sensor] = np.arange(len(measured))
    _, positions, covariances = fitted(rows, False)
    return positions, covariances


def measured_and_fit(
    scene: Scene, sensors: SensorArrays, scan: Scan, reach: float = 1.0, least: float = 1.0
) -> tuple[ScanArrays, Array, Fit]:
    """The `scan_arrays` of a scan, and what fits positions to them: compiled, or with sensors of one's own in Python.

    `reach` and `least` do not matter where nothing is gated.
    """
    if any_own(scene):
        return *flat_scan(sensors, scan), lambda rows, gating: fit_own(scene, sensors, scan, rows)
    measured, index = scan_arrays(sensors, scan, reach, least)
    return measured, index, partial(fit, sensors, measured)


def scan_of(scene: Scene, scan: int | Scan) -> Scan:
    """The scan of that number, or the scan itself after a check against the scene's sensors."""
    if not isinstance(scan, Scan):
        return scene.scan(scan)
    dims = [sensor.dim for sensor in scene.sensors]
    found = [z.shape[1] for z in scan.measurements]
    if len(found) == len(dims) and found != dims:
        raise InvalidInputError(f"scan has measurements of {found} components, the scene's sensors measure {dims}")
    return scan


def _fit_tuples(scene: Scene, scan: int | Scan, tuples: Array) -> tuple[ScanArrays, Array, Array, Array, Array]:
    """The scan, rows (K, S) in it, chi-square (K,), positions (K, 3) and covariances (K, 3, 3) of tuples."""
    scan = scan_of(scene, scan)
    measured, index, fitted = measured_and_fit(scene, sensor_arrays(scene), scan)
    wanted = checked_tuples(tuples, scan.sizes)
    # bearings were sorted: from 1-based index to row
    row_of = np.empty(len(index) + 1, dtype=np.int32)
    row_of[measured.start[measured.owner] + index - 1] = np.arange(len(index), dtype=np.int32)
    rows = np.where(wanted > 0, row_of[np.maximum(measured.start[:-1] + wanted - 1, 0)], -1)
    # the kernel is compiled for one layout
    rows = np.ascontiguousarray(rows, dtype=np.int32)
    return (measured, rows, *fitted(rows, False))


def checked_tuples(tuples: Array, sizes: Array) -> Array:
    """Tuples (K, S) of 1-based measurements of a scan with so many of each sensor (S,), 0 where one missed; checked."""
    count, wanted = len(sizes), np.asarray(tuples)
    if wanted.size == 0:
        wanted = np.zeros((0, count), dtype=np.int64)
    if wanted.ndim != 2 or wanted.shape[1] != count or wanted.dtype.kind not in "iu":
        raise InvalidInputError(
            f"tuples must be integers of shape (K, {count}), got {wanted.dtype} of shape {wanted.shape}"
        )
    wrong = (wanted < 0) | (wanted > sizes)
    if wrong.any():
        k, s = np.argwhere(wrong)[0]
        raise InvalidInputError(f"tuples: row {k} has index {wanted[k, s]} for sensor {s}, expected 0 to {sizes[s]}")
    if len(wanted) and not wanted.any(axis=1).all():
        raise InvalidInputError(f"tuples: row {int(np.argmin(wanted.any(axis=1)))} has no measurement")
    return wanted.astype(np.int64, copy=False)
