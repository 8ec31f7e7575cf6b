"""Single measurements converted to positions with a covariance: where to look, and where to start from."""

from __future__ import annotations

import numpy as np

from assoc._system.compiled import njit
from assoc._types import Array
from assoc.costs.symmetric import inverse_by_cofactors
from assoc.sensors.codes import BEARING
from assoc.sensors.kernels.dispatch import convert_one
from assoc.sensors.kernels.radar import START_REACH

HEIGHTS = 3.0
"""Where no sensor measures full positions, heights are sought this many half heights around the middle."""


@njit
def convert(
    code: Array,
    dim: Array,
    place: Array,
    covariance: Array,
    middle: Array,
    half: Array,
    z: Array,
    owner: Array,
    reach: float,
    least: float,
) -> tuple[Array, Array, Array]:
    """Convert measurements (N, 3) to positions.

    The covariance is the linearised one, widened where the measurement bends so much that its ellipsoid of
    chi-square value `least` would not hold all positions within `reach`, the largest gate: by the sagitta of
    the arc for radars, and by the ground ranges of all heights sought where the height is open.

    Returns
    -------
    centre (N, 3), spread (N, 6), information (N, 6)
        Position, covariance as (xx, xy, xz, yy, yz, zz) for the gate, and the inverse covariance for a start,
        which does not depend on the gate. Zeros for bearings, and of x and y alone for measurements that
        leave the height open.
    """
    count = len(z)
    centre, spread, information = np.zeros((count, 3)), np.zeros((count, 6)), np.zeros((count, 6))
    heights = (middle[2] - HEIGHTS * half[2], middle[2], middle[2] + HEIGHTS * half[2])
    for n in range(count):
        s = owner[n]
        if code[s] == BEARING:
            continue
        R = covariance[s]
        U = R[0, 0], R[0, 1], R[0, 2], R[1, 1], R[1, 2], R[2, 2]
        one, at = (z[n, 0], z[n, 1], z[n, 2]), (place[s, 0], place[s, 1], place[s, 2])
        # as wide as the gate asks, then as for any start
        _, wide = convert_one(code[s], dim[s], one, at, U, heights, reach, least)
        there, c = convert_one(code[s], dim[s], one, at, U, heights, START_REACH, START_REACH)
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
