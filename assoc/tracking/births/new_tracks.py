"""What measurements that no track takes begin: where their targets are, and what they score as new tracks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from assoc._types import Array
from assoc.costs.positions import positions_and_covariances, single_positions
from assoc.costs.tracks.own_times import Places
from assoc.costs.tracks.scores import ScoreTerms, log_birth
from assoc.filters.base import Filter
from assoc.scene.scan import Scan
from assoc.scene.scene import Scene
from assoc.tracking.births.initiation import Initiation
from assoc.tracking.births.joint_starts import Crossings, angles_alone, crossings


class NewTracks:
    """New tracks for a tracker's sensors and filter.

    Parameters
    ----------
    place : Scene
        Sensors and region.
    filter : Filter
    initiation : Initiation
    terms : ScoreTerms
        What detections and misses of each sensor add to a score.
    """

    def __init__(self, place: Scene, filter: Filter[Any], initiation: Initiation, terms: ScoreTerms) -> None:
        self._place = place
        self._filter = filter
        self._initiation = initiation
        self._terms = terms
        # a target that appears with a sensor's measurement was missed by the sensors before it
        self._appears = terms.birth + np.cumsum(terms.miss) - terms.miss
        initiation.prior(filter.motion)  # refuses what does not suit the filter now, not in the first scan
        self._widest = initiation.widest * float(np.linalg.norm(np.diff(place.region, axis=1)))

    def fused(self, scan: Scan, tuples: Array) -> tuple[Array, Array, Array]:
        """Positions, covariances, and which of them are narrow enough to start a track."""
        positions, covariances = positions_and_covariances(self._place, scan, tuples)
        return positions, covariances, self._narrow(covariances)

    def _narrow(self, covariances: Array) -> Array:
        # heights are the scene's own where radars do not tell them: they do not forbid a track
        limit = self._widest**2
        if len(self._filter.motion.position) == 1:
            return np.asarray(covariances[:, 0, 0] <= limit)
        return np.asarray((covariances[:, 0, 0] <= limit) & (covariances[:, 1, 1] <= limit))

    def _log_birth(self, covariances: Array) -> Array:
        """What new targets add to the score of their measurements, by the covariances of their positions."""
        return log_birth(covariances, self._place.region, self._initiation.birth_rate)

    def scores(self, rows: Array, costs: Array, covariances: Array) -> Array:
        """Scores of tuples (K, S) as new targets, by their costs and the covariances of their positions."""
        seen = rows > 0
        # to `tuple_costs` a single measurement is a false alarm
        alone = seen @ self._terms.birth + ~seen @ self._terms.miss
        return np.asarray(np.where(seen.sum(axis=1) == 1, alone, -costs) + self._log_birth(covariances))

    def singles(self, s: int, measured: Array) -> tuple[Any, Array, Array, Array]:
        """New tracks of single measurements (n, d) of sensor s: states, which can start one, where, and scores."""
        positions, covariances = single_positions(self._place, s, measured)
        fit = self._narrow(covariances)
        if not fit.all():
            positions, covariances = positions[fit], covariances[fit]
        scores = self._appears[s] + self._log_birth(covariances)
        return self._initiation.start(self._filter, positions, covariances), fit, positions, scores

    def any_alone(self, measurements: Sequence[Array]) -> bool:
        """Whether any measurement tells alone where to start a track."""
        return any(one.any() for one in self.places(measurements).fit)

    def places(self, measurements: Sequence[Array]) -> Places:
        """Where each measurement of a scan alone says that its target is."""
        positions, covariances, fit, births = [], [], [], []
        for s, z in enumerate(measurements):
            where, spread = single_positions(self._place, s, z)
            positions.append(where)
            covariances.append(np.asarray(spread))
            fit.append(self._narrow(covariances[s]))
            births.append(self._terms.birth[s] + self._log_birth(covariances[s]))
        return Places(positions, covariances, fit, births)

    def crossings(self, scan: Scan, free: Sequence[Array], **options: Any) -> tuple[Crossings, Array] | None:
        """Tuples that may start tracks where all sensors measure angles alone, and their scores as new targets.

        `free` are masks over the measurements of each sensor, `options` those of `assoc.build_problem`; see
        `assoc.tracking.births.joint_starts`.
        """
        if not angles_alone(self._place.sensors):
            return None
        found = crossings(self._place, scan, free, speed=self._initiation.speed, **options)
        if found is None:
            return None
        fit = self._narrow(found.covariances)
        kept = Crossings(*(one[fit] for one in found))
        return kept, self.scores(kept.rows, kept.costs, kept.covariances)
