"""``link``: the same particle in one frame after the other, for all frames at once."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from assoc._parameters import is_whole, positive
from assoc._system import memory as memory_left
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.problem import AssignmentProblem
from assoc.sensors.arrays import finite_array
from assoc.solution import Solution
from assoc.solvers.assign import assign

_INCLUSIVE = 1e-9  # by what share a step of just the search range is worth a link
_BYTES = 400.0  # of each candidate pair while its problem is built and solved


class Links(NamedTuple):
    """Particles that ``assoc.link`` followed.

    Attributes
    ----------
    ids : list of int arrays (M,)
        For each frame the particle of each point, from 0 in order of appearance.
    solution : Solution
        Of the assignment problem whose tuples are (point, its next point), both counted from 1 over all frames. Its
        costs are squared distances less the squared search range.
    """

    ids: list[Array]
    solution: Solution


def link(frames: Iterable[object], search_range: float, *, memory: int = 0) -> Links:
    """Link the points of consecutive frames that belong to the same particle.

    The sum of squared distances is least over all frames together, where a particle that ends costs
    ``search_range**2`` (Crocker and Grier 1996, whose rule is that of trackpy). As each point has at most one next
    point and is the next of at most one, this is one assignment of two lists, solved with proof.

    Parameters
    ----------
    frames : iterable of array_like, shape (M, D)
        Points of each frame; M may differ and be 0.
    search_range : float
        Longest distance between a point and the next, in units of the points.
    memory : int, default 0
        Number of frames that a particle may be missing.

    Returns
    -------
    Links

    Raises
    ------
    InvalidInputError
        An argument is not as described.
    LimitExceededError
        The pairs in range need more memory than there is.
    """
    if not isinstance(frames, Iterable):
        raise InvalidInputError(f"frames must be a list of arrays of shape (M, D), got {type(frames).__name__}")
    points = [finite_array(frame, f"frames[{k}]") for k, frame in enumerate(frames)]
    points = [np.empty((0, 1)) if not frame.size else frame for frame in points]
    shapes = {frame.shape[1:] for frame in points if len(frame)}
    if len(shapes) > 1 or any(len(shape) != 1 for shape in shapes):
        raise InvalidInputError(f"frames must be arrays of shape (M, D), with the same D, got shapes {sorted(shapes)}")
    reach = positive(search_range, "search_range")
    if not is_whole(memory, 0):
        raise InvalidInputError(f"memory must be an integer >= 0, got {memory!r}")
    pairs, costs = _candidates(points, reach, memory)
    first = np.cumsum([0, *map(len, points)])
    solution = assign(AssignmentProblem(pairs + 1, costs, (first[-1], first[-1])))
    following = solution.tuples[(solution.tuples > 0).all(axis=1)] - 1
    before = np.full(first[-1], -1)
    before[following[:, 1]] = following[:, 0]
    return Links(_numbered(before, first), solution)


def _candidates(points: list[Array], reach: float, memory: int) -> tuple[Array, Array]:
    """Pairs (point, later point) within reach, counted from 0 over all frames, and their costs."""
    first = np.cumsum([0, *map(len, points)])
    # quarter of a second to import
    from scipy.spatial import cKDTree

    trees = [cKDTree(frame) for frame in points]
    pairs, costs = [np.empty((0, 2), dtype=np.int64)], [np.empty(0)]
    for k, tree in enumerate(trees):
        for later in range(k + 1, min(k + 2 + memory, len(points))):
            if not (len(points[k]) and len(points[later])):
                continue
            count = sum(map(len, pairs)) + tree.count_neighbors(trees[later], reach)
            memory_left.require(_BYTES * count, f"{count} pairs within search_range", "lower it, or memory")
            found = tree.sparse_distance_matrix(trees[later], reach, output_type="ndarray")
            pairs.append(np.column_stack([found["i"] + first[k], found["j"] + first[later]]))
            costs.append(found["v"] ** 2 - (1.0 + _INCLUSIVE) * reach**2)
    joined, cost = np.concatenate(pairs), np.concatenate(costs)
    saves = cost < 0
    return joined[saves], cost[saves]


def _numbered(before: Array, first: Array) -> list[Array]:
    """Particles of all points, frame by frame, from the point before each (-1: none)."""
    numbers = np.empty(len(before), dtype=np.int64)
    known = 0
    for low, high in zip(first[:-1], first[1:], strict=True):
        earlier = before[low:high]
        new = earlier < 0
        numbers[low:high][~new] = numbers[earlier[~new]]
        numbers[low:high][new] = known + np.arange(new.sum())
        known += int(new.sum())
    return [numbers[low:high] for low, high in zip(first[:-1], first[1:], strict=True)]
