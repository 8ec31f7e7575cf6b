"""The multi-sensor tracker: each scan is one assignment problem over tracks and all sensors."""

from __future__ import annotations

import numpy as np

from assoc._types import Array
from assoc.costs.tracks.own_times import TimedScan, grow_timed_tuples
from assoc.costs.tracks.scores import doubted_gain
from assoc.costs.tracks.tuples import grow_track_tuples
from assoc.problem import AssignmentProblem
from assoc.tracking.associate.all_sensors import associated, associated_in_order, scan_problem
from assoc.tracking.associate.method import Method
from assoc.tracking.associate.mht import TrackTrees
from assoc.tracking.progress import Association, Progress
from assoc.tracking.tracker import Tracker


class MultiSensor(Method):
    """What the tracker does with a scan."""

    nursery = TrackTrees()

    def at_once(self, progress: Progress) -> Association:
        """Tracks are the first list of the problem, the sensors the others."""
        settings, scan, tracks = progress.settings, progress.scan, progress.state.tracks
        tuples = grow_track_tuples(
            settings.filter, tracks.states, list(scan.measurements), settings.sensors, settings.terms,
            gate_probability=settings.gate_probability, max_tuples=settings.max_tuples,
        )  # fmt: skip
        gain = -tuples.costs
        value = doubted_gain(tracks.score[tuples.track], gain)
        rows, costs = _new_targets(progress)
        known = np.column_stack([tuples.track + 1, tuples.rows])
        fresh = np.column_stack([np.zeros(len(rows), dtype=np.int64), rows])
        sizes = np.concatenate([[len(tracks)], scan.sizes])
        problem = AssignmentProblem(np.concatenate([known, fresh]), np.concatenate([-value, costs]), sizes)
        solution = progress.work.assign(problem)
        kept = np.sort(solution.indices[solution.indices < len(known)])
        born = solution.tuples[solution.tuples[:, 0] == 0][:, 1:]
        return associated(progress, tuples.states[kept], gain[kept], tuples.rows[kept], born)

    def in_order(self, progress: Progress, timed: TimedScan) -> Association:
        """The same where measurements have times of their own."""
        settings, scores, looked = progress.settings, progress.state.tracks.score, timed.looked()
        tuples = grow_timed_tuples(timed, settings.terms, looked, settings.max_tuples)
        known = tuples.track >= 0
        value = -tuples.costs
        value[known] = doubted_gain(scores[tuples.track[known]], value[known])
        # where false alarms are rarer than new targets a single measurement is one, too
        # a track without measurements is missed, and has no part in the problem
        wooed = np.append(np.bincount(tuples.track[known], minlength=len(scores)) > 1, False)
        number = np.cumsum(wooed) * wooed
        good = np.flatnonzero(np.where(known, wooed[tuples.track], value > 0))
        columns = np.column_stack([number[tuples.track], tuples.rows])[good]
        sizes = np.concatenate([[int(wooed.sum())], progress.scan.sizes])
        solution = progress.work.assign(AssignmentProblem(columns, -value[good], sizes))
        mine = solution.tuples[solution.tuples[:, 0] > 0]
        rows = np.zeros((len(scores), len(settings.sensors)), dtype=np.int32)
        rows[np.flatnonzero(wooed)[mine[:, 0] - 1]] = mine[:, 1:]
        born = solution.tuples[solution.tuples[:, 0] == 0][:, 1:]
        return associated_in_order(progress, timed, looked, rows, born)


def _new_targets(progress: Progress) -> tuple[Array, Array]:
    """Tuples without a track that are better than false alarms, and their costs with the birth density."""
    problem, births = scan_problem(progress), progress.settings.births
    if not problem.num_tuples:
        return problem.tuples, problem.costs
    # where false alarms are rarer than new targets a single measurement is one, too
    scores = births.scores(problem.tuples, problem.costs, births.fused(progress.scan, problem.tuples)[1])
    good = scores > 0
    return problem.tuples[good], -scores[good]


class MultiSensorTracker(Tracker):
    """Tracks and S sensors in one (S+1)-D assignment problem for each scan.

    Tracks are the first list. A tuple (track, z_1, ..., z_S) costs the negative log likelihood ratio of its
    measurements under the track's predicted density, misses included, averaged over whether the track is a target
    at all, which its score tells; a tuple without a track is a new target
    and costs what `assoc.build_problem` says, with the birth density in it. Measurements in no tuple are false
    alarms, and begin tentative tracks.

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
