"""Chi-square of measurements at a position, its gradient, and the information, compiled.

The measurements of a tuple, its members, are the rows of one array: of a record of arrays every field that a kernel
reads costs a reference count, and these kernels run millions of times a second.
"""

from __future__ import annotations

from assoc._system.compiled import inner_njit
from assoc._types import Array
from assoc.sensors.kernels.dispatch import add_information
from assoc.sensors.kernels.records import Information

# columns of a member: its sensor's kind, dimension, whether it measures full positions, inverse covariance (6), site
CODE, DIM, FULL, WEIGHT, SITE = 0, 1, 2, 3, 9
# the measurement, the variance of its third component, and converted: position, information (6)
MEASURED, RISE, CENTRE, INFORMATION = 12, 15, 16, 19
WIDTH = 25


@inner_njit
def normal(members: Array, x: float, y: float, z: float) -> Information:
    """Chi-square, gradient H' R^-1 nu and information H' R^-1 H of the members, (K, WIDTH), at a position in metres."""
    sums = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    at = (x, y, z)
    for m in range(len(members)):
        W = (
            members[m, WEIGHT], members[m, WEIGHT + 1], members[m, WEIGHT + 2],
            members[m, WEIGHT + 3], members[m, WEIGHT + 4], members[m, WEIGHT + 5],
        )  # fmt: skip
        position = (members[m, SITE], members[m, SITE + 1], members[m, SITE + 2])
        measured = (members[m, MEASURED], members[m, MEASURED + 1], members[m, MEASURED + 2])
        sums = add_information(int(members[m, CODE]), int(members[m, DIM]), W, position, measured, at, sums)
    return sums
