"""New tracks from measurements that no track took: their positions and scores.

A bearing alone determines no position. Unused measurements of sensors that measure angles alone start tracks as tuples
of two or more that may be one target. Most of these are ghosts: crossings of bearings of different targets or of false
alarms. They end like other false tracks: later measurements do not confirm them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from assoc._types import Array
from assoc.costs.build import build_problem
from assoc.costs.positions import costs_and_positions, positions_and_covariances, positions_of_scan, single_positions
from assoc.costs.tracks.own_times import Places
from assoc.costs.tracks.scores import ScoreTerms, log_birth
from assoc.costs.views import Views, blind_somewhere, log_missed
from assoc.filters.base import Filter
from assoc.filters.state import gaussian
from assoc.problem import AssignmentProblem
from assoc.scene.scan import Scan
from assoc.scene.scene import Scene
from assoc.tracking.records.initiation import Initiation


class Crossings(NamedTuple):
    """K tuples of measurements, each of which may be one target."""

    rows: Array
    """1-based measurement of each sensor, 0: none; int32 (K, S)."""
    costs: Array
    """Costs relative to false alarms, (K,); see `assoc.build_problem`."""
    scores: Array
    """Scores as new targets, (K,)."""
    positions: Array
    """Metres, (K, 3)."""
    covariances: Array
    """(K, 3, 3)."""


class NewTracks:
    """New tracks for a tracker's sensors and region (`scene`) and filter.

    `terms` score detections and misses; `limits` are gate_probability and max_tuples of `assoc.build_problem`.
    """

    def __init__(
        self, scene: Scene, filter: Filter[Any], initiation: Initiation, terms: ScoreTerms, limits: Mapping[str, Any]
    ) -> None:
        self._scene, self._filter, self._initiation, self._terms, self._limits = (
            scene,
            filter,
            initiation,
            terms,
            limits,
        )
        # a target that first appears at a sensor was missed by the sensors before it
        self._appears = terms.birth + np.cumsum(terms.miss) - terms.miss
        self._blind = blind_somewhere(scene.sensors, scene.region)
        # those that miss less of some targets than of others; `problem` makes candidates as if only blind ones did
        self._uneven = self._blind if terms.by_range is None else self._blind | (terms.by_range < 1.0).any(axis=1)
        self._views = Views(scene.sensors, (0, 1, 2), terms.by_range)
        self._widest = initiation.widest * float(np.linalg.norm(np.diff(scene.region, axis=1)))

    def fused(self, scan: Scan, tuples: Array) -> tuple[Array, Array, Array]:
        """Positions, covariances, and which are precise enough to start a track."""
        positions, covariances = positions_and_covariances(self._scene, scan, tuples)
        return positions, covariances, self._fit(positions, covariances)

    def weighed(self, scan: Scan, tuples: Array) -> tuple[Array, Array, Array, Array]:
        """Costs by `assoc.tuple_costs`, and what `fused` returns."""
        costs, positions, covariances = costs_and_positions(self._scene, scan, tuples, speed=self._initiation.speed)
        return costs, positions, covariances, self._fit(positions, covariances)

    def _fit(self, positions: Array, covariances: Array) -> Array:
        """Which positions may start a track, bool (K,)."""
        return np.asarray(self.narrow(covariances) & self._initiation.opens(positions))

    def narrow(self, covariances: Array) -> Array:
        """Which positions are precise enough to start a track, by their covariances (K, 3, 3); bool (K,)."""
        # where no sensor measures heights, they come from the scene's region: they need not be precise
        limit = self._widest**2
        if len(self._filter.motion.position) == 1:
            return np.asarray(covariances[:, 0, 0] <= limit)
        return np.asarray((covariances[:, 0, 0] <= limit) & (covariances[:, 1, 1] <= limit))

    def _log_birth(self, covariances: Array) -> Array:
        """Birth term of new targets' scores, by the covariances of their positions."""
        return log_birth(covariances, self._scene.region, self._initiation.birth_rate)

    def problem(self, scan: Scan) -> AssignmentProblem:
        """Candidate tuples of a scan, regardless of tracks.

        Costs are those of `build_problem`, but that a sensor misses only what it can see, and that false alarms are
        as dense at each measurement as they are there.
        """
        problem = build_problem(self._scene, scan, speed=self._initiation.speed, blind=self._blind, **self._limits)
        views = self._uneven.any() and scan.at_once
        if not views and scan.clutter is None:
            return problem
        costs = problem.costs + scan.crowding(problem.tuples)
        if views:
            costs -= self.overlooked(problem.tuples, *self.fused(scan, problem.tuples)[:2])
        return AssignmentProblem(problem.tuples[costs < 0], costs[costs < 0], problem.sizes)

    def overlooked(self, rows: Array, positions: Array, covariances: Array) -> Array:
        """What equation 5 counts too much for misses of sensors that cannot see tuples (K, S), (K,)."""
        total = np.zeros(len(rows))
        for s in np.flatnonzero(self._uneven).tolist():
            here = np.flatnonzero(rows[:, s] == 0)
            if not len(here):
                continue
            share = self._views.shares(gaussian(positions[here], covariances[here]), slice(s, s + 1))[:, 0]
            total[here] += log_missed(self._terms.miss[s], share) - self._terms.miss[s]
        return total

    def scores(self, rows: Array, costs: Array, positions: Array, covariances: Array) -> Array:
        """Scores of tuples (K, S) as new targets, by their costs (misses in view alone) and places."""
        seen = rows > 0
        # `tuple_costs` treats single measurements as false alarms
        alone = seen @ self._terms.birth + ~seen @ self._terms.miss + self.overlooked(rows, positions, covariances)
        return np.asarray(np.where(seen.sum(axis=1) == 1, alone, -costs) + self._log_birth(covariances))

    def singles(self, s: int, scan: Scan, numbers: Array) -> tuple[Any, Array, Array, Array]:
        """New tracks of single measurements (numbers from 0) of sensor s: states, which are used, positions, scores."""
        positions, covariances = single_positions(self._scene, s, scan.measurements[s][numbers])
        fit = self._fit(positions, covariances)
        if not fit.all():
            positions, covariances = positions[fit], covariances[fit]
        scores = self._appears[s] + self._log_birth(covariances)
        if self._uneven[:s].any():
            later = np.broadcast_to(np.arange(len(self._blind)) >= s, (len(positions), len(self._blind)))
            scores += self.overlooked(later, positions, covariances)
        scores = scores - scan.crowd(s, numbers[fit])
        return self._initiation.start(self._filter, positions, covariances), fit, positions, scores

    def places(self, scan: Scan) -> Places:
        """Position of the target of each measurement of a scan, by that measurement alone."""
        positions, covariances, fit, births = [], [], [], []
        for s in range(len(scan.measurements)):
            where, spread = positions_of_scan(self._scene, scan, s)
            positions.append(where)
            covariances.append(np.asarray(spread))
            fit.append(self._fit(where, covariances[s]))
            crowd = scan.crowd(s, np.arange(len(where)))
            births.append(self._terms.birth[s] + self._log_birth(covariances[s]) - crowd)
        return Places(positions, covariances, fit, births)

    def crossings(self, scan: Scan, free: Sequence[Array]) -> Crossings | None:
        """Tuples of two free measurements or more that may start tracks; None where there are none.

        `free`, of each sensor (n_s,), are the measurements that may be used.
        """
        numbers = [np.flatnonzero(mask) for mask in free]
        if sum(len(rows) > 0 for rows in numbers) < 2:
            return None
        left = Scan(scan.index, scan.time, tuple(z[rows] for z, rows in zip(scan.measurements, numbers, strict=True)))
        problem = self.problem(left)
        several = np.count_nonzero(problem.tuples, axis=1) > 1
        if not several.any():
            return None
        tuples, costs = problem.tuples[several], problem.costs[several]
        positions, covariances, fit = self.fused(left, tuples)
        number_of = [np.concatenate([[0], rows + 1]) for rows in numbers]
        rows = np.stack([number[tuples[:, s]] for s, number in enumerate(number_of)], axis=1).astype(np.int32)
        rows, costs, positions, covariances = rows[fit], costs[fit], positions[fit], covariances[fit]
        scores = self.scores(rows, costs, positions, covariances) - scan.crowding(rows)
        return Crossings(rows, costs, scores, positions, covariances)
