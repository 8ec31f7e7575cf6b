"""The allowed columns, laid out for pricing as one array per sensor.

Sums over the rows of every column are then a few sums of whole arrays, which processors vectorise. Columns in the basis
and those that a trial excludes have the reduced cost ``inf``, so that no ratio test chooses them. Slacks follow the
columns in the arrays of the ratio test.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import inner_njit, lean_inner_njit
from assoc._types import Floats
from assoc.packing.simplex.program import Allowed, Program


class Pricing(NamedTuple):
    """Buffers for ``n`` columns, of which ``listed[0]`` are listed, followed by the ``m`` slacks."""

    column: NDArray[np.int32]
    """The column at each position, (n,)."""
    position: NDArray[np.int32]
    """The position of each listed column, (n,); undefined for others."""
    codes: NDArray[np.uint32]
    """Rows of the columns, by position, padded with the number of rows m, (max(width, 3), n)."""
    extra_position: NDArray[np.uint32]
    """The ``listed[1]`` further rows of columns, those of cuts."""
    extra_row: NDArray[np.uint32]
    reduced: Floats
    """Reduced costs by position, (n + m,); ``inf`` for columns that must not enter."""
    entries: Floats
    """A row of the tableau, by position, (n + m,)."""
    ratios: Floats
    """Steps of the multipliers to reduced costs 0, then possible pivots; else scores of basis positions."""
    bits: NDArray[np.int64]
    """The memory of ``ratios``, read as whole numbers (dual.py)."""
    terms: Floats
    """Buffer for the terms of sums, by row, (m + 1,); the last is 0."""
    listed: NDArray[np.int64]
    """Numbers of columns and of further rows listed, (2,)."""


def new_pricing(program: Program) -> Pricing:
    """Allocate pricing for the columns of a program."""
    num, size = program.weights.size, program.sides.size
    extra = int(np.maximum(np.diff(program.start) - program.width, 0).sum())
    ratios = np.empty(num + size)
    return Pricing(
        np.empty(num, np.int32), np.empty(num, np.int32), np.empty((max(program.width, 3), num), np.uint32),
        np.empty(extra, np.uint32), np.empty(extra, np.uint32),
        np.empty(num + size), np.empty(num + size), ratios, ratios.view(np.int64),
        np.zeros(size + 1), np.zeros(2, np.int64),
    )  # fmt: skip


@inner_njit
def list_columns(program: Program, allowed: Allowed, pricing: Pricing) -> None:
    """List the allowed columns."""
    codes, columns, positions = pricing.codes, pricing.column, pricing.position
    active, start, rows, width = allowed.active, program.start, program.rows, codes.shape[0]
    extra_position, extra_row, none = pricing.extra_position, pricing.extra_row, np.uint32(program.sides.size)
    extra = 0
    for a in range(active.size):
        j = active[a]
        columns[a] = j
        positions[j] = a
        position = start[j]
        end = start[j + 1]
        for s in range(width):
            if position < end:
                codes[s, a] = rows[position]
                position += 1
            else:
                codes[s, a] = none
        while position < end:
            extra_position[extra] = a
            extra_row[extra] = rows[position]
            extra += 1
            position += 1
    pricing.listed[0] = active.size
    pricing.listed[1] = extra


@lean_inner_njit
def sum_rows(terms: Floats, factor: float, pricing: Pricing, sums: Floats) -> None:
    """Fill ``sums``, by position, with the terms of the rows of each column, times a factor."""
    padded, codes, count = pricing.terms, pricing.codes, pricing.listed[0]
    for r in range(terms.size):
        padded[r] = factor * terms[r]
    # most columns have three rows or fewer: one pass
    for a in range(count):
        sums[a] = padded[codes[0, a]] + padded[codes[1, a]] + padded[codes[2, a]]
    for s in range(3, codes.shape[0]):
        for a in range(count):
            sums[a] += padded[codes[s, a]]
    position, row = pricing.extra_position, pricing.extra_row
    for e in range(pricing.listed[1]):
        sums[position[e]] += padded[row[e]]


@lean_inner_njit
def price(program: Program, duals: Floats, position: NDArray[np.int32], pricing: Pricing) -> float:
    """Compute the reduced costs of the listed columns; return the least outside the basis."""
    reduced, column, weights, count = pricing.reduced, pricing.column, program.weights, pricing.listed[0]
    sum_rows(duals, 1.0, pricing, reduced)
    least = 0.0
    for a in range(count):
        j = column[a]
        if position[j] >= 0:
            reduced[a] = np.inf
        else:
            reduced[a] = weights[j] - reduced[a]
            least = min(least, reduced[a])
    return least
