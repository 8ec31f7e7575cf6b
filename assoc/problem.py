"""The sparse multidimensional (S-D) assignment problem that all solvers take."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assoc._files.problem_text import is_text, read_problem_text, write_problem_text
from assoc._system import memory
from assoc._system.wrong_types import explains_wrong_types
from assoc.errors import InvalidInputError, LimitExceededError, warn

if TYPE_CHECKING:
    import pandas as pd

FORMAT = "assoc.problem"
VERSION = 1

_MAX_DENSE_ELEMENTS = 200_000_000
# a measurement needs a singleton of S indices, a cost and a name: half a gigabyte in all
_MAX_SINGLETON_NUMBERS = 64_000_000
_DENSE = (np.ndarray, list, tuple)
_FROM_DENSE = (
    "AssignmentProblem.from_matrix(costs) takes a matrix as scipy's linear_sum_assignment does, from_matrix(costs, "
    "unassigned=...) with costs of leaving rows and columns unassigned, from_dense(costs) one that has these as row 0 "
    "and column 0"
)
# larger sums of costs could overflow in a solver
_MAX_TOTAL_COST = 1e300


@explains_wrong_types
class AssignmentProblem:
    """Choose tuples of minimum total cost such that each measurement is in exactly one.

    Parameters
    ----------
    tuples : array_like of int, shape (M, S)
        One index per sensor, 1..n_s; 0 is the dummy (that sensor missed the target).
    costs : array_like of float, shape (M,)
        Cost of each tuple: negative log likelihood ratio, natural log. ``inf`` forbids the tuple.
    sizes : array_like of int, shape (S,)
        Number of measurements n_s of each sensor.
    dummy : bool, default True
        With dummies a missing singleton (a false alarm) is added at cost 0, so that a solution always
        exists. Without dummies the problem is the axial one: a solution uses every index of the smallest dimension
        exactly once, those of larger dimensions at most once, and no tuple may contain a 0.

    Attributes
    ----------
    tuples, costs, sizes, dummy
        As given, in canonical types (int32, float64, int32), read-only; forbidden tuples are left out.

    Raises
    ------
    InvalidInputError
        Wrong shape, an index out of range, the all-dummy tuple, a cost that is NaN or -inf, or a `dummy` that is
        neither True nor False.
    LimitExceededError
        More measurements (ten million of four sensors, for example) or tuples than memory allows.

    Notes
    -----
    With dummies this is eq. 6 of the ant colony paper, restricted to the listed tuples. A tuple
    listed twice counts with its smaller cost.
    """

    __slots__ = ("_listed", "_matrix", "_prepared", "dummy", "sizes")

    sizes: NDArray[np.int32]
    dummy: bool
    # costs of all pairs of two lists: their tuples and costs are listed when somebody asks for them
    _matrix: NDArray[np.float64] | None
    _listed: tuple[NDArray[np.int32], NDArray[np.float64]] | None

    def __init__(self, tuples: ArrayLike, costs: ArrayLike, sizes: ArrayLike, *, dummy: bool = True) -> None:
        dummy = _checked_dummy(dummy)
        sizes_ = _integers(sizes, "sizes", 1)
        if sizes_.size == 0:
            raise InvalidInputError("sizes: expected at least one sensor, got none")
        if sizes_.min() < 0:
            raise InvalidInputError(f"sizes: expected numbers >= 0, got {sizes_.min()}")
        total = sum(int(size) for size in sizes_)
        if total > np.iinfo(np.int32).max:
            raise InvalidInputError("sizes: more measurements in total than 32-bit indices can name")
        if total * (sizes_.size + 2) > _MAX_SINGLETON_NUMBERS:
            raise LimitExceededError(
                f"sizes: {total} measurements of {sizes_.size} sensors need more memory for their singletons than a "
                "problem may take; split the problem"
            )
        tuples_ = _integers(tuples, "tuples", 2)
        costs_ = _numbers(costs, "costs")
        if tuples_.shape == (0, 0):
            tuples_ = tuples_.reshape(0, sizes_.size)
        if tuples_.shape[1] != sizes_.size:
            raise InvalidInputError(f"tuples: expected shape (M, {sizes_.size}) to match sizes, got {tuples_.shape}")
        if costs_.shape != (tuples_.shape[0],):
            raise InvalidInputError(f"costs: expected shape ({tuples_.shape[0]},), got {costs_.shape}")
        # columns for the check, and the stored tuples, without and with singletons
        memory.require(
            tuples_.size * (tuples_.itemsize + 1 + 2 * 4.0) + 40.0 * costs_.size,
            f"tuples: {tuples_.shape[0]} of {sizes_.size} sensors",
            "split the problem",
        )
        alone = _check_indices(tuples_, sizes_, dummy)
        if not _finite(costs_):
            keep = _allowed(costs_)
            costs_, tuples_, alone = costs_[keep], tuples_[keep], alone[keep]
        if dummy:
            tuples_, costs_ = _with_singletons(tuples_, costs_, sizes_, alone)
        self._listed = _frozen(tuples_, np.int32), _frozen(costs_, np.float64)
        self.sizes = _frozen(sizes_, np.int32)
        self.dummy = dummy
        self._matrix = None
        self._prepared: Any = None

    @property
    def tuples(self) -> NDArray[np.int32]:
        """Allowed tuples, singletons included, int32 (M, S), read-only."""
        return self._lists()[0]

    @property
    def costs(self) -> NDArray[np.float64]:
        """Their costs, (M,), read-only."""
        return self._lists()[1]

    @property
    def num_sensors(self) -> int:
        """Number of sensors (dimensions) S."""
        return int(self.sizes.size)

    @property
    def num_tuples(self) -> int:
        """Number of allowed tuples M, singletons included."""
        return int(self.costs.size if self._matrix is None else self._matrix.size)

    def __repr__(self) -> str:
        sizes = " x ".join(str(n) for n in self.sizes)
        kind = "" if self.dummy else ", no dummies"
        return f"AssignmentProblem({sizes} measurements, {self.num_tuples} tuples{kind})"

    def _repr_html_(self) -> str:
        """HTML for notebooks and reports: numbers of tuples by size, and their costs."""
        from assoc._text.html import escape, table

        found = np.count_nonzero(self.tuples, axis=1)
        rows = []
        for count in np.unique(found):
            costs = self.costs[found == count]
            median = float(np.median(costs))
            rows.append([int(count), costs.size, f"{costs.min():.4g}", f"{median:.4g}", f"{costs.max():.4g}"])
        headers = ["measurements in a tuple", "tuples", "least cost", "median", "largest"]
        return f"<p>{escape(repr(self))}</p>{table(headers, rows, numbers=range(5))}"

    @classmethod
    def from_dense(cls, tensor: ArrayLike, dummy: bool = True) -> AssignmentProblem:
        """Read a dense cost tensor.

        Parameters
        ----------
        tensor : array_like of float
            With ``dummy``: shape (n_1 + 1, ..., n_S + 1), index 0 is the dummy and the all-dummy entry
            is ignored. Without: shape (n_1, ..., n_S), the classical axial problem, also rectangular.
            ``inf`` and masked entries are forbidden tuples; a forbidden singleton costs 0, as if it
            were not listed. A matrix without dummies and forbidden entries is kept as it is; ``exact`` solves it
            without a list of its pairs.
        dummy : bool, default True
            Whether index 0 is the dummy.

        Raises
        ------
        InvalidInputError
            The tensor has no dimension, an empty dummy dimension, NaN or -inf.
        LimitExceededError
            The problem would take more memory than is available.

        Warns
        -----
        AssocWarning
            With ``dummy`` the all-dummy entry is finite and not 0: the tensor may be an axial one.
        """
        dense, dummy = _numbers(tensor, "tensor"), _checked_dummy(dummy)
        if not dummy and _is_whole(dense):
            memory.require(18.0 * dense.size, f"tensor: {dense.size} elements", "list the allowed tuples instead")
            return cls._of_matrix(np.array(dense, order="C"))
        if dense.ndim == 0:
            raise InvalidInputError("tensor: expected one dimension per sensor, got a scalar")
        if dummy and min(dense.shape) == 0:
            raise InvalidInputError(f"tensor: each dimension needs its dummy at index 0, got {dense.shape}")
        advice = "list the allowed tuples instead"
        memory.require(2.0 * dense.size, f"tensor: {dense.size} elements", advice)
        keep = ~np.isposinf(dense)
        if dummy:
            keep[(0,) * dense.ndim] = False
            _warn_of_dummy_cost(float(dense[(0,) * dense.ndim]), "tensor")
        wrong = keep & ~(dense > -np.inf)
        if wrong.any():
            at = np.unravel_index(np.argmax(wrong), wrong.shape)
            where = ", ".join(map(str, at))
            raise InvalidInputError(f"costs[{where}] is {dense[at]}; expected a number, or inf for a forbidden tuple")
        count = np.count_nonzero(keep)
        # numpy's list of indices and the stacked array, then the problem
        memory.require(count * (33.0 * dense.ndim + 48.0), f"tensor: {count} allowed tuples", advice)
        index = np.stack(np.nonzero(keep), axis=1)
        offset = 0 if dummy else 1
        sizes = np.array(dense.shape, dtype=np.int64) - (1 - offset)
        return cls(index + offset, dense[keep], sizes, dummy=dummy)

    @classmethod
    def from_matrix(cls, costs: ArrayLike, unassigned: float | Sequence[ArrayLike] | None = None) -> AssignmentProblem:
        """Read the costs of assigning rows to columns.

        The rows and columns that a solution assigns to each other are its `Solution.pairs`.

        Parameters
        ----------
        costs : array_like of float, shape (n, m)
            Cost of each pair; ``inf`` and masked entries forbid a pair.
        unassigned : float, or pair of array_like of shape (n,) and (m,), optional
            What it costs to leave a row or a column unassigned: one number for all, or one for each row and one for
            each column. A pair is assigned only where that costs less than to leave both. ``inf``: as many pairs as
            possible, and of these choices the cheapest; `Solution.cost` then holds a large number for each that is
            left. None: each row is assigned, or each column if there are fewer of these, as by scipy's
            ``linear_sum_assignment``; if forbidden pairs leave no such choice, solvers raise InfeasibleError.

        Raises
        ------
        InvalidInputError
            `costs` is no matrix, holds NaN or -inf, or `unassigned` has another shape or is no number.
        LimitExceededError
            The problem would take more memory than is available.
        """
        matrix = _numbers(costs, "costs")
        if matrix.ndim != 2:
            raise InvalidInputError(f"costs: expected a matrix, got shape {matrix.shape}")
        if unassigned is None:
            return cls.from_dense(matrix, dummy=False)
        dense = np.zeros((matrix.shape[0] + 1, matrix.shape[1] + 1))
        dense[1:, 1:] = matrix
        dense[1:, 0], dense[0, 1:] = _costs_alone(matrix, unassigned)
        return cls.from_dense(dense)

    @classmethod
    def _of_matrix(cls, matrix: NDArray[np.float64]) -> AssignmentProblem:
        """The problem of all pairs of two lists: a matrix that `_is_whole`, and that nobody changes."""
        problem = cls.__new__(cls)
        problem.sizes, problem.dummy = _frozen(np.array(matrix.shape), np.int32), False
        problem._matrix, problem._listed, problem._prepared = matrix, None, None
        return problem

    def _lists(self) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
        """Tuples and costs, those of a matrix row by row."""
        if self._listed is None:
            assert self._matrix is not None
            rows, columns = self._matrix.shape
            memory.require(28.0 * self._matrix.size, f"a list of {self._matrix.size} tuples", "take solver 'exact'")
            tuples = np.empty((rows * columns, 2), dtype=np.int32)
            tuples[:, 0] = np.repeat(np.arange(1, rows + 1), columns)
            tuples[:, 1] = np.tile(np.arange(1, columns + 1), rows)
            self._listed = _frozen(tuples, np.int32), _frozen(self._matrix.ravel(), np.float64)
        return self._listed

    @classmethod
    def from_sparse(cls, array: Any, dummy: bool = True) -> AssignmentProblem:
        """Read a sparse cost array: entries not stored are forbidden, a stored 0 is a cost.

        Parameters
        ----------
        array : scipy sparse array, or any object with ``coords``, ``data`` and ``shape``
            One dimension for each sensor, as in `from_dense`; with more than two only scipy's ``coo_array``.
            Entries stored more than once are summed.
        dummy : bool, default True
            Whether index 0 is the dummy.

        Raises
        ------
        InvalidInputError
            The array has another type, or holds NaN or -inf.

        Warns
        -----
        AssocWarning
            As in `from_dense`.
        """
        entries = array.tocoo(copy=True) if callable(getattr(array, "tocoo", None)) else array
        if not all(hasattr(entries, name) for name in ("coords", "data", "shape")):
            raise InvalidInputError(f"array: expected a sparse array (scipy.sparse), got {type(array).__name__}")
        if hasattr(entries, "sum_duplicates"):
            entries.sum_duplicates()
        index = _integers(np.stack([np.asarray(axis) for axis in entries.coords], axis=1), "array: coords", 2)
        costs = _numbers(entries.data, "array")
        if dummy and min(entries.shape) == 0:
            raise InvalidInputError(f"array: each dimension needs its dummy at index 0, got {entries.shape}")
        keep = index.any(axis=1) if dummy else np.ones(costs.size, dtype=np.bool_)
        for cost in costs[~keep]:
            _warn_of_dummy_cost(float(cost), "array")
        offset = 0 if dummy else 1
        sizes = [int(n) - (1 - offset) for n in entries.shape]
        return cls(index[keep].astype(np.int64) + offset, costs[keep], sizes, dummy=dummy)

    @classmethod
    def from_frame(
        cls, frame: pd.DataFrame, sizes: ArrayLike | None = None, *, cost: str = "cost", dummy: bool = True
    ) -> AssignmentProblem:
        """Read a table of tuples.

        Parameters
        ----------
        frame : pandas.DataFrame
            One row for each tuple: a column ``cost``, and for each sensor a column with the number of its measurement,
            from 1; 0 or empty: the sensor missed the target.
        sizes : array_like of int, shape (S,), optional
            Measurements of each sensor; by default the largest number in its column.
        cost : str, default "cost"
            Name of the column of costs.
        dummy : bool, default True
            Whether a sensor may miss a target.

        Raises
        ------
        InvalidInputError
            The frame is not a table, lacks the column of costs, or a value is not a number.
        """
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
        counts = tuples.max(axis=0, initial=0) if sizes is None else sizes
        return cls(tuples, _numbers(frame[cost].to_numpy(), f"frame: column {cost!r}"), counts, dummy=dummy)

    def to_dense(self) -> NDArray[np.float64]:
        """Return the dense tensor of ``from_dense``; tuples not listed are ``inf``, the all-dummy entry 0.

        Raises
        ------
        LimitExceededError
            The tensor would have more than 2e8 elements, or take more memory than is available.
        """
        shape = tuple(int(n) + (1 if self.dummy else 0) for n in self.sizes)
        elements = float(np.prod(np.array(shape, dtype=float)))
        if elements > _MAX_DENSE_ELEMENTS:
            raise LimitExceededError(
                f"a dense tensor of {elements:.3g} elements exceeds {_MAX_DENSE_ELEMENTS:.0e}: use .tuples, .costs"
            )
        # the tensor, and indices that numpy converts
        needed = 8.0 * elements + 32.0 * self.tuples.size
        memory.require(needed, f"a dense tensor of {elements:.3g} elements", "use .tuples, .costs")
        dense = np.full(shape, np.inf)
        index = self.tuples if self.dummy else self.tuples - 1
        np.minimum.at(dense, tuple(index.T), self.costs)
        if self.dummy:
            dense[(0,) * len(shape)] = 0.0
        return dense

    def components(self) -> list[NDArray[np.intp]]:
        """Split into independent clusters: tuples that share measurements, directly or through others.

        Returns
        -------
        list of int arrays
            Indices into ``tuples`` for each cluster, ascending; clusters in order of their first tuple.
        """
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components

        if self.num_tuples == 0:
            return []
        offsets = np.concatenate([[0], np.cumsum(self.sizes)])
        which, sensor = np.nonzero(self.tuples)
        rows = offsets[sensor] + self.tuples[which, sensor] - 1
        num_rows = int(offsets[-1])
        nodes = num_rows + self.num_tuples
        graph = coo_array((np.ones(rows.size, np.int8), (rows, num_rows + which)), shape=(nodes, nodes))
        label = connected_components(graph, directed=False)[1][num_rows:]
        order = np.argsort(label, kind="stable")
        parts = np.split(order, np.flatnonzero(np.diff(label[order])) + 1)
        return sorted(parts, key=lambda part: int(part[0]))

    def save(self, path: str | PathLike[str]) -> None:
        """Write ``problem.npz``, or plain text where the name ends in ``.txt`` or ``.txt.xz``.

        The formats are described in docs/formats.md and docs/proofs.md.
        """
        if is_text(path):
            write_problem_text(path, self.tuples, self.costs, self.sizes, self.dummy)
            return
        from assoc._files.npz import save_npz

        save_npz(
            path,
            FORMAT,
            VERSION,
            {"tuples": self.tuples, "costs": self.costs, "sizes": self.sizes, "dummy": np.array(self.dummy)},
        )

    @classmethod
    def load(cls, path: str | PathLike[str]) -> AssignmentProblem:
        """Read ``problem.npz``, or plain text where the name ends in ``.txt`` or ``.txt.xz``.

        Raises
        ------
        InvalidInputError
            The file is missing, damaged, of another format or a later version, or its content is wrong.
        """
        try:
            data = cls._read(path)
            return cls(data["tuples"], data["costs"], data["sizes"], dummy=bool(data["dummy"]))
        except InvalidInputError as error:
            text = str(error)
            raise InvalidInputError(text if text.startswith(str(path)) else f"{path}: {text}") from None

    @staticmethod
    def _read(path: str | PathLike[str]) -> dict[str, Any]:
        if is_text(path):
            return read_problem_text(path)
        from assoc._files.npz import Field, load_npz

        fields = {
            "tuples": Field("int", 2),
            "costs": Field("float", 1),
            "sizes": Field("int", 1),
            "dummy": Field("bool", 0, required=False),
        }
        return {"dummy": True, **load_npz(path, FORMAT, VERSION, fields)}


def check_problem(problem: object) -> None:
    """Refuse what is no problem; of an array, say how a problem is made of it."""
    if isinstance(problem, AssignmentProblem):
        return
    line = f"problem: expected an AssignmentProblem, got {type(problem).__name__}"
    if isinstance(problem, _DENSE):
        line += f"; {_FROM_DENSE}"
    raise InvalidInputError(line)


def taken_problem(problem: object) -> AssignmentProblem:
    """A problem as it is, and an array of costs as scipy takes it, with a warning that says so."""
    if isinstance(problem, _DENSE):
        costs = _numbers(problem, "problem")
        if costs.ndim < 2:
            found = f"an array of shape {costs.shape}"
            raise InvalidInputError(
                f"problem: expected an AssignmentProblem or costs of two or more dimensions, got {found}"
            )
        warn(
            f"problem: an array of shape {costs.shape} is taken as by scipy's linear_sum_assignment, without dummies; "
            f"{_FROM_DENSE}"
        )
        if _is_whole(costs):
            # not copied: it is gone after the call
            return AssignmentProblem._of_matrix(np.require(costs, requirements=["C", "W"]))
        return AssignmentProblem.from_dense(costs, dummy=False)
    check_problem(problem)
    return cast(AssignmentProblem, problem)


def _costs_alone(matrix: NDArray[np.float64], unassigned: float | Sequence[ArrayLike]) -> list[NDArray[np.float64]]:
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
        numbers = _numbers(costs, f"unassigned: {name}")
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


def _checked_dummy(dummy: object) -> bool:
    if not isinstance(dummy, (bool, np.bool_)):
        found = repr(dummy) if isinstance(dummy, (str, int, float)) else type(dummy).__name__
        raise InvalidInputError(f"dummy: expected True or False, got {found}")
    return bool(dummy)


def _integers(values: ArrayLike, name: str, ndim: int) -> NDArray[np.int64]:
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


def _numbers(values: ArrayLike, name: str) -> NDArray[np.float64]:
    try:
        array = np.asarray(values)
    except ValueError:
        raise InvalidInputError(f"{name}: expected rows of the same length; inf forbids an entry") from None
    if array.dtype.kind not in "fiu" and array.size:
        raise InvalidInputError(f"{name}: expected real numbers, got {array.dtype}")
    numbers = array.astype(np.float64, copy=False)
    # masked entries are forbidden
    return np.where(np.ma.getmaskarray(np.ma.asarray(values)), np.inf, numbers) if np.ma.is_masked(values) else numbers


def _is_whole(costs: NDArray[np.float64]) -> bool:
    """Whether costs are a matrix without forbidden entries, whose sums stay in range."""
    if costs.ndim != 2 or not costs.size or 4 * sum(costs.shape) > _MAX_SINGLETON_NUMBERS:
        return False
    # NaN is not below anything
    return bool(max(-costs.min(), costs.max()) <= _MAX_TOTAL_COST / costs.size)


def _warn_of_dummy_cost(cost: float, name: str) -> None:
    """Warn of an all-dummy entry that is ignored although it looks like a cost."""
    if cost != 0.0 and np.isfinite(cost):
        at = "at index 0 of every dimension, which is the dummy"
        warn(f"{name}: ignores the cost {cost:g} {at}; without dummies, pass dummy=False")


def _check_indices(tuples: NDArray[np.int64], sizes: NDArray[np.int64], dummy: bool) -> NDArray[np.bool_]:
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


def _finite(costs: NDArray[np.float64]) -> bool:
    """Whether all costs are finite and their sums stay in range."""
    with np.errstate(over="ignore"):
        return not costs.size or float(np.abs(costs).sum()) <= _MAX_TOTAL_COST


def _allowed(costs: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which tuples are allowed (not inf); refuses NaN and -inf."""
    bad = np.isnan(costs) | np.isneginf(costs)
    if bad.any():
        row = int(np.argmax(bad))
        raise InvalidInputError(f"costs: row {row} is {costs[row]}; expected a number, or inf for a forbidden tuple")
    keep: NDArray[np.bool_] = ~np.isposinf(costs)
    if not _finite(costs[keep]):
        raise InvalidInputError(
            f"costs: the sum of magnitudes exceeds {_MAX_TOTAL_COST:.0e}; inf forbids a tuple, or rescale the costs"
        )
    return keep


def _with_singletons(
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


def _frozen(array: NDArray[Any], dtype: type) -> NDArray[Any]:
    result: NDArray[Any] = np.array(array, dtype=dtype, order="C")
    result.flags.writeable = False
    return result
