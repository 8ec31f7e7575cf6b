"""The arrays of a problem: checked, and brought into its form."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assoc.errors import InvalidInputError, warn

# a measurement needs a singleton of S indices, a cost and a name: half a gigabyte in all
MOST_SINGLETON_NUMBERS = 64_000_000
# larger sums of costs could overflow in a solver
MOST_TOTAL_COST = 1e300


def costs_alone(matrix: NDArray[np.float64], unassigned: float | Sequence[ArrayLike]) -> list[NDArray[np.float64]]:
    """Costs of leaving rows (n,) and columns (m,) unassigned."""
    single = isinstance(unassigned, (int, float, np.number))
    both: list[Any] = (
        [unassigned, unassigned] if single else list(unassigned) if isinstance(unassigned, (list, tuple)) else []
    )
    if len(both) != 2:
        found = f"{len(both)} values" if both else type(unassigned).__name__
        raise InvalidInputError(f"unassigned: expected a number, or costs of the rows and of the columns, got {found}")
    alone = []
    for name, costs, count in zip(("rows", "columns"), both, matrix.shape, strict=True):
        numbers = real_numbers(costs, f"unassigned: {name}")
        if numbers.shape not in ((), (count,)):
            raise InvalidInputError(f"unassigned: {name}: expected {count} numbers, got shape {numbers.shape}")
        if not (numbers > -np.inf).all():
            raise InvalidInputError(
                f"unassigned: {name}: expected numbers, got {numbers[~(numbers > -np.inf)].flat[0]}"
            )
        alone.append(np.broadcast_to(numbers, (count,)).copy())
    # to leave one more is dearer than any choice of pairs, but not so dear that costs are lost in rounding
    finite = np.concatenate([matrix[np.isfinite(matrix)], *(costs[np.isfinite(costs)] for costs in alone)])
    dear = min(matrix.shape) * float(np.ptp(finite)) + float(np.abs(finite).max()) if finite.size else 0.0
    return [np.where(np.isposinf(costs), dear or 1.0, costs) for costs in alone]


def checked_dummy(dummy: object) -> bool:
    """Whether measurements may be false alarms, as a caller says it."""
    if not isinstance(dummy, (bool, np.bool_)):
        found = repr(dummy) if isinstance(dummy, (str, int, float)) else type(dummy).__name__
        raise InvalidInputError(f"dummy: expected True or False, got {found}")
    return bool(dummy)


def integers(values: ArrayLike, name: str, ndim: int) -> NDArray[np.int64]:
    """Whole numbers of a caller; with another type, dimension or fraction one line says so."""
    try:
        array = np.asarray(values)
    except ValueError as error:
        raise InvalidInputError(f"{name}: {error}") from None
    if array.size == 0 and array.dtype.kind == "f":
        array = array.astype(np.int64)
    if array.dtype.kind not in "iu" or np.ma.is_masked(values):
        found = "a masked array" if np.ma.is_masked(values) else array.dtype
        raise InvalidInputError(f"{name}: expected integers, got {found}")
    if array.ndim == 1 and ndim == 2 and array.size == 0:
        array = array.reshape(0, 0)
    if array.ndim != ndim:
        raise InvalidInputError(f"{name}: expected {ndim} dimension(s), got shape {array.shape}")
    if array.dtype.kind == "u" and array.size and array.max() > np.iinfo(np.int64).max:
        raise InvalidInputError(f"{name}: a value exceeds 64 bits")
    return array.astype(np.int64, copy=False) if array.dtype != np.int32 else array


def real_numbers(values: ArrayLike, name: str) -> NDArray[np.float64]:
    """Numbers of a caller; complex ones, texts and ragged lists are refused in one line."""
    try:
        array = np.asarray(values)
    except ValueError:
        raise InvalidInputError(f"{name}: expected rows of the same length; inf forbids an entry") from None
    if hasattr(values, "tocoo"):
        raise InvalidInputError(f"{name}: is sparse; AssignmentProblem.from_sparse(costs, dummy=False) reads it")
    if array.dtype.kind not in "fiu" and array.size:
        raise InvalidInputError(f"{name}: expected real numbers, got {array.dtype}")
    numbers = array.astype(np.float64, copy=False)
    # masked entries are forbidden
    return np.where(np.ma.getmaskarray(np.ma.asarray(values)), np.inf, numbers) if np.ma.is_masked(values) else numbers


def is_whole_matrix(costs: NDArray[np.float64]) -> bool:
    """Whether costs are a matrix without forbidden entries, whose sums stay in range."""
    if costs.ndim != 2 or not costs.size or 4 * sum(costs.shape) > MOST_SINGLETON_NUMBERS:
        return False
    # NaN is not below anything
    return bool(max(-costs.min(), costs.max()) <= MOST_TOTAL_COST / costs.size)


def warn_of_dummy_cost(cost: float, name: str) -> None:
    """Warn of an all-dummy entry that is ignored although it looks like a cost."""
    if cost != 0.0 and np.isfinite(cost):
        at = "at index 0 of every dimension, which is the dummy"
        warn(f"{name}: ignores the cost {cost:g} {at}; without dummies, pass dummy=False")


def check_indices(tuples: NDArray[np.int64], sizes: NDArray[np.int64], dummy: bool) -> NDArray[np.bool_]:
    """Refuse indices out of range and the all-dummy tuple; return which tuples are singletons."""
    if tuples.shape[0] == 0:
        return np.zeros(0, dtype=np.bool_)
    # a contiguous array for each sensor: numpy is slow along the short axis of a long array
    columns = np.ascontiguousarray(tuples.T)
    low, high = columns.min(axis=1), columns.max(axis=1)
    least = 0 if dummy else 1
    wrong = (low < least) | (high > sizes)
    if wrong.any():
        sensor = int(np.argmax(wrong))
        column = columns[sensor]
        row = int(np.flatnonzero((column < least) | (column > sizes[sensor]))[0])
        raise InvalidInputError(
            f"tuples: row {row}, sensor {sensor + 1}: index {column[row]} is outside {least}..{sizes[sensor]}"
        )
    found = (columns != 0).sum(axis=0, dtype=np.int16)
    if dummy and not found.all():
        row = int(np.argmin(found))
        raise InvalidInputError(f"tuples: row {row} is the all-dummy tuple: indices count from 1, 0 is the dummy")
    return found == 1


def all_finite(costs: NDArray[np.float64]) -> bool:
    """Whether all costs are finite and their sums stay in range."""
    with np.errstate(over="ignore"):
        return not costs.size or float(np.abs(costs).sum()) <= MOST_TOTAL_COST


def allowed(costs: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which tuples are allowed (not inf); refuses NaN and -inf."""
    bad = np.isnan(costs) | np.isneginf(costs)
    if bad.any():
        row = int(np.argmax(bad))
        raise InvalidInputError(f"costs: row {row} is {costs[row]}; expected a number, or inf for a forbidden tuple")
    keep: NDArray[np.bool_] = ~np.isposinf(costs)
    if not all_finite(costs[keep]):
        raise InvalidInputError(
            f"costs: the sum of magnitudes exceeds {MOST_TOTAL_COST:.0e}; inf forbids a tuple, or rescale the costs"
        )
    return keep


def with_singletons(
    tuples: NDArray[np.int64], costs: NDArray[np.float64], sizes: NDArray[np.int64], alone: NDArray[np.bool_]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Append the singletons that are not listed, at cost 0; ``alone`` marks the tuples that are singletons."""
    offsets = np.cumsum(sizes) - sizes
    present = np.zeros(int(sizes.sum()), dtype=np.bool_)
    listed = tuples[alone]
    present[(listed + (offsets - 1))[listed > 0]] = True
    if present.all():
        return tuples, costs
    missing = np.flatnonzero(~present)
    sensor = np.searchsorted(offsets, missing, side="right") - 1
    extra = np.zeros((missing.size, sizes.size), dtype=tuples.dtype)
    extra[np.arange(missing.size), sensor] = missing - offsets[sensor] + 1
    return np.concatenate([tuples, extra]), np.concatenate([costs, np.zeros(missing.size)])


def frozen(array: NDArray[Any], dtype: type) -> NDArray[Any]:
    """A copy in C order that cannot be written."""
    result: NDArray[Any] = np.array(array, dtype=dtype, order="C")
    result.flags.writeable = False
    return result


def rows_of_frame(frame: Any, cost: str) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Tuples and costs of a table; see `AssignmentProblem.from_frame`."""
    if not hasattr(frame, "columns") or not hasattr(frame, "drop"):
        raise InvalidInputError(f"frame: expected a pandas DataFrame, got {type(frame).__name__}")
    if cost not in frame.columns:
        raise InvalidInputError(f"frame: has no column {cost!r}, only {', '.join(map(str, frame.columns))}")
    twice = frame.columns[frame.columns.duplicated()]
    if len(twice):
        raise InvalidInputError(f"frame: expected columns of different names, got {twice[0]!r} twice")
    columns = []
    for name in frame.columns.drop(cost):
        try:
            if frame[name].dtype.kind in "mM":
                raise TypeError("times are no numbers")
            numbers = frame[name].to_numpy(dtype=np.float64, na_value=0.0)
        except (TypeError, ValueError):
            raise InvalidInputError(f"frame: column {name!r}: expected whole numbers") from None
        numbers = np.where(np.isnan(numbers), 0.0, numbers)
        # check the range before the cast
        if (np.abs(numbers) > np.iinfo(np.int32).max).any() or (numbers != np.round(numbers)).any():
            raise InvalidInputError(f"frame: column {name!r}: expected whole numbers")
        columns.append(numbers.astype(np.int64))
    if not columns:
        raise InvalidInputError("frame: expected a column for each sensor beside the costs, got none")
    tuples = np.stack(columns, axis=1)
    return tuples, real_numbers(frame[cost].to_numpy(), f"frame: column {cost!r}")


def entries_of_sparse(array: Any, dummy: bool) -> tuple[NDArray[np.int64], NDArray[np.float64], list[int]]:
    """Tuples, costs and sizes of a sparse array; see `AssignmentProblem.from_sparse`."""
    entries = array.tocoo(copy=True) if callable(getattr(array, "tocoo", None)) else array
    if not all(hasattr(entries, name) for name in ("coords", "data", "shape")):
        raise InvalidInputError(f"array: expected a sparse array (scipy.sparse), got {type(array).__name__}")
    if hasattr(entries, "sum_duplicates"):
        entries.sum_duplicates()
    index = integers(np.stack([np.asarray(axis) for axis in entries.coords], axis=1), "array: coords", 2)
    costs = real_numbers(entries.data, "array")
    if dummy and min(entries.shape) == 0:
        raise InvalidInputError(f"array: each dimension needs its dummy at index 0, got {entries.shape}")
    keep = index.any(axis=1) if dummy else np.ones(costs.size, dtype=np.bool_)
    for cost in costs[~keep]:
        warn_of_dummy_cost(float(cost), "array")
    offset = 0 if dummy else 1
    sizes = [int(n) - (1 - offset) for n in entries.shape]
    return index[keep].astype(np.int64) + offset, costs[keep], sizes
