"""The multi-sensor tracker: each scan is one assignment problem over tracks and all sensors."""

from __future__ import annotations

import numpy as np

from assoc.costs.tracks.scores import doubted_gain
from assoc.problem import AssignmentProblem
from assoc.tracking.associate.all_sensors import whole_scan
from assoc.tracking.associate.mht import TrackTrees
from assoc.tracking.method import Method
from assoc.tracking.progress import Association, Progress
from assoc.tracking.tracker import Tracker


class MultiSensor(Method):
    """The method of `MultiSensorTracker`."""

    starter = TrackTrees()

    def associate(self, progress: Progress) -> Association:
        """Tracks are the first list of the problem, the sensors the others."""
        scan, scores = whole_scan(progress), progress.state.tracks.score
        track, rows, value = scan.candidates()
        known = track >= 0
        value[known] = doubted_gain(scores[track[known]], value[known])
        # tracks without measurements are missed, and left out of the problem
        contested = np.append(np.bincount(track[known], minlength=len(scores)) > 1, False)
        number = np.cumsum(contested) * contested
        good = np.flatnonzero(~known | contested[track])
        columns = np.column_stack([number[track], rows])[good]
        sizes = np.concatenate([[int(contested.sum())], progress.scan.sizes])
        solution = progress.work.assign(AssignmentProblem(columns, -value[good], sizes))
        taken = solution.tuples[solution.tuples[:, 0] > 0]
        chosen = np.zeros((len(scores), rows.shape[1]), dtype=np.int32)
        chosen[np.flatnonzero(contested)[taken[:, 0] - 1]] = taken[:, 1:]
        born = solution.tuples[solution.tuples[:, 0] == 0][:, 1:]
        return scan.associated(scan.follow(np.arange(len(scores)), chosen), chosen, born)


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
