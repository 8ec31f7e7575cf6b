"""A worker's task: a batch of runs, each with its own seed; scenes are sent to it once."""

from __future__ import annotations

import threading
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from assoc._system.compiled import loaded, with_foreign_kernels
from assoc._version import __version__
from assoc.errors import InfeasibleError, InvalidInputError
from assoc.sweeps.code_digest import code_digest
from assoc.sweeps.setting import Setting
from assoc.sweeps.sources import StudySource
from assoc.sweeps.store import COLUMNS, Manifest

if TYPE_CHECKING:
    from assoc.problem import AssignmentProblem
    from assoc.solution import Solution

TRACE_POINTS = 16
_CACHED_TUPLES = 10_000_000
_WARM_UP_SECONDS = 1.0
_ATTEMPTS = 4

Tuples = set[tuple[int, ...]]


@dataclass(frozen=True)
class Batch:
    """Some runs: setting and source as indices into the batch's settings and the job's sources, repeat, scan."""

    settings: tuple[Setting, ...]
    runs: list[tuple[int, int, int, int]]


@dataclass(frozen=True)
class Result:
    """The results of a batch: its rows (`store.COLUMNS`), and the seconds that the batch took."""

    batch: Batch
    rows: list[tuple[Any, ...]]
    seconds: float

    def times(self) -> list[float]:
        """Seconds of each run in the solver."""
        return [row[COLUMNS.index("time")] or 0.0 for row in self.rows]


@dataclass(frozen=True)
class Job:
    """Data that all runs share; a worker gets it once."""

    sources: tuple[StudySource, ...]
    manifest: Manifest
    """Seed, limits and gating; a worker's version and code of assoc must be those in it."""
    _problems: OrderedDict[tuple[int, int], tuple[AssignmentProblem, Tuples | None]] = field(
        default_factory=OrderedDict, compare=False
    )
    _held: list[int] = field(default_factory=lambda: [0], compare=False)
    _warm: set[Any] = field(default_factory=set, compare=False)
    _busy: Any = field(default_factory=threading.Lock, compare=False)

    def __reduce__(self) -> Any:
        # without the cache of this process
        return Job, (self.sources, self.manifest)

    def problem(self, source: int, scan: int) -> tuple[AssignmentProblem, Tuples | None]:
        """Return a problem and its true tuples (None if they are unknown); recent ones are cached."""
        key = (source, scan)
        with self._busy:
            if key in self._problems:
                self._problems.move_to_end(key)
                return self._problems[key]
        made = self._make(source, scan)
        with self._busy:
            if key not in self._problems:
                self._problems[key] = made
                self._held[0] += made[0].num_tuples
            while len(self._problems) > 1 and self._held[0] > _CACHED_TUPLES:
                self._held[0] -= self._problems.popitem(last=False)[1][0].num_tuples
        return made

    def _make(self, source: int, scan: int) -> tuple[AssignmentProblem, Tuples | None]:
        from assoc.costs import build_problem
        from assoc.packing.prepare import prepare
        from assoc.problem import AssignmentProblem

        content = self.sources[source].content
        if isinstance(content, AssignmentProblem):
            prepare(content)
            return content, None
        measured = content.scan(scan)
        problem, truth = build_problem(content, measured, **self.manifest.gating), measured.true_tuples()
        # runs share the problem: its preparation must not count as time of the first run
        prepare(problem)
        return problem, None if truth is None else {*map(tuple, truth.tolist())}

    def seed_of(self, setting: Setting, source: int, repeat: int, scan: int) -> int:
        """Seed of a run; it depends on what is run, not on where or when."""
        words = (*setting.words, int(self.sources[source].fingerprint[:8], 16), repeat, scan)
        sequence = np.random.SeedSequence(self.manifest.seed, spawn_key=words)
        return int(sequence.generate_state(1, np.uint64)[0] >> np.uint64(1))

    def warm_up(self, setting: Setting, problem: AssignmentProblem) -> None:
        """Load most of the code that a family of settings needs, on its first problem, for at most a second."""
        from assoc.solvers.assign import assign

        if setting.family in self._warm:
            return
        limit = min(_WARM_UP_SECONDS, self.manifest.time_limit or _WARM_UP_SECONDS)
        try:
            assign(problem, setting.solver, time_limit=limit, **setting.parameters)
        except InfeasibleError:
            pass
        self._warm.add(setting.family)

    def _stop(self, setting: Setting) -> Callable[[object], bool] | None:
        """What stops a run that has had its processor time: after a point of its trace, about twice a second."""
        limit = self.manifest.cpu_limit
        if limit is None:
            return None
        clock = time.process_time if setting.parameters.get("workers", 1) != 1 else time.thread_time
        end = clock() + limit
        return lambda point: clock() >= end

    def solve(self, setting: Setting, problem: AssignmentProblem, seed: int) -> Solution:
        """Solve a problem, with the solver's time alone.

        A run during which code was compiled or loaded, or a module imported, is repeated: warming up on some
        problems may miss code that a later one needs.
        """
        from assoc.solvers.assign import assign

        self.warm_up(setting, problem)
        with with_foreign_kernels():
            for _ in range(_ATTEMPTS):
                before = loaded()
                limit, stop = self.manifest.time_limit, self._stop(setting)
                solution = assign(
                    problem, setting.solver, seed=seed, time_limit=limit, callback=stop, **setting.parameters
                )
                if loaded() == before:
                    break
        return solution


def run_batch(job: Job, batch: Batch) -> Result:
    """Do the runs of a batch one after the other; refused by a worker with another version of assoc."""
    started = time.perf_counter()
    if __version__ != job.manifest.assoc:
        raise InvalidInputError(f"a worker has version {__version__} of assoc, this is {job.manifest.assoc}")
    if code_digest() != job.manifest.code:
        raise InvalidInputError("a worker has other code of assoc than this process, with the same version")
    rows = [_row(job, batch.settings[run[0]], *run[1:]) for run in batch.runs]
    return Result(batch, rows, time.perf_counter() - started)


def _row(job: Job, setting: Setting, source: int, repeat: int, scan: int) -> tuple[Any, ...]:
    problem, truth = job.problem(source, scan)
    seed = job.seed_of(setting, source, repeat, scan)
    head = (setting.key, job.sources[source].fingerprint, repeat, scan, seed)
    number = None if truth is None else len(truth)
    try:
        solution = job.solve(setting, problem, seed)
    except InfeasibleError:
        return (*head, None, None, None, None, "infeasible", number, None, b"")
    except InvalidInputError as error:
        raise InvalidInputError(f"{setting.solver} {dict(setting.parameters)}: {error}") from None
    correct = None if truth is None else len(truth.intersection(map(tuple, solution.tuples.tolist())))
    bound = solution.lower_bound if np.isfinite(solution.lower_bound) else None
    return (
        *head,
        float(solution.cost),
        None if bound is None else float(bound),
        int(solution.iterations),
        round(solution.runtime, 9),
        # nothing else asks a run to stop
        "cpu_limit" if solution.stopped_by == "callback" else solution.stopped_by,
        number,
        correct,
        _thinned(solution),
    )


def _thinned(solution: Solution) -> bytes:
    """Iteration, seconds and cost at some improvements, among them the first and the last."""
    points: list[tuple[float, float, float]] = []
    for point in solution.trace:
        if np.isfinite(point.cost) and (not points or point.cost < points[-1][2]):
            points.append((point.iteration, round(point.seconds, 6), point.cost))
    if not points:
        return b""
    kept = np.unique(np.linspace(0, len(points) - 1, TRACE_POINTS).round().astype(int))
    return np.array(points, dtype="<f8")[kept].tobytes()
