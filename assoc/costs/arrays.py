"""Sensors and scans as flat arrays: what the compiled kernels see of a scene."""

from __future__ import annotations

import math
import weakref
from typing import NamedTuple

import numpy as np

from assoc._types import Array
from assoc.costs.conversion import convert
from assoc.errors import InvalidInputError
from assoc.scene.scan import Scan
from assoc.scene.scene import Scene
from assoc.sensors.codes import BEARING, CODES


class SensorArrays(NamedTuple):
    """The sensors of a scene, S of them, in the form the kernels take."""

    code: Array
    """Kind of each, int64 (S,); see `assoc.sensors.codes`."""
    dim: Array
    """Components of a measurement that tell of the position, int64 (S,)."""
    place: Array
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
    """By how much the cost falls when the sensor is counted as detecting, before the residual, (S,)."""
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
    """Position that a measurement points at, (N, 3); see `assoc.costs.conversion.convert`."""
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
    # a flat region says where the targets are, it must not overrule what the sensors measure
    half = np.maximum(half, 0.1 * half.max())
    return SensorArrays(
        code=np.array([CODES[type(sensor)] for sensor in scene.sensors], dtype=np.int64),
        dim=np.array([sensor.position_part.dim for sensor in scene.sensors], dtype=np.int64),
        place=np.array([sensor.position for sensor in scene.sensors]),
        covariance=covariance,
        weight=weight,
        full=np.array([sensor.dim >= 3 for sensor in scene.sensors]),
        middle=scene.region.mean(axis=1),
        half=half,
        gain=gain,
        base=base,
    )


def scan_arrays(sensors: SensorArrays, scan: Scan, reach: float, least: float) -> tuple[ScanArrays, Array]:
    """Flat arrays of one scan, and for each row its 1-based index in the scan, int32 (N,).

    `reach` and `least` are the largest and the smallest gate that pairs will have to pass.
    """
    count = len(sensors.dim)
    if len(scan.measurements) != count:
        raise InvalidInputError(f"scan has measurements of {len(scan.measurements)} sensors, the scene has {count}")
    start = np.zeros(count + 1, dtype=np.int64)
    np.cumsum([len(one) for one in scan.measurements], out=start[1:])
    z = np.zeros((int(start[-1]), 3))
    index = np.empty(len(z), dtype=np.int32)
    owner = np.repeat(np.arange(count), np.diff(start))
    for s, measured in enumerate(scan.measurements):
        rows = slice(start[s], start[s + 1])
        order = np.arange(len(measured))
        if sensors.code[s] == BEARING:
            azimuth = math.pi - np.mod(math.pi - measured[:, 0], 2 * math.pi)
            order = np.argsort(azimuth, kind="stable")
            z[rows, 0] = azimuth[order]
        else:
            z[rows, : sensors.dim[s]] = measured[:, : sensors.dim[s]]
        index[rows] = order + 1
    centre, spread, information = convert(
        sensors.code,
        sensors.dim,
        sensors.place,
        sensors.covariance,
        sensors.middle,
        sensors.half,
        z,
        owner,
        reach,
        least,
    )
    return ScanArrays(z, owner, start, centre, spread, information), index
