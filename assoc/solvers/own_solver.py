"""Users' solvers: they get a copy of the packing, and their answers are checked."""

from __future__ import annotations

from collections.abc import Callable
from numbers import Integral
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assoc._parameters import Parameters
from assoc.errors import InvalidInputError
from assoc.packing.packing import Packing
from assoc.packing.run import Outcome, Run, SolveFunction


def guarded(name: str, solve: Callable[..., object]) -> SolveFunction:
    """Return a solver that works on a copy of the packing, and whose answer is checked; its bound is dropped."""

    def solve_guarded(packing: Packing, parameters: Parameters, run: Run) -> Outcome:
        return _believed(solve(packing.read_only(), parameters, run), packing, f"solver {name!r}: expected")

    return solve_guarded


def _believed(outcome: object, packing: Packing, expected: str) -> Outcome:
    """Return the parts of an outcome that can be checked: columns, iterations, and multipliers."""
    if not isinstance(outcome, Outcome):
        raise InvalidInputError(f"{expected} it to return an Outcome, got {type(outcome).__name__}")
    columns = _array(outcome.columns)
    if columns.ndim != 1 or (columns.size and columns.dtype.kind not in "iu"):
        raise InvalidInputError(f"{expected} the columns of its Outcome to be a list of whole numbers, {_got(columns)}")
    wrong = columns[(columns < 0) | (columns >= packing.num_columns)] if columns.size else columns
    if wrong.size:
        raise InvalidInputError(
            f"{expected} the columns of its Outcome to be among the packing's {packing.num_columns}, got {wrong[0]}"
        )
    if not isinstance(outcome.iterations, Integral) or outcome.iterations < 0:
        got = f"got {outcome.iterations!r:.40}"
        raise InvalidInputError(f"{expected} the iterations of its Outcome to be a whole number of at least 0, {got}")
    duals = None
    if outcome.duals is not None:
        duals = _array(outcome.duals)
        if duals.shape != (packing.num_rows,) or duals.dtype.kind not in "fiu" or not np.isfinite(duals).all():
            raise InvalidInputError(
                f"{expected} the duals of its Outcome to be {packing.num_rows} numbers, one for each row, {_got(duals)}"
            )
        duals = duals.astype(np.float64)
        duals = np.where(packing.slack, np.minimum(duals, 0.0), duals)
    return Outcome(columns.astype(np.int64), int(outcome.iterations), duals=duals)


def _array(values: Any) -> NDArray[Any]:
    try:
        return np.asarray(values)
    except (TypeError, ValueError, OverflowError):  # for example lists of different lengths
        return np.array(None)


def _got(array: NDArray[Any]) -> str:
    return f"got an array of shape {array.shape} and type {array.dtype}"
