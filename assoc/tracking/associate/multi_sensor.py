"""The multi-sensor tracker: each scan is one assignment problem over tracks and all sensors."""

from __future__ import annotations

import numpy as np

from assoc._types import Array
from assoc.costs.tracks.own_times import TimedScan, grow_timed_tuples
from assoc.costs.tracks.scores import doubted_gain
from assoc.costs.tracks.tuples import corrected, grow_track_tuples
from assoc.problem import AssignmentProblem
from assoc.tracking.associate.all_sensors import associated, associated_in_order
from assoc.tracking.associate.mht import TrackTrees
from assoc.tracking.method import Method
from assoc.tracking.progress import Association, Progress
from assoc.tracking.stages.coverage import misses
from assoc.tracking.tracker import Tracker


class MultiSensor(Method):
    """The method of `MultiSensorTracker`."""

    starter = TrackTrees()

    def at_once(self, progress: Progress) -> Association:
        """Tracks are the first list of the problem, the sensors the others."""
        settings, scan, tracks = progress.settings, progress.scan, progress.state.tracks
        missed = misses(progress, tracks.states)
        tuples = grow_track_tuples(
            settings.filter, tracks.states, list(scan.measurements), settings.sensors, settings.terms,
            missed,
            gate_probability=settings.gate_probability, max_tuples=settings.max_tuples,
        )  # fmt: skip
        gain = -tuples.costs - scan.crowding(tuples.rows)
        value = doubted_gain(tracks.score[tuples.track], gain)
        rows, costs = new_targets(progress)
        known = np.column_stack([tuples.track + 1, tuples.rows])
        fresh = np.column_stack([np.zeros(len(rows), dtype=np.int64), rows])
        sizes = np.concatenate([[len(tracks)], scan.sizes])
        problem = AssignmentProblem(np.concatenate([known, fresh]), np.concatenate([-value, costs]), sizes)
        solution = progress.work.assign(problem)
        kept = np.sort(solution.indices[solution.indices < len(known)])
        born = solution.tuples[solution.tuples[:, 0] == 0][:, 1:]
        rows = tuples.rows[kept]
        states = corrected(settings.filter, tracks.states, scan.measurements, settings.sensors, rows)
        return associated(progress, states, gain[kept], rows, born, missed)

    def in_order(self, progress: Progress, timed: TimedScan) -> Association:
        """The same where measurements have times of their own."""
        settings, scores = progress.settings, progress.state.tracks.score
        missed = timed.misses(settings.terms)
        tuples = grow_timed_tuples(timed, settings.terms, missed, settings.max_tuples)
        known = tuples.track >= 0
        value = -tuples.costs
        value[known] = doubted_gain(scores[tuples.track[known]], value[known])
        # where new targets are more frequent than false alarms, single measurements may be new targets, too
        # tracks without measurements are missed, and left out of the problem
        contested = np.append(np.bincount(tuples.track[known], minlength=len(scores)) > 1, False)
        number = np.cumsum(contested) * contested
        good = np.flatnonzero(np.where(known, contested[tuples.track], value > 0))
        columns = np.column_stack([number[tuples.track], tuples.rows])[good]
        sizes = np.concatenate([[int(contested.sum())], progress.scan.sizes])
        solution = progress.work.assign(AssignmentProblem(columns, -value[good], sizes))
        taken = solution.tuples[solution.tuples[:, 0] > 0]
        rows = np.zeros((len(scores), len(settings.sensors)), dtype=np.int32)
        rows[np.flatnonzero(contested)[taken[:, 0] - 1]] = taken[:, 1:]
        born = solution.tuples[solution.tuples[:, 0] == 0][:, 1:]
        return associated_in_order(progress, timed, missed, rows, born)


def new_targets(progress: Progress) -> tuple[Array, Array]:
    """Tuples without a track that are better than false alarms, and their costs with the birth density."""
    births = progress.settings.births
    problem = births.problem(progress.scan)
    if not problem.num_tuples:
        return problem.tuples, problem.costs
    # where new targets are more frequent than false alarms, single measurements may be new targets, too
    scores = births.scores(problem.tuples, problem.costs, *births.fused(progress.scan, problem.tuples)[:2])
    good = scores > 0
    return problem.tuples[good], -scores[good]


class MultiSensorTracker(Tracker):
    """Tracks and S sensors in one (S+1)-D assignment problem for each scan.

    Tracks are the first list. The cost of a tuple (track, z_1, ..., z_S) is the negative log likelihood ratio of its
    measurements under the track's predicted density, misses included, averaged over whether the track is a target, by
    its score. A tuple without a track is a new target; its cost is that of `assoc.build_problem` plus the birth
    density. Measurements in no tuple are false alarms, and begin tentative tracks.

    Parameters
    ----------
    sensors, filter, **options
        As for `Tracker`.

    References
    ----------
    Y. Bar-Shalom, P. Willett, X. Tian, Tracking and Data Fusion, 2011, chapter 9.
    """

    name = "multi-sensor"
    method = MultiSensor
