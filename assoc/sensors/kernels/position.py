"""The compiled model of position sensors; see `assoc.sensors.position`."""

from __future__ import annotations

from assoc._system.compiled import inner_njit, lean_inner_njit
from assoc._types import Array
from assoc.sensors.kernels.records import Converted, Information, Six, Three


@lean_inner_njit
def measure_position(dim: int, x: float, y: float, z: float, h: Array) -> None:
    """Write x, y (and z) into h."""
    h[0], h[1] = x, y
    if dim == 3:
        h[2] = z


@lean_inner_njit
def linearise_position(dim: int, x: float, y: float, z: float, h: Array, H: Array) -> None:
    """Write x, y (and z) into h, and ones into H, which holds zeros."""
    h[0], h[1] = x, y
    H[0, 0] = H[1, 1] = 1.0
    if dim == 3:
        h[2] = z
        H[2, 2] = 1.0


@inner_njit
def add_position(dim: int, W: Six, measured: Three, at: Three, sums: Information) -> Information:
    """Add one measurement's share; see `assoc.sensors.kernels.dispatch.add_information`."""
    chi, g0, g1, g2, a0, a1, a2, a3, a4, a5 = sums
    v0, v1 = measured[0] - at[0], measured[1] - at[1]
    v2 = measured[2] - at[2] if dim == 3 else 0.0
    w0 = W[0] * v0 + W[1] * v1 + W[2] * v2
    w1 = W[1] * v0 + W[3] * v1 + W[4] * v2
    w2 = W[2] * v0 + W[4] * v1 + W[5] * v2
    chi += v0 * w0 + v1 * w1 + v2 * w2
    g0, g1, g2 = g0 + w0, g1 + w1, g2 + w2
    a0, a1, a2 = a0 + W[0], a1 + W[1], a2 + W[2]
    a3, a4, a5 = a3 + W[3], a4 + W[4], a5 + W[5]
    return chi, g0, g1, g2, a0, a1, a2, a3, a4, a5


@inner_njit
def convert_position(dim: int, measured: Three, R: Six, middle: float) -> Converted:
    """Position and its covariance; see `assoc.sensors.kernels.dispatch.convert_one`."""
    if dim == 3:
        return measured, R
    return (measured[0], measured[1], middle), (R[0], R[1], 0.0, R[3], 0.0, 1.0)
