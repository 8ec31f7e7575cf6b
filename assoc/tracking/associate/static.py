"""The static variant: first the sensors of a scan are fused, then the fused tuples go to tracks."""

from __future__ import annotations

import numpy as np

from assoc.costs.tracks.scores import doubted_gain
from assoc.problem import AssignmentProblem
from assoc.tracking.associate.all_sensors import whole_scan
from assoc.tracking.associate.mht import TrackTrees
from assoc.tracking.method import Method
from assoc.tracking.progress import Association, Progress
from assoc.tracking.tracker import Tracker


class StaticFusion(Method):
    """The method of `StaticFusionTracker`."""

    starter = TrackTrees()

    def associate(self, progress: Progress) -> Association:
        """Fuse the scan, then assign the fused tuples to tracks."""
        scan, scores = whole_scan(progress), progress.state.tracks.score
        fused = np.asarray(progress.work.assign(progress.settings.births.problem(progress.scan)).tuples, dtype=np.int32)
        count = len(scores)
        track, which = scan.near(fused)
        # every track may be missed: the tuple -1, without measurements
        track, which = np.append(track, np.arange(count)), np.append(which, np.full(count, -1))
        order = np.lexsort((which, track))
        track, which = track[order], which[order]
        rows = np.concatenate([fused, np.zeros((1, fused.shape[1]), dtype=np.int32)])[which]
        after = scan.follow(track, rows)
        good = np.flatnonzero(after.inside())
        value = doubted_gain(scores[track[good]], after.gain[good])
        columns = np.stack([track[good] + 1, which[good] + 1], axis=1)
        solution = progress.work.assign(AssignmentProblem(columns, -value, [count, len(fused)]))
        kept = good[solution.indices[solution.indices < len(good)]]
        kept = kept[np.argsort(track[kept])]
        free = np.ones(len(fused) + 1, dtype=np.bool_)
        free[which[kept]] = False
        return scan.associated(after.of(kept), rows[kept], fused[free[:-1]])


class StaticFusionTracker(Tracker):
    """S-D fusion of each scan by itself, then a 2-D assignment of the fused tuples to the tracks.

    The S-D problem does not use the tracks, and its tuples are not revised. Single measurements are tuples of one. A
    tuple's cost for a track is that of all its measurements under the track's predicted density, misses included,
    averaged over whether the track is a target.

    Parameters
    ----------
    sensors, filter, **options
        As for `Tracker`.
    """

    name = "static"
    method = StaticFusion
