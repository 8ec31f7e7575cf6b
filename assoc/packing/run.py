"""A solver's run and its outcome: the inputs besides the problem, and the results."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from threading import get_ident
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from assoc._parameters import Parameters
from assoc._system import memory
from assoc._system.compile_time import compile_seconds
from assoc._system.interrupts import end_is_asked
from assoc.errors import InfeasibleError
from assoc.solution import TracePoint

if TYPE_CHECKING:
    from assoc.packing.packing import Packing

Callback = Callable[[TracePoint], object]

# most points of a trace
_TRACE = 100_000
# seconds after which a risen bound gets a point
_NEWS = 0.5
FIRST_NODES = 20_000
"""Nodes of a search for a first solution of a component: some minutes on the hardest seen."""


class TreeSearch(Protocol):
    """A branch and bound that can be stopped and continued: `assoc.packing.branching.search.BranchAndBound`."""

    weight: float
    nodes: int
    columns: NDArray[np.int32] | None

    @property
    def done(self) -> bool:
        """Whether nothing is left to search."""
        ...

    @property
    def lower_bound(self) -> float:
        """A lower bound on all solutions."""
        ...

    @property
    def out_of_memory(self) -> bool:
        """Whether the search ended for want of memory."""
        ...

    def run(self, nodes: int) -> object:
        """Search some nodes."""
        ...


class Improver(Protocol):
    """A search at work on one component, whose best cover it improves."""

    def iterate(self) -> None:
        """Do one iteration."""
        ...


@dataclass(frozen=True)
class Methods:
    """Exact methods that a search may use beside itself; it does without those that are None.

    `assign` hands them in (`assoc.solvers.methods`), so that a metaheuristic can be read, and measured, alone.
    """

    first_solution: Callable[[Packing, Run], NDArray[np.int32] | None] | None = None
    """The last resort of what must cover rows: the columns of any solution."""
    tree_search: Callable[..., TreeSearch] | None = None
    """Branch and bound, called as `BranchAndBound` is: it raises bounds, and ends where it proves the cover."""
    bound_by_linear_program: Callable[[Any, Run], None] | None = None
    """Raises the bound of a `Priced` to that of the linear program."""
    diver: Any = None
    """The class of what builds covers in the linear program (`Diver`)."""
    clusters: Any = None
    """The class of what improves covers by exact sub-steps (`ClusterSearch`)."""
    improver: Callable[[Any, Run], Improver] | None = None
    """Makes what improves the incumbent of a `Component` between turns of branching."""


def never() -> float:
    """Return the deadline of a search without a run."""
    return math.inf


def memory_allows(needed: float) -> bool:
    """Whether there is memory for ``needed`` bytes more, for a search without a run."""
    return memory.fits(needed)


@dataclass(slots=True)
class Run:
    """One call of a solver: its random generator, its clock, and its trace.

    Attributes
    ----------
    seed : int, SeedSequence or Generator
        Seed of ``rng``.
    offset : float
        Packing weight plus offset is the problem's cost (the offset is the cost of all singletons).
    unit : float
        A packing weight of 1 in the problem's unit, which the trace uses.
    trace_ceiling : float
        The trace has ``inf`` for this cost and more: some costs were lowered (`assoc.packing.prepare.CappedCosts`).
    time_limit : float or None
        Seconds from ``started``; those spent compiling do not count.
    callback : callable or None
        Called with each TracePoint; a true result stops the solver.
    reserve : float
        Searches end this many seconds before the limit: passes over all columns follow them (fallback.py).
    fallback : int array or None
        The greedy choice of columns, if it was made first (fallback.py).
    start : int array or None
        Columns of a known solution; the result costs no more, and solvers begin with it where they can.
    watch : callable or None
        Called after each iteration by solvers with a state to show: `aco` passes its ``Cycle``.
    compiled : float
        Seconds that the thread of the run had spent compiling before it.
    thread : int
        The thread that began the run.
    methods : Methods
        Exact methods that a search may use beside itself.
    gains : dict
        Moves that lowered the weight of the best solution, and by how much in all.
    """

    seed: int | np.random.SeedSequence | np.random.Generator
    offset: float = 0.0
    unit: float = 1.0
    trace_ceiling: float = math.inf
    time_limit: float | None = None
    callback: Callback | None = None
    watch: Callable[[Any], object] | None = None
    started: float = field(default_factory=time.perf_counter)
    trace: list[TracePoint] = field(default_factory=list)
    stopped_by: str = ""
    reserve: float = 0.0
    fallback: NDArray[np.integer] | None = None
    start: NDArray[np.integer] | None = None
    compiled: float = field(default_factory=compile_seconds)
    thread: int = field(default_factory=get_ident)
    methods: Methods = Methods()
    gains: dict[str, float] = field(default_factory=dict)
    _rng: np.random.Generator | None = None

    @property
    def rng(self) -> np.random.Generator:
        """The only source of randomness; created on first use, which on easy problems is never."""
        if self._rng is None:
            # numba is loaded where something is solved
            from assoc._system.compiled import draws

            self._rng = draws(np.random.default_rng(self.seed))
        return self._rng

    def part(self, seed: np.random.Generator | int, time_limit: float | None) -> Run:
        """Return a run with the same clock, for a part of the work."""
        run = Run(seed, time_limit=time_limit, started=self.started, compiled=self.compiled, thread=self.thread)
        run.methods = self.methods
        return run

    def compile_time(self) -> float:
        """Seconds since the start spent compiling kernels, or loading kernels and the solver's modules."""
        return compile_seconds(self.thread) - self.compiled

    def runtime(self) -> float:
        """Seconds since the start without those, as results report them; the time limit applies to these."""
        return time.perf_counter() - self.started - self.compile_time()

    def remaining(self) -> float:
        """Seconds left for a search; infinite without a time limit."""
        return np.inf if self.time_limit is None else self.time_limit - self.reserve - self.runtime()

    def deadline(self, share: float = 1.0) -> float:
        """The end of a share of the time left, for kernels, in seconds of `time.monotonic`; infinite: no limit."""
        return np.inf if self.time_limit is None else time.monotonic() + share * self.remaining()

    def should_stop(self) -> bool:
        """Whether time is over, or the callback or the user asked to stop; sets ``stopped_by``."""
        if not self.stopped_by and self.remaining() <= 0.0:
            self.stopped_by = "time_limit"
        elif not self.stopped_by and end_is_asked():
            self.stopped_by = "interrupted"
        return bool(self.stopped_by)

    def memory_allows(self, needed: float) -> bool:
        """Whether a search may allocate ``needed`` bytes more; for searches that can do without."""
        return memory_allows(needed)

    def note_gain(self, move: str, gain: float) -> None:
        """Add what a move has gained to the gains."""
        if 0.0 < gain < math.inf:
            self.gains[move] = self.gains.get(move, 0.0) + gain

    def is_silent(self) -> bool:
        """Whether the trace has had no new point for so long that a search should add one."""
        return not self.trace or self.runtime() - self.trace[-1].seconds > _NEWS

    def record(self, iteration: int, weight: float, bound: float) -> None:
        """Add a point to the trace; weight and bound are those of the packing, without the offset."""
        cost, lower_bound = (weight + self.offset) * self.unit, (bound + self.offset) * self.unit
        point = TracePoint(iteration, self.runtime(), cost if cost < self.trace_ceiling else math.inf, lower_bound)
        self.trace.append(point)
        if len(self.trace) > _TRACE:
            # for a search that improves for days every second point is enough; the first and the last stay
            self.trace[1:-1] = self.trace[2:-1:2]
        if self.callback is not None and self.callback(point):
            self.stopped_by = self.stopped_by or "callback"


@dataclass(frozen=True, slots=True)
class Outcome:
    """The result of a solver.

    Attributes
    ----------
    columns : int array
        Chosen columns of the packing.
    iterations : int
        Iterations used.
    lower_bound : float
        A lower bound on the packing's optimum, proved by this package, for example by branch and bound. Bounds of
        external solvers are not accepted.
    duals : float array or None
        Multipliers of the packing's rows. Without a lower bound (-inf) it is computed from these; with one they prove
        it, or are None.
    """

    columns: NDArray[np.integer]
    iterations: int
    lower_bound: float = -np.inf
    duals: NDArray[np.float64] | None = None


SolveFunction = Callable[["Packing", "Parameters", Run], Outcome]


_LEAVING = "; of a matrix, from_matrix(costs, unassigned=inf) leaves what it must"


def infeasible(packing: Packing, run: Run | None = None) -> InfeasibleError:
    """Return the error for a problem without dummies in which no solution was found (in the time of a run)."""
    uncovered = int((~packing.slack & (np.diff(packing.row_ptr) == 0)).sum())
    if uncovered:
        return InfeasibleError(f"{uncovered} measurement(s) that must be used are in no tuple{_LEAVING}")
    if run is not None and run.stopped_by == "iterations":
        nodes = f"{FIRST_NODES:,} nodes"
        return InfeasibleError(f"no complete solution was found in {nodes}; solver exact searches to the end")
    if run is not None and run.should_stop():
        return InfeasibleError("no complete solution was found in the time limit")
    return InfeasibleError(f"no choice of tuples uses every index of the smallest dimension exactly once{_LEAVING}")
