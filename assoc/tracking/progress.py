"""A step under way: the record that stages pass on."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from assoc._types import Array
from assoc.costs.tracks.own_times import TimedScan
from assoc.problem import AssignmentProblem
from assoc.scene.scan import Scan
from assoc.solution import Solution
from assoc.solvers.assign import assign
from assoc.tracking.records.clutter import ClutterMap
from assoc.tracking.records.track import Step
from assoc.tracking.records.track_batch import TrackBatch
from assoc.tracking.records.unresolved import Shared
from assoc.tracking.settings import TrackerSettings
from assoc.tracking.state import TrackerState

# default limits of the exact solver on one scan: visits of tuples in branch and bound, and the least number of nodes;
# counted, not timed, so that the answer does not depend on the machine
_VISITS, _LEAST_NODES = 500_000, 10
# relative gap with which it may leave a component of 2,000 measurements and more: first scans of large crowds are
# a single one, and the tracks are as good
_GAP = 1e-3


class Association(NamedTuple):
    """How a scan was associated with tracks."""

    tracks: TrackBatch
    """Tracks after the scan: the old ones, updated, then new ones."""
    assigned: Sequence[Array]
    """Track of each measurement of each sensor, 0 for none, int64 (n_s,)."""
    method_state: Any = None
    """The method's own part of the state after the scan."""


class Work:
    """New ids and calls of the solver in a step, counted on from the state before it, and the gap that is left."""

    def __init__(self, settings: TrackerSettings, state: TrackerState) -> None:
        self.settings, self.scan = settings, state.scan
        self.next_id, self.solver_calls = state.next_id, state.solver_calls
        self.gap = 0.0

    def new_ids(self, count: int) -> Array:
        """Ids that no track has had, int64 (count,)."""
        ids = np.arange(self.next_id, self.next_id + count)
        self.next_id += count
        return ids

    def assign(self, problem: AssignmentProblem, effort: float = 1.0) -> Solution:
        """Solve an assignment problem with the tracker's solver; `effort` is a share of the default limits."""
        self.solver_calls += 1
        # seeded by scan and call, so that a restored tracker continues identically
        seed = np.random.SeedSequence((self.settings.seed, self.scan))
        options = solver_options(self.settings, problem.num_tuples, effort)
        solution = assign(problem, self.settings.solver, seed=seed, advise=False, **options)
        if solution.status != "optimal":
            self.leave(solution.gap / max(1.0, abs(solution.cost)))
        return solution

    def leave(self, gap: float) -> None:
        """Note a relative gap that is left."""
        self.gap = max(self.gap, gap)


def solver_options(settings: TrackerSettings, tuples: int, effort: float = 1.0) -> dict[str, Any]:
    """Time limit and parameters of the solver for a problem with this many tuples."""
    options = {"time_limit": settings.time_limit, **settings.solver_parameters}
    if settings.solver == "exact" and settings.time_limit is None:
        nodes = int(effort * max(_LEAST_NODES, _VISITS // max(tuples, 1)))
        options = {"nodes": max(nodes, 1), "patience": 0, "gap": _GAP} | options
    return options


class Gathered(NamedTuple):
    """Plots of targets with an extent, put together; see `assoc.tracking.stages.extents`."""

    ids: Array
    """Tracks of E targets, int64 (E,)."""
    groups: tuple[Array, ...]
    """Of each plot of each sensor: the row of its target, -1 for none; int (n_s,)."""
    numbers: tuple[Array, ...]
    """Its number (from 0) in the scan in which they are put together; int (n_s,)."""
    scan: Scan
    """The scan plot by plot."""
    wider: Array
    """By what covariances are larger than after updates with the sensors' noise, (E, n, n)."""


class Progress(NamedTuple):
    """A step under way."""

    settings: TrackerSettings
    state: TrackerState
    """The state after the stages so far; its time is that of the last scan until the last stage."""
    scan: Scan
    work: Work
    timed: TimedScan | None = None
    """Set for measurements with times of their own; None if all sensors covered everything at one instant."""
    before: TrackBatch | None = None
    """The tracks that association began with, of a tracker that adapts."""
    late: TrackBatch | None = None
    """Those of them that may be of targets, predicted to the scan."""
    placed: Array | None = None
    """Whether each sensor expects these where false alarms are denser than usual, bool (T, S)."""
    dense: Sequence[Array] = ()
    """Whether false alarms are denser than usual at each measurement, of a tracker that adapts; bool (n_s,) each."""
    crowds: tuple[Array, ...] = ()
    """Logarithms of the densities there, whether they are in use or not."""
    clutter: ClutterMap | None = None
    """The map of false alarms as it is after the scan."""
    gathered: Gathered | None = None
    """Plots of targets with an extent."""
    shared: Shared | None = None
    """Tracks that may be unresolved in this scan; see `assoc.tracking.stages.unresolved`."""
    association: Association | None = None
    step: Step | None = None

    def with_state(self, **changes: Any) -> Progress:
        """Return the step with a changed state."""
        return self._replace(state=self.state._replace(**changes))

    @property
    def elapsed(self) -> float:
        """Seconds since the last scan."""
        return 0.0 if self.state.time is None else self.scan.time - self.state.time
