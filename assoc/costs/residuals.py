"""How well a position explains measurements, compiled: chi-square, its gradient, and the information."""

from __future__ import annotations

from assoc._system.compiled import inner_njit
from assoc._types import Array
from assoc.costs.arrays import ScanArrays, SensorArrays
from assoc.sensors.kernels.dispatch import add_information
from assoc.sensors.kernels.records import Information


@inner_njit
def normal(
    sensors: SensorArrays, scan: ScanArrays, members: Array, x: float, y: float, z: float
) -> Information:
    """Chi-square, gradient H' R^-1 nu and information H' R^-1 H of the members at a position."""
    sums = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    # out of the tuples first: a field read in the loop costs a reference count each time
    owner, measured, code, dim = scan.owner, scan.z, sensors.code, sensors.dim
    places, weights = sensors.place, sensors.weight
    at = (x, y, z)
    for n in members:
        s = owner[n]
        W = (
            weights[s, 0, 0], weights[s, 0, 1], weights[s, 0, 2],
            weights[s, 1, 1], weights[s, 1, 2], weights[s, 2, 2],
        )  # fmt: skip
        place = (places[s, 0], places[s, 1], places[s, 2])
        one = (measured[n, 0], measured[n, 1], measured[n, 2])
        sums = add_information(code[s], dim[s], W, place, one, at, sums)
    return sums
