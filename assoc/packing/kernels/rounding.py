"""What rounding can have done to a bound that multipliers give."""

from __future__ import annotations

from assoc._system.compiled import njit


@njit
def margin(size: float, rows: int) -> float:
    """By how much rounding can have lifted a bound, at the most.

    ``size`` is the sum of the multipliers' magnitudes, ``rows`` how many rows a column has at the most. The reduced
    costs of a solution's columns, which share no row, lose a rounding (1.1e-16) of it for each of these rows. The sum
    of the multipliers, where what each addition loses is kept, and what is done with it lose four more.
    """
    return max(1e-15, 1.2e-16 * (rows + 4.0)) * size
