"""A solution to begin with, checked and brought into the form in which solvers see the problem."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assoc.errors import InvalidInputError
from assoc.packing.prepare import Prepared
from assoc.problem import AssignmentProblem
from assoc.solution import Solution


def start_columns(problem: AssignmentProblem, prepared: Prepared, start: object) -> NDArray[np.int64]:
    """Return the columns of a packing that a solution of its problem chooses, ascending.

    Raises
    ------
    InvalidInputError
        It is no solution of this problem: it has other sensors, a tuple that is no candidate here, or does not use
        every measurement exactly once.
    """
    if not isinstance(start, Solution):
        raise InvalidInputError(f"start: expected a Solution, got {type(start).__name__}")
    tuples = np.asarray(start.tuples)
    if tuples.ndim != 2 or tuples.shape[1] != problem.num_sensors:
        shape = " x ".join(map(str, tuples.shape))
        raise InvalidInputError(f"start: expected tuples of {problem.num_sensors} sensors, got an array of {shape}")
    if ((tuples < 0) | (tuples > problem.sizes)).any():
        raise InvalidInputError("start: names measurements that the problem does not have")
    for s, size in enumerate(problem.sizes.tolist()):
        used = np.bincount(tuples[:, s], minlength=size + 1)[1:]
        # without dummies only the measurements of the smallest sensors must be used
        needed = problem.dummy or size == problem.sizes.min()
        wrong = np.flatnonzero(used != 1) if needed else np.flatnonzero(used > 1)
        if wrong.size:
            count = used[wrong[0]]
            raise InvalidInputError(
                f"start: expected every measurement exactly once; measurement {wrong[0] + 1} of sensor {s + 1} is in "
                f"{count} tuples"
            )
    before = np.cumsum(problem.sizes) - problem.sizes
    wanted = np.where(tuples > 0, tuples + before - 1, -1)
    packing = prepared.packing
    rows = np.where(packing.cols >= 0, packing.row_origin[packing.cols], -1) if packing.num_columns else packing.cols
    which = _places(rows, wanted)
    known = np.zeros(len(wanted), dtype=bool)
    known[which[which >= 0]] = True
    known |= problem.dummy & (np.count_nonzero(tuples, axis=1) == 1)
    if not known.all():
        # with dummies, a tuple that costs no less than its false alarms is no column
        listed = _places(np.where(problem.tuples > 0, problem.tuples + before - 1, -1), wanted)
        known[listed[listed >= 0]] = True
    if not known.all():
        first = ", ".join(map(str, tuples[np.argmin(known)].tolist()))
        raise InvalidInputError(f"start: the tuple ({first}) is no candidate of this problem")
    # of tuples that are listed twice the cheaper one
    columns = np.flatnonzero(which >= 0)
    columns = columns[np.argsort(packing.weights[columns], kind="stable")]
    return np.sort(columns[np.unique(which[columns], return_index=True)[1]])


def _places(rows: NDArray[np.integer], wanted: NDArray[np.integer]) -> NDArray[np.int64]:
    """Place of each line of rows (-1: none) among the wanted ones, which share no row; -1 where it is none of them."""
    owner = np.full(max(int(rows.max(initial=-1)), int(wanted.max(initial=-1))) + 2, -1)
    for column in wanted.T:
        owner[column[column >= 0]] = np.flatnonzero(column >= 0)
    if not len(rows):
        return np.zeros(0, dtype=np.int64)
    place = owner[rows[np.arange(len(rows)), np.argmax(rows >= 0, axis=1)]]
    return np.where((place >= 0) & (rows == wanted[place]).all(axis=1), place, -1)
