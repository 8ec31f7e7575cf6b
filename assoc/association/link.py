"""``link``: the same particle in one frame after the other, for all frames at once."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from assoc._parameters import is_number, is_whole, positive
from assoc._types import Array
from assoc.association.lineages import lineage_problem, links_of, numbered
from assoc.association.link_costs import LinkCosts, Points, candidates, learnt, velocities
from assoc.errors import InvalidInputError
from assoc.sensors.arrays import finite_array
from assoc.solution import Solution
from assoc.solvers.assign import assign

_ROUNDS = 5
"""Most rounds in which the price of a skipped frame and the velocities are estimated."""
_NAMES = ("x", "y", "z")


class _Linked(NamedTuple):
    ids: list[Array]
    solution: Solution


class Links(_Linked):
    """Particles that ``assoc.link`` followed; unpacks as ``ids, solution``.

    Attributes
    ----------
    ids : list of int arrays (M,)
        For each frame the particle of each point, from 0 in order of appearance. Of a table the frames are those from
        the first to the last number.
    solution : Solution
        Of the assignment problem whose tuples are links: (point, its next point), both counted from 1 over all frames;
        with divisions and merges points stand in several lists, so that no two children (parents) are of one list.
    particle : int array (N,)
        The particle of each point: of a table in the order of its rows, of frames one after the other.
    lineage : int array (K, 2)
        Parent and child of each division and merge.
    skip : float
        What each skipped frame cost, in squared units of the points.
    """

    particle: Array
    lineage: Array
    skip: float


def link(
    frames: Iterable[object],
    search_range: float,
    *,
    memory: int = 0,
    skip: float | None = None,
    start: float | None = None,
    end: float | None = None,
    predict: bool = False,
    velocity: ArrayLike | None = None,
    divisions: float | None = None,
    merges: float | None = None,
    frame: str = "frame",
    columns: Sequence[str] | None = None,
) -> Links:
    """Link the points of consecutive frames that belong to the same particle.

    The sum of squared distances is least over all frames together, where a particle that ends and one that begins
    cost at least ``search_range**2`` together (Crocker and Grier 1996 and trackpy: just that). As each point has at
    most one next point and is the next of at most one, this is one assignment of two lists, solved with proof.

    Parameters
    ----------
    frames : iterable of array_like, shape (M, D); pandas.DataFrame; or its groupby
        Points of each frame; M may differ and be 0. Of a table each row is a point; a frame without rows counts.
    search_range : float
        Longest distance between a point and the next, in units of the points. Over g frames it is sqrt(g) times as
        long, and squared distances count 1 / g, as a particle spreads by diffusion.
    memory : int, default 0
        Number of frames that a particle may be missing.
    skip : float, optional
        What each skipped frame costs, in squared units of the points. By default it is estimated from the links: twice
        the variance of a step along an axis times ``-log(q)``, where q is the share of frames in which particles are
        missing, so that links are skipped only as often as points are missing.
    start, end : float, optional
        What a particle costs that begins or ends. By default, with memory, both are half of ``search_range**2`` and a
        skipped frame; without it, half of ``search_range**2``, or more where the links say that an end and a beginning
        are less likely than a step as long as the range: by how often there are any, and how dense points are.
        With ``skip``, ``divisions`` or ``merges`` both are half of ``search_range**2``, as in trackpy.
    predict : bool, default False
        Whether points are sought where their particle's last steps (of the nearest particles, for one that begins)
        lead: for particles with velocities of their own.
    velocity : array_like, shape (D,), optional
        What all points move from frame to frame, as far as nothing else is known.
    divisions, merges : float, optional
        What the division of a particle into two, or the merger of two, costs beside the squared distances, in place of
        an end and two beginnings, or two ends and a beginning. The parts are new particles, `Links.lineage` names
        their parents. None: there are none.
    frame : str, default "frame"
        Of a table: the column with the number of the frame.
    columns : sequence of str, optional
        Of a table: the columns of the position; by default those of x, y and z that it has.

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
    points, order = _points(frames, frame, columns)
    reach = positive(search_range, "search_range")
    if not is_whole(memory, 0):
        raise InvalidInputError(f"memory must be an integer >= 0, got {memory!r}")
    prices = {"skip": skip, "start": start, "end": end, "divisions": divisions, "merges": merges}
    for name, value in prices.items():
        if not (value is None or (is_number(value) and value >= 0)):
            raise InvalidInputError(f"{name} must be a number >= 0, got {value!r}")
    moved = _velocity(velocity, points.places.shape[1])
    costs = LinkCosts(reach, memory, start, end, skip, divisions, merges)
    chosen, solution, costs = _linked(points, moved, costs, predict)
    numbers, lineage = numbered(points, chosen)
    links = Links([numbers[low:high] for low, high in pairwise(points.first)], solution)
    links.particle, links.lineage, links.skip = np.empty_like(numbers), lineage, costs.skip_price if memory else 0.0
    links.particle[order] = numbers
    return links


def _linked(points: Points, moved: Array, costs: LinkCosts, predict: bool) -> tuple[Array, Solution, LinkCosts]:
    """The links (K, 2), the solution that they are of, and the costs as far as these are learnt."""
    estimated = costs.learns_ends or (costs.memory > 0 and costs.skip is None)
    pairs = candidates(points, moved, costs.reach, costs.memory)
    # first how far particles move in a frame, from links of consecutive ones
    used = pairs.within(1) if estimated else pairs
    for _ in range(_ROUNDS):
        problem, lists, sources = lineage_problem(points, used, costs)
        solution = assign(problem)
        chosen, before, settled = links_of(solution, lists, sources), costs, True
        if not (predict or estimated):
            break
        costs, used = learnt(costs, used.of(chosen), points, len(used.gaps)), pairs
        if predict:
            faster = velocities(points, chosen, moved)
            settled = float(np.abs(faster - moved).max(initial=0.0)) <= 0.01 * costs.reach
            moved = faster
            used = pairs = candidates(points, moved, costs.reach, costs.memory)
        if costs.settled(before) and settled:
            break
    return chosen, solution, costs


def _points(frames: Iterable[object], frame: str, columns: Sequence[str] | None) -> tuple[Points, Array]:
    """All points frame by frame, and the place of each among what was given."""
    if hasattr(frames, "groupby") or hasattr(frames, "groups"):
        return _of_table(frames, frame, columns)
    if not isinstance(frames, Iterable):
        raise InvalidInputError(
            f"frames must be a list of arrays of shape (M, D) or a DataFrame, got {type(frames).__name__}"
        )
    arrays = [finite_array(one, f"frames[{k}]") for k, one in enumerate(frames)]
    shapes = {one.shape[1:] for one in arrays if one.size}
    if len(shapes) > 1 or any(len(shape) != 1 for shape in shapes):
        raise InvalidInputError(f"frames must be arrays of shape (M, D), with the same D, got shapes {sorted(shapes)}")
    width = next(iter(shapes))[0] if shapes else 1
    whole = [one if one.size else np.empty((0, width)) for one in arrays]
    counts = np.array([len(one) for one in whole], dtype=np.int64)
    points = Points(np.concatenate([np.empty((0, width)), *whole]), np.append(0, np.cumsum(counts)))
    return points, np.arange(len(points.places))


def _of_table(frames: Any, frame: str, columns: Sequence[str] | None) -> tuple[Points, Array]:
    """Points of a table, or of one that is grouped by frames."""
    if hasattr(frames, "groups"):
        table, numbers = frames.obj, frames.ngroup().to_numpy()
        keys = [key[0] if isinstance(key, tuple) and len(key) == 1 else key for key, _ in frames]
        when: Any = np.array(keys, dtype=object)[numbers]
    else:
        table = frames
        if frame not in table.columns:
            raise InvalidInputError(f"frames: the table has no column {frame!r}; name that of frames with frame=")
        when = table[frame].to_numpy()
    names = [name for name in _NAMES if name in table.columns] if columns is None else list(columns)
    missing = [name for name in names if name not in table.columns]
    if missing or not names:
        what = f"no column {missing[0]!r}" if missing else "no columns x, y, z"
        raise InvalidInputError(f"frames: the table has {what}; name those of the position with columns=")
    try:
        number = np.asarray(when, dtype=np.float64)
        places = table[names].to_numpy(dtype=np.float64)
    except (TypeError, ValueError):
        raise InvalidInputError(f"frames: columns {frame!r} and {', '.join(names)} must be numbers") from None
    if (number != np.round(number)).any():
        raise InvalidInputError(f"frames: column {frame!r} must hold whole numbers")
    finite_array(places, f"frames: columns {', '.join(names)}")
    if len(number) and np.ptp(number) > 1e7:
        raise InvalidInputError(f"frames: column {frame!r} reaches over {np.ptp(number):.3g} frames, at most 1e7 count")
    order = np.argsort(number, kind="stable")
    least = number.min() if len(number) else 0.0
    counts = np.bincount((number - least).astype(np.int64)) if len(number) else np.zeros(0, dtype=np.int64)
    return Points(np.ascontiguousarray(places[order]), np.append(0, np.cumsum(counts))), order


def _velocity(velocity: ArrayLike | None, dim: int) -> Array:
    if velocity is None:
        return np.zeros((1, dim))
    found = finite_array(velocity, "velocity")
    if found.shape != (dim,):
        raise InvalidInputError(f"velocity must have shape ({dim},), got {found.shape}")
    return found[None]
