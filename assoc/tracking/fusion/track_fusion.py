"""Tracks of several systems as one picture.

Each system sends tracks, no measurements. Which tracks are of one target is an S-D assignment problem: a tuple has at
most one track of each system, and list 0 holds the fused tracks of the last step. With states x_s of covariances P_s,
a density b of targets and a probability P that a system has a track of a target, k tracks of one target weigh, against
k targets that one system each has,

    integral over x of the product of N(x_s; x, P_s)  /  (b (1 - P)^S)^(k - 1).

A track that was in a fused track before stays there with additional log odds, so that ids are kept.

The errors of the tracks of one target depend on each other in an unknown way: all systems follow the same manoeuvres.
Covariance intersection, P^-1 = sum of w_s P_s^-1 with weights w_s that sum to 1, is never too sure, whatever the
dependence. The weights minimise the determinant of P.

References
----------
S. Julier, J. Uhlmann, A non-divergent estimation algorithm in the presence of unknown correlations, ACC 1997.
Y. Bar-Shalom, H. Chen, Multisensor track-to-track association for tracks with dependent errors, CDC 2004.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from typing import Any, NamedTuple

import numpy as np
from scipy.special import gammaincinv

from assoc._parameters import positive
from assoc._system.wrong_types import explains_wrong_types
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.problem import AssignmentProblem
from assoc.solution import Solution
from assoc.solvers.assign import assign
from assoc.tracking.fusion.systems import SystemTracks, check_tracks, open_states
from assoc.tracking.records.track import Track

_LEAST_BOX = 1e4
"""Least side of the box of all tracks from which a density of targets is estimated, metres."""
_ROUNDS = 15
"""Steps of the search for the weights of an intersection."""


@dataclass(frozen=True)
class FusionParameters:
    """How tracks are fused.

    Parameters
    ----------
    density : float, optional
        Targets per m^3. Default: as many as the system with most tracks has, in the box of all tracks.
    coverage : float
        Probability that a system has a track of a target, above 0 and below 1.
    speed : float
        Standard deviation of targets' velocities along each axis, m/s.
    stay : float
        Log odds with which a track stays in its fused track.
    gate_probability : float
        Share of tracks of one target whose states lie in the gate, above 0 and below 1.
    noise : float
        Of states that are moved to a common time: root of the acceleration's spectral density, m/s^1.5.
    patience : float
        Seconds for which a fused track that no system has any more may come back with its id.
    """

    density: float | None = field(default=None)
    coverage: float = field(default=0.7)
    speed: float = field(default=300.0)
    stay: float = field(default=5.0)
    gate_probability: float = field(default=0.999)
    noise: float = field(default=5.0)
    patience: float = field(default=30.0)

    def __post_init__(self) -> None:
        for setting in fields(self):
            value = getattr(self, setting.name)
            if value is None and setting.name == "density":
                continue
            positive(value, setting.name, zero=setting.name in ("stay", "noise", "patience"))
            if setting.name in ("coverage", "gate_probability") and value >= 1:
                raise InvalidInputError(f"{setting.name} must be below 1, got {value!r}")


class FusedPicture(NamedTuple):
    """All targets at one time."""

    tracks: list[Track]
    """One for each target, sorted by id; `hits` counts the steps, `mean` is x, y, z, vx, vy, vz."""
    members: Array
    """Track of each system in each of them, 0 for none, int64 (T, S)."""
    solution: Solution
    """Of the assignment problem, with its bound; list 0 are the fused tracks before."""


class _FusedTracks(NamedTuple):
    """Fused tracks so far."""

    ids: Array
    members: Array
    """(F, S)"""
    state: SystemTracks
    started: Array
    seen: Array
    """When any system last had it, seconds, (F,)."""
    hits: Array


@explains_wrong_types
class TrackFusion:
    """Fuses the tracks of several systems, step by step.

    Parameters
    ----------
    systems : int
        How many there are.
    parameters : FusionParameters, optional
    solver : str
        One of ``assoc.solvers.names()``.

    Raises
    ------
    InvalidInputError
        There is no system.
    """

    def __init__(self, systems: int, parameters: FusionParameters | None = None, solver: str = "exact") -> None:
        if isinstance(systems, bool) or not isinstance(systems, (int, np.integer)) or systems < 1:
            raise InvalidInputError(f"systems must be a whole number above 0, got {systems!r}")
        self.systems, self.solver = int(systems), solver
        self.parameters = FusionParameters() if parameters is None else parameters
        nothing = np.zeros(0, dtype=np.int64)
        state = SystemTracks(nothing, *open_states(0), np.zeros(0))
        self._known = _FusedTracks(
            nothing, np.zeros((0, self.systems), np.int64), state, np.zeros(0), np.zeros(0), nothing
        )
        self._time, self._next_id = -np.inf, 1

    @property
    def ids(self) -> Array:
        """Ids of the fused tracks that are there, or may come back."""
        return self._known.ids

    def step(self, time: float, tracks: Sequence[SystemTracks]) -> FusedPicture:
        """Fuse the tracks that the systems have at this time.

        Parameters
        ----------
        time : float
            Seconds, not before the last step's.
        tracks : sequence of SystemTracks
            One of each system, at this time.

        Raises
        ------
        InvalidInputError
            Time goes back, a system is missing, or a covariance is not positive definite.
        """
        if not time >= self._time:
            raise InvalidInputError(f"time: {time!r} s comes after {self._time:g} s, expected times in order")
        if len(tracks) != self.systems:
            raise InvalidInputError(f"tracks: expected those of {self.systems} systems, got {len(tracks)}")
        for s, system in enumerate(tracks):
            check_tracks(system, s)
        chosen = self.parameters
        known = _part(self._known, time - self._known.seen <= chosen.patience)
        if len(known.ids):
            known = known._replace(state=known.state.moved(time - self._time, chosen.noise))
        # a fused track that some system still has is found by its members, the others by their states
        left = np.ones(len(known.ids), dtype=np.bool_)
        for system, ids in zip(tracks, known.members.T, strict=True):
            left &= ~np.isin(ids, system.ids)
        rows, costs = self._candidates(tracks, known, np.flatnonzero(left))
        problem = AssignmentProblem(rows, costs, [len(known.ids), *(len(system.ids) for system in tracks)])
        solution = assign(problem, self.solver, advise=False)
        groups = solution.tuples[solution.tuples[:, 1:].any(axis=1)]
        return self._after(time, tracks, known, groups, solution)

    def _candidates(self, tracks: Sequence[SystemTracks], known: _FusedTracks, left: Array) -> tuple[Array, Array]:
        """Tuples of two or more (M, 1 + S) and their costs."""
        lists = [SystemTracks(*(part[left] for part in known.state)), *tracks]
        price = self._price(tracks)
        grown = _Grown.none(len(lists))
        for s, system in enumerate(lists):
            number = left + 1 if s == 0 else np.arange(1, len(system.ids) + 1)
            grown = grown.with_list(s, number, system, price, self.parameters.gate_probability)
        rows, costs = grown.rows, grown.costs
        # with the fused track of each of its members
        was = np.zeros_like(rows[:, 1:])
        for s, system in enumerate(tracks):
            # those that some system had last come first, and count
            of_id = {i: f for f, i in reversed([*enumerate(known.members[:, s].tolist(), 1)]) if i}
            owner = np.array([0, *(of_id.get(i, 0) for i in system.ids.tolist())], dtype=np.int64)
            was[:, s] = owner[rows[:, s + 1]]
        more = [(rows, costs)]
        for s in range(self.systems):
            of = np.flatnonzero((was[:, s] > 0) & (rows[:, 0] == 0) & ~(was[:, :s] == was[:, s : s + 1]).any(axis=1))
            staying = (was[of] == was[of, s][:, None]).sum(axis=1)
            more.append((np.column_stack([was[of, s], rows[of, 1:]]), costs[of] - self.parameters.stay * staying))
        rows, costs = np.concatenate([pair[0] for pair in more]), np.concatenate([pair[1] for pair in more])
        several = (rows > 0).sum(axis=1) > 1
        return rows[several], costs[several]

    def _price(self, tracks: Sequence[SystemTracks]) -> float:
        """What a further track costs that joins others: ln of the density of tracks that no other system has."""
        chosen, density = self.parameters, self.parameters.density
        if density is None:
            places = np.concatenate([system.mean[:, :3] for system in tracks])
            sides = np.maximum(np.ptp(places, axis=0), _LEAST_BOX) if len(places) else np.full(3, _LEAST_BOX)
            density = max(1, *(len(system.ids) for system in tracks)) / float(np.prod(sides))
        velocities = 3.0 * np.log(np.sqrt(2.0 * np.pi) * chosen.speed)
        return float(np.log(density) - velocities + self.systems * np.log1p(-chosen.coverage))

    def _after(
        self, time: float, tracks: Sequence[SystemTracks], known: _FusedTracks, groups: Array, solution: Solution
    ) -> FusedPicture:
        """Fuse each group, give it its id, and remember it."""
        mean, covariance = np.zeros((len(groups), self.systems, 6)), np.zeros((len(groups), self.systems, 6, 6))
        members, absent = np.zeros((len(groups), self.systems), np.int64), np.ones((len(groups), self.systems))
        covariance[:] = np.eye(6)
        for s, system in enumerate(tracks):
            there = groups[:, s + 1] > 0
            row = groups[there, s + 1] - 1
            mean[there, s], covariance[there, s] = system.mean[row], system.covariance[row]
            members[there, s], absent[there, s] = system.ids[row], 1.0 - system.existence[row]
        fused = intersected(mean, covariance, members > 0)
        before, fresh = groups[:, 0] - 1, groups[:, 0] == 0
        ids = np.empty(len(groups), dtype=np.int64)
        ids[~fresh] = known.ids[before[~fresh]]
        # in the order of places, so that ids do not depend on the solver
        order = np.flatnonzero(fresh)[np.lexsort(fused[0][fresh].T)]
        ids[order] = np.arange(self._next_id, self._next_id + len(order))
        started, hits = np.full(len(groups), float(time)), np.ones(len(groups), dtype=np.int64)
        started[~fresh], hits[~fresh] = known.started[before[~fresh]], known.hits[before[~fresh]] + 1
        state = SystemTracks(ids, *fused, 1.0 - absent.prod(axis=1))
        now = _FusedTracks(ids, members, state, started, np.full(len(groups), float(time)), hits)
        now = _part(now, np.argsort(ids))
        gone = _part(known, ~np.isin(known.ids, ids))
        self._known = _FusedTracks(*(_joined(a, b) for a, b in zip(now, gone, strict=True)))
        self._time, self._next_id = float(time), self._next_id + len(order)
        found = [
            Track(int(i), float(time), x, P, x[:3], x[3:], True, 0.0, int(hit), float(begun), float(time), float(there))
            for (i, x, P, there), begun, hit in zip(zip(*now.state, strict=True), now.started, now.hits, strict=True)
        ]
        return FusedPicture(found, now.members, solution)


class _Grown(NamedTuple):
    """Tuples of tracks that may be of one target, with the sums that their costs need."""

    rows: Array
    """1-based, (M, L)."""
    costs: Array
    Y: Array
    """Sum of the inverse covariances, (M, 6, 6)."""
    y: Array
    """Sum of inverse covariance times mean, (M, 6)."""
    log: Array
    """Sum of mean' inverse covariance mean, and ln det(2 pi covariance), (M,)."""

    @staticmethod
    def none(lists: int) -> _Grown:
        """No tuples."""
        zero = np.zeros(0)
        return _Grown(np.zeros((0, lists), np.int64), zero, np.zeros((0, 6, 6)), np.zeros((0, 6)), zero)

    def with_list(self, s: int, number: Array, tracks: SystemTracks, price: float, gate: float) -> _Grown:
        """Add tuples with a track of list `s`, alone and with all tuples so far that lie in its gate."""
        inverse = np.linalg.inv(tracks.covariance)
        part = np.einsum("nij,nj->ni", inverse, tracks.mean)
        log = (part * tracks.mean).sum(axis=1) + np.linalg.slogdet(2.0 * np.pi * tracks.covariance)[1]
        rows = np.zeros((len(number), self.rows.shape[1]), np.int64)
        rows[:, s] = number
        alone = _Grown(rows, np.zeros(len(number)), inverse, part, log)
        if not len(self.rows) or not len(number):
            return _Grown(*map(_joined, self, alone))
        limit = 2.0 * gammaincinv(3.0, gate)
        spread = np.linalg.inv(self.Y)
        middle = np.einsum("nij,nj->ni", spread, self.y)
        reach = np.sqrt(limit * (spread[:, 0, 0].max() + tracks.covariance[:, 0, 0]))
        order = np.argsort(middle[:, 0])
        first = np.searchsorted(middle[order, 0], tracks.mean[:, 0] - reach)
        count = np.searchsorted(middle[order, 0], tracks.mean[:, 0] + reach, side="right") - first
        b = np.repeat(np.arange(len(number)), count)
        a = order[np.arange(len(b)) - np.repeat(np.cumsum(count) - count - first, count)]
        for axis in range(6):
            wide = spread[a, axis, axis] + tracks.covariance[b, axis, axis]
            near = (middle[a, axis] - tracks.mean[b, axis]) ** 2 <= limit * wide
            a, b = a[near], b[near]
        away = middle[a] - tracks.mean[b]
        square = (away * np.linalg.solve(spread[a] + tracks.covariance[b], away[:, :, None])[:, :, 0]).sum(axis=1)
        inside = square <= limit
        a, b = a[inside], b[inside]
        Y, y, log = self.Y[a] + inverse[b], self.y[a] + part[b], self.log[a] + alone.log[b]
        # ln of the integral of the product of the members' densities
        best = (y * np.linalg.solve(Y, y[:, :, None])[:, :, 0]).sum(axis=1)
        integral = -0.5 * (log - best) - 0.5 * np.linalg.slogdet(Y / (2.0 * np.pi))[1]
        rows = self.rows[a] + rows[b]
        costs = ((rows > 0).sum(axis=1) - 1) * price - integral
        return _Grown(*map(_joined, map(_joined, self, alone), _Grown(rows, costs, Y, y, log)))


def intersected(mean: Array, covariance: Array, used: Array) -> tuple[Array, Array]:
    """Covariance intersection of states with unknown dependence, by the weights of least determinant.

    G groups of S means (n,) and covariances, of which those in `used` (G, S) are there, at least one of each; one state
    of each.
    """
    inverse = np.linalg.inv(covariance)
    weights = used / np.maximum(used.sum(axis=1, keepdims=True), 1)
    several = np.flatnonzero(used.sum(axis=1) > 1)
    # the multiplicative algorithm of D-optimal designs: the determinant falls with each step
    for _ in range(_ROUNDS if len(several) else 0):
        P = np.linalg.inv(np.einsum("gs,gsij->gij", weights[several], inverse[several]))
        weights[several] *= np.einsum("gij,gsji->gs", P, inverse[several]) / mean.shape[2]
    P = np.linalg.inv(np.einsum("gs,gsij->gij", weights, inverse))
    return np.einsum("gij,gs,gsjk,gsk->gi", P, weights, inverse, mean, optimize=True), P


def _part(known: _FusedTracks, rows: Array) -> _FusedTracks:
    state = SystemTracks(*(part[rows] for part in known.state))
    return _FusedTracks(
        known.ids[rows], known.members[rows], state, known.started[rows], known.seen[rows], known.hits[rows]
    )


def _joined(a: Any, b: Any) -> Any:
    if isinstance(a, SystemTracks):
        return SystemTracks(*map(_joined, a, b))
    return np.concatenate([a, b])
