"""The rounding error of a bound from multipliers."""

from __future__ import annotations

from assoc._system.compiled import njit


@njit
def margin(size: float, rows: int) -> float:
    """Largest amount by which rounding can have raised a bound.

    ``size`` is the sum of the multipliers' magnitudes, ``rows`` the most rows that a column has. The reduced costs of
    a solution's columns, which share no row, lose a relative 1.1e-16 of it for each of these rows. The compensated sum
    of the multipliers and the operations on it lose four times as much.
    """
    return max(1e-15, 1.2e-16 * (rows + 4.0)) * size
