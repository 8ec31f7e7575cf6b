"""Trackers that decide each scan at once, and a nursery for tracks of sensors that start none alone.

A bearing tells no position. Where bearings of several sensors cross, most crossings are ghosts, and one scan cannot
tell them from targets: two targets in line with a sensor may as well have one another's bearing. A tracker that decides
each scan at once believes the wrong crossings as soon as they look better by chance, and these ghosts then keep the
bearings that the targets need. So where all sensors measure angles alone, such a tracker gives what its tracks leave
over to a nursery, a multiple hypothesis tracker that puts decisions off for some scans, and takes over the tracks that
have stood the test there. Tracks in the nursery are reported as soon as they are confirmed. A tracker that decides at
once may still let two tracks swap bearings, until they are ghosts: those end by `assoc.tracking.ghosts`.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import replace
from typing import Any

import numpy as np

from assoc._types import Array
from assoc.errors import LimitExceededError
from assoc.problem import AssignmentProblem
from assoc.scene.scan import Scan
from assoc.tracking.births.joint_starts import angles_alone
from assoc.tracking.checkpoint import Memory, require_field
from assoc.tracking.ghosts import Unseen
from assoc.tracking.mht.track_oriented import TrackOrientedMHT
from assoc.tracking.track import Decision, Step
from assoc.tracking.track_batch import TrackBatch
from assoc.tracking.tracker import Tracker

_GROWN = 5
"""Scans since a track began after which it is taken over: confirmation takes two or three, decisions three more."""
_FIELDS = "nursery."
"""What the names of the nursery's arrays begin with."""


class NursingTracker(Tracker):
    """Decide each scan at once (which the children do); tracks of bearings alone grow up in a nursery.

    Parameters
    ----------
    sensors, filter, **options
        As for `Tracker`.
    """

    _young_memory: Memory
    _unseen: Unseen

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._nursery: TrackOrientedMHT | None = None
        if angles_alone(self.sensors):
            self._nursery = TrackOrientedMHT(
                self.sensors, self.filter, region=self._place.region, solver=self.solver,
                solver_parameters=self.solver_parameters, seed=self.seed, time_limit=self.time_limit,
                life_cycle=self.life_cycle, initiation=self.initiation, gate_probability=self.gate_probability,
                max_tuples=self.max_tuples,
            )  # fmt: skip
            # it is told of by this one
            self._nursery._can_start = False
            self._keep(self._nursery)
            self._unseen = Unseen.none(len(self.sensors))

    @property
    def has_nursery(self) -> bool:
        """Whether tracks begin there, and nowhere else."""
        return self._nursery is not None

    @abstractmethod
    def _decide(self, scan: Scan) -> Step:
        """Take in one scan, all but what the nursery does."""

    def _step(self, scan: Scan) -> Step:
        nursery = self._young()
        if nursery is None:
            return self._decide(scan)
        grown = nursery.hand_over(_GROWN).survived(self._elapsed(scan.time) / self.life_cycle.lifetime)
        self._batch = TrackBatch.concatenate([self._batch, grown])
        step = self._decide(scan)
        if scan.at_once:
            step = self._without_ghosts(scan, step)
        step = self._with_young(scan, step, nursery)
        self._keep(nursery)
        return step

    def _detected(self, step: Step) -> Array:
        """Probability with which each sensor has detected each track, (T, S)."""
        return np.stack([np.isin(self._batch.track_id, one) for one in step.assigned], axis=1).astype(np.float64)

    def _without_ghosts(self, scan: Scan, step: Step) -> Step:
        """Delete tracks that a sensor does not see although it should; their bearings are free again."""
        batch = self._batch
        self._unseen = self._unseen.after(batch.track_id, self._detected(step), ~self._out_of_view())
        ghosts = self._unseen.ghosts(self.terms.miss)
        if not len(ghosts):
            return step
        ghosts = np.union1d(ghosts, self._partners(scan, step, ghosts))
        gone = np.isin(batch.track_id, ghosts)
        self._batch = batch[~gone]
        free = [np.isin(one, ghosts) for one in step.assigned]
        return replace(
            step,
            assigned=tuple(np.where(own, 0, one) for own, one in zip(free, step.assigned, strict=True)),
            confirmed=tuple(~own & one for own, one in zip(free, step.confirmed, strict=True)),
            ended=np.sort(np.concatenate([step.ended, batch.track_id[gone & batch.confirmed]])),
        )

    def _partners(self, scan: Scan, step: Step, ghosts: Array) -> Array:
        """Tracks that have swapped bearings with ghosts.

        By this scan alone, they hold bearings that belong together with those of a ghost, and bearings that do not.
        """
        try:
            found = self._crossings(scan, [np.ones(len(one), dtype=np.bool_) for one in step.assigned])
        except LimitExceededError:
            # too many crossings to tell: the ghosts end, and so does the swap
            return ghosts[:0]
        if found is None:
            return ghosts[:0]
        several = found[0]
        tuples = self._assign(AssignmentProblem(several.rows, several.costs, scan.sizes)).tuples
        owners = np.stack([np.append(0, one)[tuples[:, s]] for s, one in enumerate(step.assigned)], axis=1)
        touched = owners[np.isin(owners, ghosts).any(axis=1)]
        apart = [track for track in np.unique(owners) if (owners == track).any(axis=1).sum() > 1]
        return np.intersect1d(touched, [track for track in apart if track > 0])

    def _keep(self, nursery: TrackOrientedMHT) -> None:
        # this tracker may be taken back to any earlier step: what it holds is the nursery's state, not the nursery
        self._young_memory = nursery.remember()

    def _young(self) -> TrackOrientedMHT | None:
        """The nursery as it was after the last step."""
        if self._nursery is not None:
            self._nursery.go_back(self._young_memory)
        return self._nursery

    def _with_young(self, scan: Scan, step: Step, nursery: TrackOrientedMHT) -> Step:
        """What becomes of a step when the nursery has taken in what it left over."""
        free = [ids == 0 for ids in step.assigned]
        z = [one[own] for one, own in zip(scan.measurements, free, strict=True)]
        times = None if scan.times is None else [one[own] for one, own in zip(scan.times, free, strict=True)]
        calls, nursery._next_id = nursery.solver_calls, self._next_id
        young = nursery.step(scan.time, z, times, scan.sectors)
        self._next_id, self.solver_calls = nursery._next_id, self.solver_calls + nursery.solver_calls - calls
        assigned, confirmed = [one.copy() for one in step.assigned], [one.copy() for one in step.confirmed]
        for s, own in enumerate(free):
            assigned[s][own], confirmed[s][own] = young.assigned[s], young.confirmed[s]
        now = Decision(scan.index, scan.time, tuple(assigned), tuple(confirmed))
        ended = np.sort(np.concatenate([step.ended, young.ended]))
        return replace(step, assigned=now.assigned, confirmed=now.confirmed, final=(now,), ended=ended)

    def _current(self) -> TrackBatch:
        nursery = self._young()
        if nursery is None:
            return self._batch
        batch = TrackBatch.concatenate([self._batch, nursery._current()])
        return batch[np.argsort(batch.track_id, kind="stable")]

    def _arrays(self) -> dict[str, Array]:
        nursery = self._young()
        if nursery is None:
            return super()._arrays()
        young = {f"{_FIELDS}{name}": value for name, value in nursery._arrays().items() if name != "settings"}
        return super()._arrays() | young | {"unseen_ids": self._unseen.ids, "unseen": self._unseen.misses}

    def _check(self, arrays: dict[str, Array]) -> None:
        super()._check(arrays)
        if self._nursery is not None:
            self._nursery._check(_of_nursery(arrays))
            before = float(arrays["time"]), float(arrays[f"{_FIELDS}time"])
            require_field(before[0] == before[1] or np.isnan(before[1]), f"{_FIELDS}time", "the tracker's time")
            ids, misses = arrays["unseen_ids"], arrays["unseen"]
            require_field((np.diff(ids) > 0).all(), "unseen_ids", "ids that ascend")
            good = misses.shape == (len(ids), len(self.sensors)) and (misses >= 0).all()
            require_field(good, "unseen", "how often each sensor has missed each track")

    def _take(self, arrays: dict[str, Array]) -> None:
        super()._take(arrays)
        if self._nursery is not None:
            self._nursery._take(_of_nursery(arrays))
            self._unseen = Unseen(arrays["unseen_ids"], arrays["unseen"])
            self._keep(self._nursery)


def _of_nursery(arrays: dict[str, Array]) -> dict[str, Array]:
    return {name.removeprefix(_FIELDS): value for name, value in arrays.items() if name.startswith(_FIELDS)}
