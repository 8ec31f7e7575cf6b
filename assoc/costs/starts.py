"""Where a fit of a position to a tuple begins, and where it begins again, compiled."""

from __future__ import annotations

import math

from assoc._system.compiled import inner_njit
from assoc._types import Array
from assoc.costs.arrays import ScanArrays, SensorArrays
from assoc.costs.residuals import normal
from assoc.costs.symmetric import solve
from assoc.sensors.codes import BEARING, RADAR2D, RADAR3D

# in half heights: ranges above this bend too little for another height to matter, where there are no others to be near
_FAR = 2.0
# a radar looks near its zenith where it sees a target within so many standard deviations of elevation of it
_NEAR_ZENITH = 3.0


@inner_njit
def mean_start(sensors: SensorArrays, scan: ScanArrays, members: Array, full: bool) -> tuple[float, float, float]:
    """Where to begin: the mean of the converted measurements, weighted by their information."""
    b0 = b1 = b2 = a0 = a1 = a2 = a3 = a4 = a5 = 0.0
    last = members[0]
    # out of the tuples first: a field read in the loop costs a reference count each time
    owner, code, fulls, information, centre = scan.owner, sensors.code, sensors.full, scan.information, scan.centre
    for n in members:
        s = owner[n]
        if code[s] == BEARING or (full and not fulls[s]):
            continue
        i0, i1, i2 = information[n, 0], information[n, 1], information[n, 2]
        i3, i4, i5 = information[n, 3], information[n, 4], information[n, 5]
        c0, c1, c2 = centre[n, 0], centre[n, 1], centre[n, 2]
        a0, a1, a2, a3, a4, a5 = a0 + i0, a1 + i1, a2 + i2, a3 + i3, a4 + i4, a5 + i5
        b0 += i0 * c0 + i1 * c1 + i2 * c2
        b1 += i1 * c0 + i3 * c1 + i4 * c2
        b2 += i2 * c0 + i4 * c1 + i5 * c2
        last = n
    ok, x, y, z = solve((a0, a1, a2, a3, a4, a5), b0, b1, b2)
    if not ok:
        return scan.centre[last, 0], scan.centre[last, 1], scan.centre[last, 2]
    return x, y, z


@inner_njit
def at_height(sensors: SensorArrays, scan: ScanArrays, n: int, z: float) -> tuple[float, float, float]:
    """Where a range and azimuth are at a height; as high or low as the range allows."""
    s = scan.owner[n]
    far, azimuth = scan.z[n, 0], scan.z[n, 1]
    up = min(max(z - sensors.place[s, 2], -far), far)
    ground = math.sqrt(far * far - up * up)
    return (
        sensors.place[s, 0] + ground * math.cos(azimuth),
        sensors.place[s, 1] + ground * math.sin(azimuth),
        sensors.place[s, 2] + up,
    )


@inner_njit
def bearing_starts(
    sensors: SensorArrays, scan: ScanArrays, members: Array
) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Two places to begin with bearings: where the lines cross, and ahead along the mean bearing."""
    n00 = n01 = n11 = c0 = c1 = u = v = px = py = 0.0
    count = len(members)
    for n in members:
        s = scan.owner[n]
        cos, sin = math.cos(scan.z[n, 0]), math.sin(scan.z[n, 0])
        x, y = sensors.place[s, 0], sensors.place[s, 1]
        n00, n01, n11 = n00 + sin * sin, n01 - sin * cos, n11 + cos * cos
        c0, c1 = c0 + sin * (sin * x - cos * y), c1 - cos * (sin * x - cos * y)
        u, v, px, py = u + cos, v + sin, px + x / count, py + y / count
    m = sensors.middle
    ahead = (m[0], m[1], m[2])
    size = math.hypot(u, v)
    if size > 1e-3:
        # from between the sensors as far as the region's middle lies
        far = (u * (m[0] - px) + v * (m[1] - py)) / size
        far = max(far, 0.3 * math.hypot(sensors.half[0], sensors.half[1]))
        ahead = (px + far * u / size, py + far * v / size, m[2])
    det = n00 * n11 - n01 * n01
    if det > 1e-9 * count * count:
        return ((n11 * c0 - n01 * c1) / det, (n00 * c1 - n01 * c0) / det, m[2]), ahead
    return ahead, (m[0], m[1], m[2])


@inner_njit
def height_start(
    sensors: SensorArrays, scan: ScanArrays, members: Array, all_slant: bool
) -> tuple[float, float, float, float]:
    """Where a radar without elevation sees its measurement at its own height or at the bottom of the region.

    Of all such places the one that explains all measurements best: chi-square there (infinite if there is none), place.
    """
    least, at = math.inf, (0.0, 0.0, 0.0)
    for n in members:
        s = scan.owner[n]
        if sensors.code[s] != RADAR2D or (all_slant and scan.z[n, 0] > _FAR * sensors.half[2]):
            continue
        for height in (sensors.place[s, 2], sensors.middle[2] - sensors.half[2]):
            there = at_height(sensors, scan, n, height)
            chi = normal(sensors, scan, members, there[0], there[1], there[2])[0]
            if chi < least:
                least, at = chi, there
    return least, at[0], at[1], at[2]


@inner_njit
def singular_start(
    sensors: SensorArrays, scan: ScanArrays, members: Array, near: tuple[float, float, float]
) -> tuple[float, float, float, float]:
    """A start beside the places where azimuths jump: a radar's zenith, and a bearing sensor near the target.

    There a descent cannot turn around the sensor. Tried are the measured azimuth some way off the zenith, and where a
    bearing's ray passes `near`, on the right side of its sensor. Chi-square (infinite if there is none) and place.
    """
    least, at = math.inf, (0.0, 0.0, 0.0)
    owner, code = scan.owner, sensors.code
    for n in members:
        s = owner[n]
        if code[s] != RADAR3D and code[s] != BEARING:
            continue
        x, y, z = sensors.place[s, 0], sensors.place[s, 1], sensors.place[s, 2]
        if code[s] == RADAR3D:
            spread = math.sqrt(sensors.covariance[s, 2, 2])
            off = 0.5 * math.pi - abs(scan.z[n, 2])
            if off > _NEAR_ZENITH * spread:
                continue
            far, azimuth, up = scan.z[n, 0], scan.z[n, 1], math.copysign(1.0, scan.z[n, 2])
            for share in (0.1, 0.3, 1.0, 2.0):
                angle = max(off, share * spread)
                ground = far * math.sin(angle)
                there = (
                    x + ground * math.cos(azimuth),
                    y + ground * math.sin(azimuth),
                    z + up * far * math.cos(angle),
                )
                chi = normal(sensors, scan, members, there[0], there[1], there[2])[0]
                if chi < least:
                    least, at = chi, there
        else:
            cos, sin = math.cos(scan.z[n, 0]), math.sin(scan.z[n, 0])
            along = (near[0] - x) * cos + (near[1] - y) * sin
            across = abs((near[1] - y) * cos - (near[0] - x) * sin)
            # where it passes behind the sensor, ahead by a part of the distance at which it does
            for share in (0.01, 0.3, 1.0):
                far = max(along, share * across)
                there = (x + far * cos, y + far * sin, near[2])
                chi = normal(sensors, scan, members, there[0], there[1], there[2])[0]
                if chi < least:
                    least, at = chi, there
    return least, at[0], at[1], at[2]
