"""Costs with sensors of users' own classes, which have no compiled model: the same equations in Python, slower.

Positions are fitted by Levenberg and Marquardt's method with the sensors' own `measure` and `jacobian`, many tuples at
a time: a measurement that determines a position from the best places of a grid over the region, a tuple from the
positions of its measurements.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from assoc._types import Array
from assoc.costs.arrays import ScanArrays, SensorArrays
from assoc.scene.scan import Scan
from assoc.scene.scene import Scene
from assoc.sensors import Sensor
from assoc.sensors.codes import CODES

_GRID = (15, 15, 5)
_STARTS, _STEPS = 3, 40


def any_own(scene: Scene) -> bool:
    """Whether any sensor is of a user's own class."""
    return any(type(sensor) not in CODES for sensor in scene.sensors)


def fit_own(scene: Scene, arrays: SensorArrays, scan: Scan, rows: Array) -> tuple[Array, Array, Array]:
    """As `assoc.costs.estimation.fit`, of tuples (K, S) of rows of `flat_scan`, -1 where a sensor missed."""
    before = np.append(0, np.cumsum(scan.sizes))[:-1]
    tuples = np.where(rows >= 0, rows - before + 1, 0).astype(np.int64)
    sensors = [sensor.position_part for sensor in scene.sensors]
    z = [np.asarray(found)[:, : part.dim] for found, part in zip(scan.measurements, sensors, strict=True)]
    middle, half = arrays.middle, arrays.half
    axes = [np.linspace(m - h, m + h, count) for m, h, count in zip(middle, half, _GRID, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    starts = []
    for s, (part, found) in enumerate(zip(sensors, z, strict=True)):
        used = np.unique(tuples[:, s][tuples[:, s] > 0])
        best = np.full((len(found) + 1, 3), np.nan)
        if arrays.full[s] and len(used):
            alone = np.zeros((len(used), len(sensors)), dtype=np.int64)
            alone[:, s] = used
            best[used] = _descended(sensors, arrays, z, alone, _from_grid([part], [found], used[:, None], grid))[1]
        starts.append(best)
    places = np.stack([best[tuples[:, s]] for s, best in enumerate(starts)], axis=1)
    if not len(tuples):
        return np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3, 3))
    open_ones = np.flatnonzero(np.isnan(places).any(axis=2).all(axis=1))
    if len(open_ones):
        tried = _from_grid(sensors, z, tuples[open_ones], grid)
        more = np.full((len(places), tried.shape[1], 3), np.nan)
        more[open_ones] = tried
        places = np.concatenate([places, more], axis=1)
    return _descended(sensors, arrays, z, tuples, places)


def _from_grid(sensors: Sequence[Sensor], z: Sequence[Array], tuples: Array, grid: Array) -> Array:
    """Places of the grid that fit tuples best, (K, _STARTS, 3)."""
    chi = np.zeros((len(tuples), len(grid)))
    for s, sensor in enumerate(sensors):
        seen = np.flatnonzero(tuples[:, s])
        expected, weight = sensor.measure(grid), np.linalg.inv(sensor.covariance)
        for k in seen.tolist():
            off = sensor.residual(np.broadcast_to(z[s][tuples[k, s] - 1], expected.shape), expected)
            chi[k] += np.einsum("gi,ij,gj->g", off, weight, off)
    return np.asarray(grid[np.argsort(chi, axis=1, kind="stable")[:, :_STARTS]])


def _descended(
    sensors: Sequence[Sensor], arrays: SensorArrays, z: Sequence[Array], tuples: Array, places: Array
) -> tuple[Array, Array, Array]:
    """Chi-square (K,), position (K, 3) and covariance (K, 3, 3) of tuples, the best from starts (K, n, 3), some NaN."""
    row, start = np.nonzero(~np.isnan(places).any(axis=2))
    x = places[row, start]
    # where nothing determines a position the region does
    loose = ~np.asarray(((tuples > 0) & arrays.full).any(axis=1))[row]
    prior = np.where(loose[:, None], 1.0 / arrays.half**2, 0.0)
    chi, total, A, g = _normal(sensors, arrays, z, tuples[row], x, prior)
    damping = np.full(len(x), 1e-3)
    active = np.arange(len(x))
    for _ in range(_STEPS):
        if not len(active):
            break
        diagonal = np.einsum("kii->ki", A[active])
        damped = A[active] + np.eye(3) * (damping[active, None] * diagonal + 1e-12 * diagonal.max())[:, :, None]
        step = np.linalg.solve(damped, g[active][:, :, None])[:, :, 0]
        tried = _normal(sensors, arrays, z, tuples[row[active]], x[active] + step, prior[active])
        good = tried[1] <= total[active]
        better, gain = active[good], total[active[good]] - tried[1][good]
        x[better] += step[good]
        for kept, new in zip((chi, total, A, g), tried, strict=True):
            kept[better] = new[good]
        damping[active] = np.where(good, 0.1 * damping[active], 10.0 * damping[active])
        going = np.ones(len(active), dtype=np.bool_)
        going[good] = gain > 1e-12 * (1.0 + total[better])
        active = active[going & (damping[active] < 1e12)]
    order = np.lexsort((total, row))
    best = order[np.searchsorted(row[order], np.arange(len(tuples)))]
    covariance = np.linalg.inv(A[best])
    return chi[best], x[best], 0.5 * (covariance + covariance.transpose(0, 2, 1))


def _normal(
    sensors: Sequence[Sensor], arrays: SensorArrays, z: Sequence[Array], tuples: Array, x: Array, prior: Array
) -> tuple[Array, Array, Array, Array]:
    """Chi-square, the same with the prior, normal matrices (K, 3, 3) and gradients (K, 3) at positions."""
    chi, g = np.zeros(len(x)), prior * (arrays.middle - x)
    A = np.eye(3) * prior[:, :, None]
    total = (prior * (arrays.middle - x) ** 2).sum(axis=1)
    for s, sensor in enumerate(sensors):
        seen = np.flatnonzero(tuples[:, s])
        if not len(seen):
            continue
        off = sensor.residual(z[s][tuples[seen, s] - 1], sensor.measure(x[seen]))
        slopes, weight = sensor.jacobian(x[seen]), np.linalg.inv(sensor.covariance)
        weighted = slopes.transpose(0, 2, 1) @ weight
        chi[seen] += np.einsum("ki,ij,kj->k", off, weight, off)
        A[seen] += weighted @ slopes
        g[seen] += (weighted @ off[:, :, None])[:, :, 0]
    return chi, total + chi, A, g


def flat_scan(sensors: SensorArrays, scan: Scan) -> tuple[ScanArrays, Array]:
    """`assoc.costs.arrays.scan_arrays` without positions and in the order of the scan."""
    start = np.append(0, np.cumsum(scan.sizes)).astype(np.int64)
    z = np.zeros((int(start[-1]), 3))
    for s, found in enumerate(scan.measurements):
        z[start[s] : start[s + 1], : sensors.dim[s]] = np.asarray(found)[:, : sensors.dim[s]]
    owner, nothing = np.repeat(np.arange(len(scan.sizes)), scan.sizes), np.zeros((len(z), 6))
    flat = ScanArrays(z, owner, start, nothing[:, :3], nothing, nothing)
    return flat, (np.arange(len(z)) - start[owner] + 1).astype(np.int32)


def every_pair(scan: ScanArrays) -> Iterator[tuple[Array, float]]:
    """All pairs of measurements of two sensors, with the share of them that is done after each block."""
    ends, done = scan.start.tolist(), 0.0
    total = 0.5 * (len(scan.z) ** 2 - float((np.diff(scan.start) ** 2).sum()))
    for s, t in combinations(range(len(ends) - 1), 2):
        first, second = np.arange(ends[s], ends[s + 1]), np.arange(ends[t], ends[t + 1])
        pairs = np.stack(np.meshgrid(first, second, indexing="ij"), axis=-1).reshape(-1, 2).astype(np.int32)
        done += len(pairs)
        yield pairs, done / max(total, 1.0)
