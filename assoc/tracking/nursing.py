"""Trackers that decide each scan at once, and a nursery for tracks of sensors that start none alone.

A bearing tells no position. Where bearings of several sensors cross, most crossings are ghosts, and one scan cannot
tell them from targets: two targets in line with a sensor may as well have one another's bearing. A tracker that decides
each scan at once believes the wrong crossings as soon as they look better by chance, and these ghosts then keep the
bearings that the targets need. So where all sensors measure angles alone, such a tracker gives what its tracks leave
over to a nursery, a multiple hypothesis tracker that puts decisions off for some scans, and takes over the tracks that
have stood the test there. Tracks in the nursery are reported as soon as they are confirmed.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import replace
from typing import Any

import numpy as np

from assoc._types import Array
from assoc.scene.scan import Scan
from assoc.tracking.births.joint_starts import angles_alone
from assoc.tracking.checkpoint import Memory, require_field
from assoc.tracking.mht.track_oriented import TrackOrientedMHT
from assoc.tracking.track import Decision, Step
from assoc.tracking.track_batch import TrackBatch
from assoc.tracking.tracker import Tracker

_GROWN = 5
"""Scans since a track began after which it is taken over."""
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
            self._keep(self._nursery)

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
        step = self._with_young(scan, self._decide(scan), nursery)
        self._keep(nursery)
        return step

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
        young = {} if nursery is None else nursery._arrays()
        return super()._arrays() | {f"{_FIELDS}{name}": value for name, value in young.items() if name != "settings"}

    def _check(self, arrays: dict[str, Array]) -> None:
        super()._check(arrays)
        if self._nursery is not None:
            self._nursery._check(_of_nursery(arrays))
            before = float(arrays["time"]), float(arrays[f"{_FIELDS}time"])
            require_field(before[0] == before[1] or np.isnan(before[1]), f"{_FIELDS}time", "the tracker's time")

    def _take(self, arrays: dict[str, Array]) -> None:
        super()._take(arrays)
        if self._nursery is not None:
            self._nursery._take(_of_nursery(arrays))
            self._keep(self._nursery)


def _of_nursery(arrays: dict[str, Array]) -> dict[str, Array]:
    return {name.removeprefix(_FIELDS): value for name, value in arrays.items() if name.startswith(_FIELDS)}
