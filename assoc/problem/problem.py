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
from assoc.problem.arrays import (
    MOST_SINGLETON_NUMBERS,
    all_finite,
    allowed,
    check_indices,
    checked_dummy,
    costs_alone,
    entries_of_sparse,
    frozen,
    integers,
    is_whole_matrix,
    real_numbers,
    rows_of_frame,
    warn_of_dummy_cost,
    with_singletons,
)

if TYPE_CHECKING:
    import pandas as pd

FORMAT = "assoc.problem"
VERSION = 1

_MAX_DENSE_ELEMENTS = 200_000_000
_FROM_DENSE = (
    "AssignmentProblem.from_matrix(costs) takes a matrix as scipy's linear_sum_assignment does, from_matrix(costs, "
    "unassigned=...) with costs of leaving rows and columns unassigned, from_dense(costs) one that has these as row 0 "
    "and column 0"
)


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
        dummy = checked_dummy(dummy)
        sizes_ = integers(sizes, "sizes", 1)
        if sizes_.size == 0:
            raise InvalidInputError("sizes: expected at least one sensor, got none")
        if sizes_.min() < 0:
            raise InvalidInputError(f"sizes: expected numbers >= 0, got {sizes_.min()}")
        total = sum(int(size) for size in sizes_)
        if total > np.iinfo(np.int32).max:
            raise InvalidInputError("sizes: more measurements in total than 32-bit indices can name")
        if total * (sizes_.size + 2) > MOST_SINGLETON_NUMBERS:
            raise LimitExceededError(
                f"sizes: {total} measurements of {sizes_.size} sensors need more memory for their singletons than a "
                "problem may take; split the problem"
            )
        tuples_ = integers(tuples, "tuples", 2)
        costs_ = real_numbers(costs, "costs")
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
        alone = check_indices(tuples_, sizes_, dummy)
        if not all_finite(costs_):
            keep = allowed(costs_)
            costs_, tuples_, alone = costs_[keep], tuples_[keep], alone[keep]
        if dummy:
            tuples_, costs_ = with_singletons(tuples_, costs_, sizes_, alone)
        self._listed = frozen(tuples_, np.int32), frozen(costs_, np.float64)
        self.sizes = frozen(sizes_, np.int32)
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
        dense, dummy = real_numbers(tensor, "tensor"), checked_dummy(dummy)
        if not dummy and is_whole_matrix(dense):
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
            warn_of_dummy_cost(float(dense[(0,) * dense.ndim]), "tensor")
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
        matrix = real_numbers(costs, "costs")
        if matrix.ndim != 2:
            raise InvalidInputError(f"costs: expected a matrix, got shape {matrix.shape}")
        if unassigned is None:
            return cls.from_dense(matrix, dummy=False)
        dense = np.zeros((matrix.shape[0] + 1, matrix.shape[1] + 1))
        dense[1:, 1:] = matrix
        dense[1:, 0], dense[0, 1:] = costs_alone(matrix, unassigned)
        return cls.from_dense(dense)

    @classmethod
    def _of_matrix(cls, matrix: NDArray[np.float64]) -> AssignmentProblem:
        """The problem of all pairs of two lists: a matrix that `is_whole_matrix`, and that nobody changes."""
        problem = cls.__new__(cls)
        problem.sizes, problem.dummy = frozen(np.array(matrix.shape), np.int32), False
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
            self._listed = frozen(tuples, np.int32), frozen(self._matrix.ravel(), np.float64)
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
        return cls(*entries_of_sparse(array, dummy), dummy=dummy)

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
        tuples, costs = rows_of_frame(frame, cost)
        return cls(tuples, costs, tuples.max(axis=0, initial=0) if sizes is None else sizes, dummy=dummy)

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
        from assoc._files.npz import Field, load_npz

        fields = {
            "tuples": Field("int", 2),
            "costs": Field("float", 1),
            "sizes": Field("int", 1),
            "dummy": Field("bool", 0, required=False),
        }
        try:
            data = read_problem_text(path) if is_text(path) else load_npz(path, FORMAT, VERSION, fields)
            return cls(data["tuples"], data["costs"], data["sizes"], dummy=bool(data.get("dummy", True)))
        except InvalidInputError as error:
            text = str(error)
            raise InvalidInputError(text if text.startswith(str(path)) else f"{path}: {text}") from None


def _is_dense(problem: object) -> bool:
    """Whether costs are a list, an array, or a table that numpy reads as one."""
    return isinstance(problem, list | tuple) or hasattr(problem, "__array__")


def check_problem(problem: object) -> None:
    """Refuse what is no problem; of an array, say how a problem is made of it."""
    if isinstance(problem, AssignmentProblem):
        return
    line = f"problem: expected an AssignmentProblem, got {type(problem).__name__}"
    if _is_dense(problem):
        line += f"; {_FROM_DENSE}"
    raise InvalidInputError(line)


def taken_problem(problem: object) -> AssignmentProblem:
    """A problem as it is, and an array of costs as scipy takes it, with a warning that says so."""
    if _is_dense(problem):
        costs = real_numbers(cast(ArrayLike, problem), "problem")
        if costs.ndim < 2:
            found = f"an array of shape {costs.shape}"
            raise InvalidInputError(
                f"problem: expected an AssignmentProblem or costs of two or more dimensions, got {found}"
            )
        warn(
            f"problem: an array of shape {costs.shape} is taken as by scipy's linear_sum_assignment, without dummies; "
            f"{_FROM_DENSE}"
        )
        if is_whole_matrix(costs):
            # not copied: it is gone after the call
            return AssignmentProblem._of_matrix(np.require(costs, requirements=["C", "W"]))
        return AssignmentProblem.from_dense(costs, dummy=False)
    check_problem(problem)
    return cast(AssignmentProblem, problem)
