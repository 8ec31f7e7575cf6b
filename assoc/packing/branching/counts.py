"""Split the root of a branch and bound on counts: how many columns have q rows, how many rows are uncovered.

Where the linear program's bound is far from the optimum it mixes solutions of different kinds: 38.8 targets seen by all
sensors, say. No pair of measurements has much influence on that number, but *at most 38* and *at least 39*, each in a
separate program, raise the bound at once. Each *leaf* of these splits is then searched as a root. A tree grows roughly
with the sixth power of the gap between bound and aim, which predicts whether a split pays.

For a count c in the range l .. h the linear program gets two rows and one column:

    c + z = h,     z + s = h - l,     z >= 0, s >= 0.

All coefficients are whole numbers >= 0, as everywhere in the program; only the right-hand sides differ between
leaves. The column z has no measurements and weight 0: greedy solutions and pairs ignore it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._system.clock import is_over
from assoc._types import Floats
from assoc.packing.branching.node import Work, knowing, new_work
from assoc.packing.branching.open_nodes import OpenNodes
from assoc.packing.branching.root import MOST_ROWS, Root
from assoc.packing.packing import Packing, PackingArrays
from assoc.packing.simplex.basis import basis_of, primal_values
from assoc.packing.simplex.dual import OPTIMAL, Effort, most_exchanges, solve_dual
from assoc.packing.simplex.program import Program, all_allowed, certified, make_feasible, weight_limit

# most leaves; the power of the gap by which trees grow
_LEAVES = 16
_POWER = 6.0
# an LP value this near to a whole number is one
_WHOLE = 1e-6


class Splitting(NamedTuple):
    """When a search splits its root."""

    after: int = 40
    """Nodes after which a split is tried, again whenever they have doubled; most searches end before that."""
    raised: float = 0.02
    """The share of the distance to the goal by which a split must raise the bound."""
    pays: float = 0.9
    """The share of its tree at which a leaf is split."""


USUAL = Splitting()


class Leaf(NamedTuple):
    """A part of the solutions: its linear program with the start of its search, and a lower bound on its solutions."""

    root: Root
    bound: float


class _Counts(NamedTuple):
    """Counts and the range of each."""

    times: NDArray[np.int32]
    """Contribution of each column to each count, (C, N)."""
    least: NDArray[np.int64]
    most: NDArray[np.int64]
    """Both ends of the ranges are included, (C,)."""

    def within(self, k: int, least: int, most: int) -> _Counts:
        """The same counts with another range of count k."""
        least_of, most_of = self.least.copy(), self.most.copy()
        least_of[k], most_of[k] = least, most
        return self._replace(least=least_of, most=most_of)

    def only(self, which: NDArray[np.bool_]) -> _Counts:
        """The counts of a mask."""
        return _Counts(self.times[which], self.least[which], self.most[which])

    def sides(self) -> Floats:
        """Right-hand sides of their rows."""
        return np.concatenate([self.most, self.most - self.least]).astype(np.float64)


class _Part(NamedTuple):
    """A leaf, its ranges, and the LP's values of the counts (empty if it is not solved)."""

    leaf: Leaf
    counts: _Counts
    values: Floats | None


def split_on_counts(
    packing: Packing, root: Root, cutoff: float, goal: float, deadline: float, pays: float = USUAL.pays
) -> list[Leaf]:
    """Split the solutions of a component that weigh less than the cutoff into parts, each with its own program.

    ``goal`` is the bound to prove first; a split pays (`Splitting`) if it makes that easier. Returns the leaves whose
    bound is below the cutoff; their programs differ only in the right-hand sides. If no split pays, one leaf of all
    solutions, with the program unchanged.
    """
    everything = _counts_of(packing)
    counted = _Counted(root, everything, cutoff, deadline)
    parts = _split(counted, everything, min(goal, counted.effort.cutoff), pays)
    used = np.zeros(len(everything.times), dtype=np.bool_)
    for part in parts:
        used |= (part.counts.least > everything.least) | (part.counts.most < everything.most)
    # rows of counts that no leaf restricts would only make programs larger
    counted = _Counted(root, everything.only(used), cutoff, deadline)
    leaves = _solved_again(counted, parts, used, deadline)
    return [leaf for leaf in leaves if leaf.bound < counted.effort.cutoff]


def _solved_again(counted: _Counted, parts: list[_Part], used: NDArray[np.bool_], deadline: float) -> list[Leaf]:
    """The leaves of parts with a mask of the counts alone; as they were if time is over before the last of them."""
    leaves = []
    for part in parts:
        if is_over(deadline):
            # each takes a factorisation; the earlier bounds are valid, too
            return [part.leaf for part in parts]
        again = counted.part(part.counts.only(used)).leaf
        # a second solution of the program may end below the first one's bound
        leaves.append(again._replace(bound=max(again.bound, part.leaf.bound)))
    return leaves


def begin_leaf(packing: Packing, leaf: Leaf, given_up: float, work: Work | None) -> tuple[OpenNodes, Work]:
    """The open nodes of a leaf, at first its root, and the buffers of its search: those of the last where they fit.

    ``given_up`` is a lower bound on the nodes given up so far.
    """
    root, program = leaf.root, leaf.root.program
    nodes = OpenNodes(root)
    nodes.arrays.bound[0] = leaf.bound
    nodes.given_up = given_up
    if work is None or work.program.rows is not program.rows:
        new = new_work(_with_counts(packing.arrays, program), program, root.slack)
        if work is not None:
            # pseudo-costs of pairs stay valid
            new = knowing(new, work.trials)
        work = new
    # the programs of one split differ only in their right-hand sides
    return nodes, work._replace(program=program)


def _with_counts(arrays: PackingArrays, program: Program) -> PackingArrays:
    """The packing with the additional columns of a program: they have no rows and weight 0."""
    more = program.weights.size - arrays.weights.size
    return arrays._replace(
        cols=np.concatenate([arrays.cols, np.full((more, arrays.cols.shape[1]), -1, dtype=np.int32)]),
        weights=np.concatenate([arrays.weights, np.zeros(more)]),
    )


def most_rows(packing: Packing) -> float:
    """Rows of a packing's program with the most cuts and counts."""
    return MOST_ROWS * packing.num_rows + 2 * (packing.num_sensors + 1)


def _counts_of(packing: Packing) -> _Counts:
    """Counts of columns with q rows for every q >= 2, of columns with two rows or more, and of covered rows."""
    sizes = (packing.cols >= 0).sum(axis=1)
    rows = packing.num_rows
    present = [int(q) for q in np.unique(sizes) if q >= 2]
    times = [sizes == q for q in present]
    most = [rows // q for q in present]
    if len(present) > 1:
        times.append(sizes >= 2)
        most.append(rows // 2)
    times.append(sizes)
    most.append(rows)
    return _Counts(np.array(times, dtype=np.int32), np.zeros(len(most), dtype=np.int64), np.array(most, dtype=np.int64))


class _Counted:
    """The program of a root with rows for counts, solved for any ranges of the counts."""

    def __init__(self, root: Root, counts: _Counts, cutoff: float, deadline: float) -> None:
        self._sets = root.sets
        self._times = counts.times
        self._size = root.slack.size
        self._program = _with_rows(root.program, counts)
        self._slack = np.concatenate([root.slack, np.repeat([False, True], len(counts.times))])
        self._variable = _with_basis(root, len(counts.times))
        self._duals = np.concatenate([root.duals, np.zeros(2 * len(counts.times))])
        self.effort = Effort(
            min(cutoff, float(weight_limit(self._program))), int(most_exchanges(self._program)), deadline
        )

    def part(self, counts: _Counts, start: _Part | None = None) -> _Part:
        """Solve the program for these ranges, from the basis of another part if given."""
        sides = np.concatenate([self._program.sides[: self._size], counts.sides()])
        program = self._program._replace(sides=sides)
        allowed = all_allowed(program, self._slack)
        variable = self._variable if start is None else start.leaf.root.variable
        basis = basis_of(program, allowed, variable, self._duals if start is None else start.leaf.root.duals)
        status, _ = solve_dual(program, allowed, basis, self.effort)
        duals = basis.duals.copy()
        make_feasible(program, allowed, duals)
        bound = float(certified(program, allowed, duals))
        values = None
        if status == OPTIMAL:
            primal = np.empty(program.weights.size)
            primal_values(program, basis, primal)
            values = self._times @ primal[: self._times.shape[1]]
        leaf = Leaf(Root(program, self._slack, basis.variable, basis.duals, self._sets), bound)
        return _Part(leaf, counts, values)


def _split(counted: _Counted, counts: _Counts, goal: float, pays: float) -> list[_Part]:
    """Split the part of least bound repeatedly, as long as that pays."""
    waiting = [counted.part(counts)]
    settled: list[_Part] = []
    while waiting and len(waiting) + len(settled) < _LEAVES and not is_over(counted.effort.deadline):
        part = waiting.pop(min(range(len(waiting)), key=lambda i: waiting[i].leaf.bound))
        sides = _best_split(counted, part, goal, pays)
        if sides is None:
            settled.append(part)
        else:
            waiting += [side for side in sides if side.leaf.bound < counted.effort.cutoff]
    return waiting + settled


def _best_split(counted: _Counted, part: _Part, goal: float, pays: float) -> list[_Part] | None:
    """Both sides of the split that leaves the smallest trees; None if no split pays."""
    bound = part.leaf.bound
    if part.values is None or bound >= goal:
        return None
    best, chosen = pays, None
    for k, value in enumerate(part.values):
        below = int(np.floor(value))
        least, most = int(part.counts.least[k]), int(part.counts.most[k])
        if not (_WHOLE < value - below < 1.0 - _WHOLE and least <= below < most):
            continue
        if is_over(counted.effort.deadline):
            return None
        ranges = part.counts.within(k, least, below), part.counts.within(k, below + 1, most)
        sides = [counted.part(kept, part) for kept in ranges]
        trees = sum(max((goal - side.leaf.bound) / (goal - bound), 0.0) ** _POWER for side in sides)
        if trees < best:
            best, chosen = trees, sides
    return chosen


def _with_rows(program: Program, counts: _Counts) -> Program:
    """The program with two rows and a column for each count."""
    number, size, num = len(counts.times), program.sides.size, program.weights.size
    column = [np.repeat(np.arange(num), np.diff(program.start))]
    row = [program.rows.astype(np.int64)]
    for k, times in enumerate(counts.times):
        column += [np.repeat(np.arange(num), times), np.array([num + k, num + k])]
        row += [np.full(int(times.sum(dtype=np.int64)), size + k), np.array([size + k, size + number + k])]
    columns = np.concatenate(column)
    order = np.argsort(columns, kind="stable")
    start = np.zeros(num + number + 1, dtype=np.int64)
    np.cumsum(np.bincount(columns, minlength=num + number), out=start[1:])
    return Program(
        np.concatenate([program.weights, np.zeros(number)]),
        start,
        np.concatenate(row)[order].astype(np.int32),
        np.concatenate([program.sides, counts.sides()]),
        program.width,
    )


def _with_basis(root: Root, number: int) -> NDArray[np.int32]:
    """The root's basis, with z and s of each count in the positions of its rows."""
    num, size = root.program.weights.size, root.slack.size
    kind, row = np.divmod(root.variable - num, size)
    renumbered = num + number + kind * (size + 2 * number) + row
    old = np.where(root.variable < num, root.variable, renumbered)
    each = np.arange(number)
    return np.concatenate([old, num + each, num + number + size + number + each]).astype(np.int32)
