"""The nearest-neighbour tracker: sensor after sensor, each measurement to the track that is nearest."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from assoc._types import Array
from assoc.costs.tracks.scores import doubted_gain
from assoc.errors import InvalidInputError
from assoc.problem import AssignmentProblem
from assoc.tracking.associate.mht import TrackTrees
from assoc.tracking.growth import Offers, Scores, growth_of
from assoc.tracking.method import Method
from assoc.tracking.progress import Association, Progress
from assoc.tracking.records.track import owners
from assoc.tracking.tracker import Tracker

Rule = Literal["greedy", "assignment"]


@dataclass(frozen=True)
class NearestNeighbour(Method):
    """The method of `NearestNeighbourTracker`."""

    starter = TrackTrees()

    rule: Rule = "greedy"

    def __post_init__(self) -> None:
        if self.rule not in get_args(Rule):
            raise InvalidInputError(f"rule must be 'greedy' or 'assignment', got {self.rule!r}")

    def associate(self, progress: Progress) -> Association:
        """Process sensor after sensor; unused measurements of one start tracks that the next may confirm."""
        sizes = progress.scan.sizes
        growth, scores = growth_of(progress), Scores(progress)
        for s in growth.order:
            offers, count = growth.pairs(s), len(scores.now)
            chosen = self._choose(progress, offers, scores.now, int(sizes[s]))
            free = np.ones(sizes[s], dtype=np.bool_)
            free[offers.measurement[chosen]] = False
            offers = growth.with_births(s, offers, np.flatnonzero(free))
            hit = offers.branch[chosen]
            gain, kept = offers.missed.copy(), np.arange(count)
            gain[hit], kept[hit] = offers.gain[chosen], count + chosen
            order = scores.after(scores.now + gain, offers.births, offers.births.score)
            growth.take(s, offers, np.append(kept, count + len(offers.branch) + order))
        grown, seen = growth.finished(), np.asarray(growth.rows.any(axis=1))
        batch = scores.batch(grown.states, grown.first, grown.last)
        return Association(batch.counted(seen, grown.covered), owners(growth.rows, batch.track_id, sizes))

    def _choose(self, progress: Progress, offers: Offers, scores: Array, count: int) -> Array:
        """Rows of the chosen pairs of tracks with these scores and `count` measurements."""
        track, measurement = offers.branch, offers.measurement
        tracks, own = len(scores), scores[track]
        seen = doubted_gain(own, offers.gain)
        if self.rule == "assignment":
            costs = doubted_gain(own, offers.missed[track]) - seen
            both = np.stack([track, measurement], axis=1) + 1
            solution = progress.work.assign(AssignmentProblem(both, costs, [tracks, count]))
            return np.asarray(solution.indices[solution.indices < len(both)])
        free_track, free = np.ones(tracks, dtype=np.bool_), np.ones(count, dtype=np.bool_)
        taken = []
        for row in np.argsort(-seen, kind="stable").tolist():
            t, m = track[row], measurement[row]
            if free_track[t] and free[m]:
                free_track[t] = free[m] = False
                taken.append(row)
        return np.array(taken, dtype=np.int64)


class NearestNeighbourTracker(Tracker):
    """The plain tracker that others are compared with.

    The sensors of a scan are processed one after the other, whatever the measurements' times. Pairs of tracks and
    measurements within the gate are chosen by decreasing likelihood, averaged over whether the track is a target;
    each unused measurement starts a track at once, which the next sensor may confirm.

    Parameters
    ----------
    sensors, filter, ...
        As for `Tracker`.
    rule : "greedy" or "assignment"
        "assignment" takes the best 2-D assignment instead (global nearest neighbour), by the tracker's solver.
    **options
        As for `Tracker`.
    """

    name = "nearest-neighbour"
    method = NearestNeighbour


Tracker.plain = NearestNeighbourTracker
