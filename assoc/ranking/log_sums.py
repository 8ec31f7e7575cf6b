"""A planned sweep in logarithms: slow, for clusters whose sums lose all digits where costs are huge.

Multipliers of a relaxation leave each solution a reduced cost of at least the relaxation's gap, which grows with the
costs. Where it is in the hundreds, every weight of `assoc.ranking.sweep` underflows; their logarithms do not.
"""

from __future__ import annotations

import numpy as np

from assoc._types import Array, Floats, Ints
from assoc.ranking.sweep import CLOSE, KEEP, OPEN

_MOST_NUMBERS = 2**23
"""Numbers that all tables of a sweep hold at most, which are kept for the way back; 8 bytes each."""


def is_short(steps: Ints) -> bool:
    """Whether the tables of these steps, (N, 3), are small enough to be kept."""
    width = np.cumsum((steps[:, 0] == OPEN) * 1 - (steps[:, 0] == CLOSE))
    return bool(np.ldexp(1.0, width).sum() <= _MOST_NUMBERS)


def swept_in_logarithms(steps: Ints, log_weights: Floats, log_free: Floats, probability: Floats, alone: Floats) -> None:
    """What `assoc.ranking.sweep.swept` does, of logarithms of weights; there must be an event of positive weight."""
    table, before = np.zeros(1), []
    with np.errstate(invalid="ignore"):
        for kind, what, bits in steps.tolist():
            before.append(table)
            if kind == OPEN:
                table = np.append(table, np.full(len(table), -np.inf))
            elif kind == CLOSE:
                off, on = _halves(len(table), bits)
                table = np.logaddexp(log_free[what] + table[off], table[on])
            elif kind != KEEP:
                off, on = _halves(len(table), bits)
                table = table.copy()
                table[on] = np.logaddexp(table[on], log_weights[what] + table[off])
        total, rest = table[0], np.zeros(1)
        for (kind, what, bits), table in zip(steps[::-1].tolist(), reversed(before), strict=True):
            if kind == OPEN:
                rest = rest[: len(table)]
            elif kind == CLOSE:
                off, on = _halves(len(table), bits)
                alone[what] = np.exp(min(_sum(log_free[what] + table[off] + rest) - total, 0.0))
                completed = np.empty(len(table))
                completed[off], completed[on] = log_free[what] + rest, rest
                rest = completed
            elif kind != KEEP:
                off, on = _halves(len(table), bits)
                probability[what] = np.exp(min(_sum(log_weights[what] + table[off] + rest[on]) - total, 0.0))
                rest = rest.copy()
                rest[off] = np.logaddexp(rest[off], log_weights[what] + rest[on])


def _halves(size: int, bits: int) -> tuple[Array, Array]:
    """Entries in which none of the bits is set, and those with all of them, in the same order."""
    index = np.arange(size)
    off = index[index & bits == 0]
    return off, off | bits


def _sum(logarithms: Floats) -> float:
    """Logarithm of a sum."""
    top = logarithms.max()
    return float(top + np.log(np.exp(logarithms - top).sum())) if np.isfinite(top) else -np.inf
