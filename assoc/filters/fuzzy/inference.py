"""Mamdani's fuzzy inference with one input, compiled; membership functions are data."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from assoc._system.compiled import njit
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.filters.state import finite


@njit
def infer(
    x: Array, low: float, high: float, sets: Array, universe: Array, outputs: Array, rules: Array, out: Array
) -> int:
    """Mamdani inference, minimum and maximum, with the centroid; inputs (B,), crisp outputs (B,).

    sets (I, 4) are the trapezoids of the input, outputs (O, U) the output sets over the universe (U,),
    rules (K, 2) pairs of an input and an output set. Between points of the universe the combined set is
    taken as a straight line. Inputs are clipped to [low, high]. Returns the number of the first input that is not
    finite or that no rule covers, or -1.
    """
    degree = np.empty(len(outputs))
    for b in range(len(x)):
        if not math.isfinite(x[b]):
            return b
        at = min(max(x[b], low), high)
        degree[:] = 0.0
        for k in range(len(rules)):
            a = sets[rules[k, 0]]
            value = 1.0
            if at < a[1]:
                value = (at - a[0]) / (a[1] - a[0]) if at > a[0] else 0.0
            elif at > a[2]:
                value = (a[3] - at) / (a[3] - a[2]) if at < a[3] else 0.0
            degree[rules[k, 1]] = max(degree[rules[k, 1]], value)
        area = moment = 0.0
        y0 = 0.0
        for u in range(len(universe)):
            y1 = 0.0
            for o in range(len(outputs)):
                y1 = max(y1, min(degree[o], outputs[o, u]))
            if u > 0:
                width = universe[u] - universe[u - 1]
                piece = 0.5 * width * (y0 + y1)
                area += piece
                # the moment of a trapezoid about its left end
                moment += piece * universe[u - 1] + width * width * (y0 + 2.0 * y1) / 6.0
            y0 = y1
        if not area > 0.0:
            return b
        out[b] = moment / area
    return -1


@dataclass(frozen=True, eq=False)
class FuzzyVariable:
    """Named trapezoids over an interval.

    Parameters
    ----------
    sets : mapping name -> (a, b, c, d)
        Rising from a to b, 1 until c, falling to d; a = b or c = d for an edge.

    Raises
    ------
    InvalidInputError
        A trapezoid whose corners are not in order.
    """

    sets: Mapping[str, Sequence[float]]

    def __post_init__(self) -> None:
        if not self.sets:
            raise InvalidInputError("sets must not be empty")
        corners = finite(list(self.sets.values()), "sets", 2)
        if corners.shape[1] != 4:
            raise InvalidInputError(f"sets must have 4 corners each, got {corners.shape[1]}")
        if (np.diff(corners, axis=1) < 0).any() or (corners[:, 0] == corners[:, 3]).any():
            raise InvalidInputError("sets must have their corners in order, a <= b <= c <= d, a < d")
        object.__setattr__(self, "sets", dict(self.sets))

    @cached_property
    def corners(self) -> Array:
        """Corners of all sets, (I, 4)."""
        return np.array(list(self.sets.values()), dtype=np.float64)

    @classmethod
    def from_centres(cls, names: Sequence[str], centres: Sequence[float], reach: float) -> FuzzyVariable:
        """Triangles that fall to zero at their neighbours' centres.

        The outer sets stay at 1 for `reach` beyond their centres.
        """
        c = finite(centres, "centres", 1)
        if len(c) != len(names) or len(c) < 2 or (np.diff(c) <= 0).any():
            raise InvalidInputError(f"centres must be {len(names)} increasing numbers, at least 2")
        sets = {}
        for i, name in enumerate(names):
            left = c[i - 1] if i else c[0] - reach
            right = c[i + 1] if i + 1 < len(c) else c[-1] + reach
            sets[name] = (
                float(left),
                float(left) if i == 0 else float(c[i]),
                float(right) if i + 1 == len(c) else float(c[i]),
                float(right),
            )
        return cls(sets)


@dataclass(frozen=True, eq=False)
class FuzzyRules:
    """Mamdani's inference with one input and one output: minimum, maximum, centroid.

    Parameters
    ----------
    input : FuzzyVariable
    output : FuzzyVariable
    rules : sequence of (str, str)
        If the input is the first, the output is the second.
    points : int
        Of the grid over the output on which the centroid is taken.
    """

    input: FuzzyVariable
    output: FuzzyVariable
    rules: Sequence[tuple[str, str]]
    points: int = 101

    def __post_init__(self) -> None:
        if not self.rules:
            raise InvalidInputError("rules must not be empty")
        for rule in self.rules:
            if len(rule) != 2 or rule[0] not in self.input.sets or rule[1] not in self.output.sets:
                raise InvalidInputError(f"rules: expected a pair of an input and an output set, got {rule!r}")
        if isinstance(self.points, bool) or not isinstance(self.points, int) or self.points < 2:
            raise InvalidInputError(f"points must be a whole number of at least 2, got {self.points!r}")

    @cached_property
    def universe(self) -> Array:
        """Grid over the output, (U,)."""
        corners = self.output.corners
        return np.linspace(corners.min(), corners.max(), self.points)

    @cached_property
    def _tables(self) -> tuple[Array, Array]:
        grid = self.universe
        memberships = np.zeros((len(self.output.corners), len(grid)))
        for row, (a, b, c, d) in zip(memberships, self.output.corners, strict=True):
            row[(grid >= b) & (grid <= c)] = 1.0
            rising, falling = (grid > a) & (grid < b), (grid > c) & (grid < d)
            row[rising] = (grid[rising] - a) / (b - a if b > a else 1.0)
            row[falling] = (d - grid[falling]) / (d - c if d > c else 1.0)
        ins, outs = list(self.input.sets), list(self.output.sets)
        rules = np.array([[ins.index(i), outs.index(o)] for i, o in self.rules], dtype=np.int64)
        return memberships, rules

    @cached_property
    def _ends(self) -> tuple[float, float]:
        """Inputs are clipped to this interval."""
        corners = self.input.corners
        return float(corners[:, 1].min()), float(corners[:, 2].max())

    def __call__(self, inputs: Array) -> Array:
        """Infer the output for each input, (B,).

        Inputs beyond the outermost sets are clipped to their ends; refused is one that is not finite, or that no rule
        covers.
        """
        x = inputs
        if type(x) is not np.ndarray or x.dtype != np.float64 or x.ndim != 1 or not x.flags.c_contiguous:
            x = finite(inputs, "inputs", 1)
        out = np.empty(len(x))
        memberships, rules = self._tables
        bad = infer(x, *self._ends, self.input.corners, self.universe, memberships, rules, out)
        if bad >= 0:
            finite(x, "inputs", 1)
            raise InvalidInputError(f"inputs: no rule covers {np.clip(x[bad], *self._ends):g}")
        return out
