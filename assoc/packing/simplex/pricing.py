"""The allowed columns laid out for pricing: one contiguous pass over them for each of the sensors.

Whatever the simplex method asks of all columns, the sum of something over the rows of each, is then a few sums of whole
arrays, which processors do several at a time. Columns in the basis, and those that a trial leaves out, have the reduced
cost ``inf``: no ratio test chooses them, and nothing has to ask.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import inner_njit
from assoc._types import Floats
from assoc.packing.kernels.copying import copy_to
from assoc.packing.simplex.program import Allowed, Program


class Pricing(NamedTuple):
    """Room for ``n`` columns, of which ``listed[0]`` are listed.

    Attributes
    ----------
    column : int32 array, shape (n,)
        The column at each position.
    position : int32 array, shape (n,)
        The position of each column that is listed; of others anything.
    codes : uint32 array, shape (width, n)
        Rows of the columns, by position; the number of rows, m, where a column has fewer.
    extra_position, extra_row : uint32 arrays
        Further rows: those of cuts; ``listed[1]`` of them.
    reduced : float array, shape (n,)
        Reduced costs by position; ``inf``: not to be chosen.
    entries : float array, shape (n,)
        A row of the tableau, by position.
    terms : float array, shape (m + 1,)
        Room for what is summed up, row by row; the last is 0.
    listed : int64 array, shape (2,)
        How many columns and how many further rows are listed.
    """

    column: NDArray[np.int32]
    position: NDArray[np.int32]
    codes: NDArray[np.uint32]
    extra_position: NDArray[np.uint32]
    extra_row: NDArray[np.uint32]
    reduced: Floats
    entries: Floats
    terms: Floats
    listed: NDArray[np.int64]


def new_pricing(program: Program) -> Pricing:
    """Room for the columns of a program."""
    num, size = program.weights.size, program.sides.size
    extra = int(np.maximum(np.diff(program.start) - program.width, 0).sum())
    return Pricing(
        np.empty(num, np.int32), np.empty(num, np.int32), np.empty((program.width, num), np.uint32),
        np.empty(extra, np.uint32), np.empty(extra, np.uint32), np.empty(num), np.empty(num),
        np.zeros(size + 1), np.zeros(2, np.int64),
    )  # fmt: skip


@inner_njit
def list_columns(program: Program, allowed: Allowed, pricing: Pricing) -> None:
    """List the allowed columns."""
    codes, columns, positions = pricing.codes, pricing.column, pricing.position
    active, start, rows, width = allowed.active, program.start, program.rows, program.width
    extra_position, extra_row, none = pricing.extra_position, pricing.extra_row, np.uint32(program.sides.size)
    extra = 0
    for a in range(active.size):
        j = active[a]
        columns[a] = j
        positions[j] = a
        place = start[j]
        end = start[j + 1]
        for s in range(width):
            if place < end:
                codes[s, a] = rows[place]
                place += 1
            else:
                codes[s, a] = none
        while place < end:
            extra_position[extra] = a
            extra_row[extra] = rows[place]
            extra += 1
            place += 1
    pricing.listed[0] = active.size
    pricing.listed[1] = extra


@inner_njit
def sum_rows(terms: Floats, pricing: Pricing, sums: Floats) -> None:
    """Add to ``sums``, by position, the terms of the rows of each column."""
    copy_to(pricing.terms[: terms.size], terms)
    padded, codes, count = pricing.terms, pricing.codes, pricing.listed[0]
    for s in range(codes.shape[0]):
        for a in range(count):
            sums[a] += padded[codes[s, a]]
    position, row = pricing.extra_position, pricing.extra_row
    for e in range(pricing.listed[1]):
        sums[position[e]] += padded[row[e]]


@inner_njit
def price(program: Program, duals: Floats, place: NDArray[np.int32], pricing: Pricing) -> float:
    """Compute the reduced costs of the listed columns; the least of those that are not in the basis."""
    reduced, column, weights, count = pricing.reduced, pricing.column, program.weights, pricing.listed[0]
    reduced[:count] = 0.0
    sum_rows(duals, pricing, reduced)
    least = 0.0
    for a in range(count):
        j = column[a]
        if place[j] >= 0:
            reduced[a] = np.inf
        else:
            reduced[a] = weights[j] - reduced[a]
            least = min(least, reduced[a])
    return least
