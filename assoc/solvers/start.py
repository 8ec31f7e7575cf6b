"""Start solutions: checked and translated to columns of a packing."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assoc.errors import InvalidInputError
from assoc.packing.cover import Cover
from assoc.packing.prepare import Prepared
from assoc.packing.run import Run
from assoc.problem import AssignmentProblem
from assoc.solution import Solution


def start_columns(
    problem: AssignmentProblem, prepared: Prepared, start: object, run: Run
) -> NDArray[np.integer] | None:
    """Return the columns of a packing that a start solution chooses, as far as the packing has them.

    Without dummies, rows that stay uncovered are covered by ejections; None where that fails. A start with other
    sensors, tuples that are not whole numbers, or a measurement in two is refused.
    """
    if not isinstance(start, Solution):
        raise InvalidInputError(f"start: expected a Solution, got {type(start).__name__}")
    tuples = np.asarray(start.tuples)
    if tuples.ndim != 2 or tuples.shape[1] != problem.num_sensors:
        shape = " x ".join(map(str, tuples.shape))
        raise InvalidInputError(f"start: expected tuples of {problem.num_sensors} sensors, got an array of {shape}")
    if tuples.size and (tuples.dtype.kind not in "iu" or tuples.min() < 0):
        found = tuples.min() if tuples.dtype.kind in "iu" else tuples.dtype
        raise InvalidInputError(f"start: expected tuples of whole numbers, 0 for a miss, got {found}")
    for s, column in enumerate(tuples.T):
        used, counts = np.unique(column[column > 0], return_counts=True)
        if (counts > 1).any():
            which, count = used[counts.argmax()], counts.max()
            raise InvalidInputError(
                f"start: expected every measurement once; measurement {which} of sensor {s + 1} is in {count} tuples"
            )
    tuples = tuples[(tuples <= problem.sizes).all(axis=1)].astype(np.int64)
    before = np.cumsum(problem.sizes) - problem.sizes
    packing = prepared.packing
    rows = np.where(packing.cols >= 0, packing.row_origin[packing.cols], -1) if packing.num_columns else packing.cols
    which = _indices_among(rows, np.where(tuples > 0, tuples + before - 1, -1))
    # the cheaper one of tuples that are listed twice
    columns = np.flatnonzero(which >= 0)
    columns = columns[np.argsort(packing.weights[columns], kind="stable")]
    columns = np.sort(columns[np.unique(which[columns], return_index=True)[1]])
    cover = Cover.of(packing, columns)
    if cover.is_complete:
        return columns
    cover.improve(run.deadline())
    return cover.columns() if cover.is_complete else None


def _indices_among(rows: NDArray[np.integer], wanted: NDArray[np.integer]) -> NDArray[np.int64]:
    """Index of each line of rows (-1: none) among the wanted ones, which share no row; -1 where it is not there."""
    owner = np.full(max(int(rows.max(initial=-1)), int(wanted.max(initial=-1))) + 2, -1)
    for column in wanted.T:
        owner[column[column >= 0]] = np.flatnonzero(column >= 0)
    if not len(rows):
        return np.zeros(0, dtype=np.int64)
    index = owner[rows[np.arange(len(rows)), np.argmax(rows >= 0, axis=1)]]
    return np.where((index >= 0) & (rows == wanted[index]).all(axis=1), index, -1)
