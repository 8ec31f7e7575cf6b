"""Sensors and scans as flat arrays, for kernels; measurements converted to positions."""

from __future__ import annotations

import math
import weakref
from itertools import accumulate
from typing import NamedTuple

import numpy as np

from assoc._system.compiled import njit
from assoc._types import Array
from assoc.costs.symmetric import inverse_by_cofactors
from assoc.errors import InvalidInputError
from assoc.scene.scan import Scan
from assoc.scene.scene import Scene
from assoc.sensors.codes import BEARING, CODES, OWN
from assoc.sensors.kernels.dispatch import convert_one
from assoc.sensors.kernels.radar import START_REACH

HEIGHTS = 3.0
"""Where no sensor measures full positions, heights are sought this many half heights around the middle."""


class SensorArrays(NamedTuple):
    """The sensors of a scene, S of them, in the form the kernels take."""

    code: Array
    """Kind of each, int64 (S,); see `assoc.sensors.codes`."""
    dim: Array
    """Components of a measurement that depend on the position, int64 (S,)."""
    position: Array
    """(S, 3), metres."""
    covariance: Array
    """Measurement covariances padded with zeros, (S, 3, 3)."""
    weight: Array
    """Their inverses padded with zeros, (S, 3, 3)."""
    full: Array
    """Whether one measurement determines a position, bool (S,)."""
    middle: Array
    """Middle of the scene's region, (3,): the mean of the prior."""
    half: Array
    """Half widths of the region, (3,): the standard deviations of the prior."""
    gain: Array
    """What a detection takes off the cost, before the residual, (S,)."""
    base: float
    """The cost of a target that every sensor misses."""


class ScanArrays(NamedTuple):
    """The N measurements of one scan, sensor after sensor, in the form the kernels take."""

    z: Array
    """Measurements without range rates, padded with zeros, (N, 3); those of a bearing sensor sorted by azimuth."""
    owner: Array
    """Sensor of each, int64 (N,)."""
    start: Array
    """Where each sensor's measurements begin, int64 (S + 1,)."""
    centre: Array
    """Position that a measurement points at, (N, 3); see `convert`."""
    spread: Array
    """Covariance of that position (xx, xy, xz, yy, yz, zz), (N, 6), widened for gating."""
    information: Array
    """Its inverse, (N, 6); of x and y alone where the height is open, zero for bearings."""


_known_scenes: weakref.WeakKeyDictionary[Scene, SensorArrays] = weakref.WeakKeyDictionary()


def sensor_arrays(scene: Scene) -> SensorArrays:
    """Flat arrays of a scene's sensors, made once for each scene."""
    arrays = _known_scenes.get(scene)
    if arrays is None:
        arrays = _known_scenes[scene] = _sensor_arrays(scene)
    return arrays


def _sensor_arrays(scene: Scene) -> SensorArrays:
    count = len(scene.sensors)
    covariance, weight = np.zeros((count, 3, 3)), np.zeros((count, 3, 3))
    gain, base = np.zeros(count), 0.0
    for s, sensor in enumerate(scene.sensors):
        # range rates have no part in positions; `assoc.costs.range_rates` weighs them
        located = sensor.position_part
        d = located.dim
        covariance[s, :d, :d] = located.covariance
        weight[s, :d, :d] = np.linalg.inv(located.covariance)
        log_determinant = float(np.linalg.slogdet(2 * math.pi * sensor.covariance)[1])
        detected = math.log(sensor.detection_probability * sensor.volume / sensor.false_alarm_rate)
        missed = -math.log1p(-sensor.detection_probability)
        # equation 5: a detection costs 1/2 ln det(2 pi R) - ln(P V / r), a miss -ln(1 - P)
        gain[s] = detected - 0.5 * log_determinant + missed
        base += missed
    if not (np.isfinite(weight).all() and np.isfinite(gain).all()):
        worst = int(np.argmax(~(np.isfinite(weight).all(axis=(1, 2)) & np.isfinite(gain))))
        raise InvalidInputError(f"sensor {worst}: its noise or field of view is too extreme to compute a cost")
    half = 0.5 * (scene.region[:, 1] - scene.region[:, 0])
    # the prior of a flat region must not overrule measurements
    half = np.maximum(half, 0.1 * half.max())
    return SensorArrays(
        code=np.array([CODES.get(type(sensor), OWN) for sensor in scene.sensors], dtype=np.int64),
        dim=np.array([sensor.position_part.dim for sensor in scene.sensors], dtype=np.int64),
        position=np.array([sensor.position for sensor in scene.sensors]),
        covariance=covariance,
        weight=weight,
        full=np.array([sensor.dim >= 3 for sensor in scene.sensors]),
        middle=scene.region.mean(axis=1),
        half=half,
        gain=gain,
        base=base,
    )


def unmissed(sensors: SensorArrays, misses: Array, blind: Array) -> SensorArrays:
    """The sensors as if those in `blind`, bool (S,), missed nothing; `misses` is ln(1 - P) of each, (S,)."""
    free = np.where(blind, -misses, 0.0)
    return sensors._replace(gain=sensors.gain - free, base=sensors.base - float(free.sum()))


def scan_arrays(sensors: SensorArrays, scan: Scan, reach: float, least: float) -> tuple[ScanArrays, Array]:
    """Flat arrays of one scan, and for each row its 1-based index in the scan, int32 (N,).

    `reach` and `least` are the largest and the smallest gate that pairs will have to pass.
    """
    count = len(sensors.dim)
    if len(scan.measurements) != count:
        raise InvalidInputError(f"scan has measurements of {len(scan.measurements)} sensors, the scene has {count}")
    sizes = list(map(len, scan.measurements))
    start = np.array([0, *accumulate(sizes)])
    z, owner = np.zeros((sum(sizes), 3)), np.repeat(np.arange(count), sizes)
    index = (np.arange(len(z)) - start[owner] + 1).astype(np.int32)
    ends = zip(start.tolist(), start[1:].tolist(), sensors.dim.tolist(), sensors.code.tolist(), strict=False)
    for (low, high, dim, code), measured in zip(ends, scan.measurements, strict=True):
        if code != BEARING:
            z[low:high, :dim] = measured[:, :dim]
            continue
        azimuth = math.pi - np.mod(math.pi - measured[:, 0], 2 * math.pi)
        order = np.argsort(azimuth, kind="stable")
        z[low:high, :dim], index[low:high] = measured[order], order + 1
        z[low:high, 0] = azimuth[order]
    centre, spread, information = convert(sensors, z, owner, reach, least)
    return ScanArrays(z, owner, start, centre, spread, information), index


@njit
def convert(sensors: SensorArrays, z: Array, owner: Array, reach: float, least: float) -> tuple[Array, Array, Array]:
    """Convert measurements (N, 3) to positions (N, 3), their spread (N, 6) for the gate and information (N, 6).

    The spread is the linearised covariance (xx, xy, xz, yy, yz, zz), widened where the measurement bends so much that
    its ellipsoid of chi-square value `least` would not hold all positions within `reach`, the largest gate: by the
    sagitta of the arc for radars, and by the ground ranges of all heights sought where the height is open. The
    information is the inverse covariance for a start, which does not depend on the gate. Zeros for bearings, and of x
    and y alone for measurements that leave the height open.
    """
    # out of the record first: a field read in the loop costs a reference count each time
    code, dim, position, covariance = sensors.code, sensors.dim, sensors.position, sensors.covariance
    middle, half = sensors.middle[2], sensors.half[2]
    count = len(z)
    centre, spread, information = np.zeros((count, 3)), np.zeros((count, 6)), np.zeros((count, 6))
    heights = (middle - HEIGHTS * half, middle, middle + HEIGHTS * half)
    for n in range(count):
        s = owner[n]
        if code[s] == BEARING:
            continue
        R = covariance[s]
        U = R[0, 0], R[0, 1], R[0, 2], R[1, 1], R[1, 2], R[2, 2]
        measured, at = (z[n, 0], z[n, 1], z[n, 2]), (position[s, 0], position[s, 1], position[s, 2])
        # as wide as the gate asks, then as for any start
        _, wide = convert_one(code[s], dim[s], measured, at, U, heights, reach, least)
        there, c = convert_one(code[s], dim[s], measured, at, U, heights, START_REACH, START_REACH)
        ok, i0, i1, i2, i3, i4, i5 = inverse_by_cofactors(c)
        if not ok:
            # too flat to invert: a ball of the same size will do for a start
            i0 = i3 = i5 = 1.0 / (c[0] + c[3] + (c[5] if dim[s] == 3 else 0.0))
            i1 = i2 = i4 = 0.0
        centre[n, 0], centre[n, 1], centre[n, 2] = there
        for i, value in enumerate(wide):
            spread[n, i] = value
        for i, value in enumerate((i0, i1, i2, i3, i4, i5)):
            information[n, i] = value
    return centre, spread, information
