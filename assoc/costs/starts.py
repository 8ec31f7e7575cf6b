"""Starting points of the fit of a position to a tuple, compiled."""

from __future__ import annotations

import math

from assoc._system.compiled import inner_njit
from assoc._types import Array
from assoc.costs.residuals import CENTRE, CODE, FULL, INFORMATION, MEASURED, RISE, SITE, normal
from assoc.costs.symmetric import solve
from assoc.sensors.codes import BEARING, RADAR2D, RADAR3D
from assoc.sensors.kernels.records import Three

# in half heights: without other measurements, ranges above this bend too little for another height to matter
_FAR = 2.0
# a target is near a radar's zenith within so many standard deviations of elevation
_NEAR_ZENITH = 3.0


@inner_njit
def mean_start(members: Array, full: bool) -> Three:
    """The mean of the converted measurements, weighted by their information."""
    b0 = b1 = b2 = a0 = a1 = a2 = a3 = a4 = a5 = 0.0
    last = 0
    for m in range(len(members)):
        if members[m, CODE] == BEARING or (full and not members[m, FULL]):
            continue
        i0, i1, i2 = members[m, INFORMATION], members[m, INFORMATION + 1], members[m, INFORMATION + 2]
        i3, i4, i5 = members[m, INFORMATION + 3], members[m, INFORMATION + 4], members[m, INFORMATION + 5]
        c0, c1, c2 = members[m, CENTRE], members[m, CENTRE + 1], members[m, CENTRE + 2]
        a0, a1, a2, a3, a4, a5 = a0 + i0, a1 + i1, a2 + i2, a3 + i3, a4 + i4, a5 + i5
        b0 += i0 * c0 + i1 * c1 + i2 * c2
        b1 += i1 * c0 + i3 * c1 + i4 * c2
        b2 += i2 * c0 + i4 * c1 + i5 * c2
        last = m
    ok, x, y, z = solve((a0, a1, a2, a3, a4, a5), b0, b1, b2)
    if not ok:
        return members[last, CENTRE], members[last, CENTRE + 1], members[last, CENTRE + 2]
    return x, y, z


@inner_njit
def at_height(members: Array, m: int, z: float) -> Three:
    """The position of a range and azimuth at a height, clipped to what the range allows."""
    far, azimuth = members[m, MEASURED], members[m, MEASURED + 1]
    up = min(max(z - members[m, SITE + 2], -far), far)
    ground = math.sqrt(far * far - up * up)
    return (
        members[m, SITE] + ground * math.cos(azimuth),
        members[m, SITE + 1] + ground * math.sin(azimuth),
        members[m, SITE + 2] + up,
    )


@inner_njit
def bearing_starts(members: Array, middle: Three, half: Three) -> tuple[Three, Three]:
    """Two starts for bearings: where the lines cross, and ahead along the mean bearing."""
    n00 = n01 = n11 = c0 = c1 = u = v = px = py = 0.0
    count = len(members)
    for m in range(count):
        cos, sin = math.cos(members[m, MEASURED]), math.sin(members[m, MEASURED])
        x, y = members[m, SITE], members[m, SITE + 1]
        n00, n01, n11 = n00 + sin * sin, n01 - sin * cos, n11 + cos * cos
        c0, c1 = c0 + sin * (sin * x - cos * y), c1 - cos * (sin * x - cos * y)
        u, v, px, py = u + cos, v + sin, px + x / count, py + y / count
    ahead = middle
    size = math.hypot(u, v)
    if size > 1e-3:
        # from between the sensors as far as the region's middle lies
        far = (u * (middle[0] - px) + v * (middle[1] - py)) / size
        far = max(far, 0.3 * math.hypot(half[0], half[1]))
        ahead = (px + far * u / size, py + far * v / size, middle[2])
    det = n00 * n11 - n01 * n01
    if det > 1e-9 * count * count:
        return ((n11 * c0 - n01 * c1) / det, (n00 * c1 - n01 * c0) / det, middle[2]), ahead
    return ahead, middle


@inner_njit
def height_start(members: Array, middle: Three, half: Three, all_slant: bool) -> tuple[float, float, float, float]:
    """The positions of a radar's measurement without elevation at its own height or at the bottom of the region.

    Of these the one of least chi-square: chi-square (infinite if there is none), position.
    """
    least, at = math.inf, (0.0, 0.0, 0.0)
    for m in range(len(members)):
        if (
            members[m, CODE] != RADAR2D
            or members[m, FULL] > 0.0
            or (all_slant and members[m, MEASURED] > _FAR * half[2])
        ):
            continue
        for height in (members[m, SITE + 2], middle[2] - half[2]):
            there = at_height(members, m, height)
            chi = normal(members, there[0], there[1], there[2])[0]
            if chi < least:
                least, at = chi, there
    return least, at[0], at[1], at[2]


@inner_njit
def singular_start(members: Array, near: Three) -> tuple[float, float, float, float]:
    """A start beside the positions where azimuths jump: a radar's zenith, and a bearing sensor near the target.

    There a descent cannot turn around the sensor. Tried are the measured azimuth some way off the zenith, and where a
    bearing's ray passes `near`, on the right side of its sensor. Chi-square (infinite if there is none) and position.
    """
    least, at = math.inf, (0.0, 0.0, 0.0)
    for m in range(len(members)):
        if members[m, CODE] != RADAR3D and members[m, CODE] != BEARING:
            continue
        x, y, z = members[m, SITE], members[m, SITE + 1], members[m, SITE + 2]
        first, second, third = members[m, MEASURED], members[m, MEASURED + 1], members[m, MEASURED + 2]
        if members[m, CODE] == RADAR3D:
            spread = math.sqrt(members[m, RISE])
            off = 0.5 * math.pi - abs(third)
            if off > _NEAR_ZENITH * spread:
                continue
            far, azimuth, up = first, second, math.copysign(1.0, third)
            for share in (0.1, 0.3, 1.0, 2.0):
                angle = max(off, share * spread)
                ground = far * math.sin(angle)
                there = (
                    x + ground * math.cos(azimuth),
                    y + ground * math.sin(azimuth),
                    z + up * far * math.cos(angle),
                )
                chi = normal(members, there[0], there[1], there[2])[0]
                if chi < least:
                    least, at = chi, there
        else:
            cos, sin = math.cos(first), math.sin(first)
            along = (near[0] - x) * cos + (near[1] - y) * sin
            across = abs((near[1] - y) * cos - (near[0] - x) * sin)
            # where it passes behind the sensor, ahead by a part of the distance at which it does
            for share in (0.01, 0.3, 1.0):
                far = max(along, share * across)
                there = (x + far * cos, y + far * sin, near[2])
                chi = normal(members, there[0], there[1], there[2])[0]
                if chi < least:
                    least, at = chi, there
    return least, at[0], at[1], at[2]
