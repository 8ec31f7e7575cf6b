"""A worker's task: a batch of runs, each with its own seed; scenes are sent to it once."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from assoc._system.compiled import loaded, with_foreign_kernels
from assoc._version import __version__
from assoc.errors import InfeasibleError, InvalidInputError
from assoc.sweeps.design import Setting
from assoc.sweeps.sources import StudySource
from assoc.sweeps.store import Manifest

if TYPE_CHECKING:
    from assoc.problem import AssignmentProblem
    from assoc.solution import Solution

RunNumbers = tuple[Setting, int, int, int]
"""Setting, source by its index, repeat, scan."""

TRACE_POINTS = 16
_CACHED_TUPLES = 10_000_000
_ATTEMPTS = 4
# rooms whose code results depend on
_ROOMS = ("costs", "sensors", "packing", "solvers", "ranking")

Known = tuple["AssignmentProblem", set[tuple[int, ...]] | None]
"""A problem and its true tuples, None if they are unknown."""


@cache
def code_digest() -> str:
    """Sixteen hexadecimal digits of the digest of the source files of solvers and costs; empty if there are none.

    It changes during development, when the version does not.
    """
    package = Path(__file__).resolve().parent.parent
    files = sorted(path for room in _ROOMS for path in (package / room).rglob("*.py"))
    digest = hashlib.sha256()
    for path in files:
        content = path.read_bytes()
        digest.update(f"{path.relative_to(package).as_posix()} {len(content)}\n".encode() + content)
    return digest.hexdigest()[:16] if files else ""


@dataclass(frozen=True)
class Job:
    """Data that all runs share; a worker gets it once."""

    sources: tuple[StudySource, ...]
    manifest: Manifest
    """Seed, limits and gating; a worker's version and code of assoc must be those in it."""
    _problems: dict[tuple[int, int], Known] = field(default_factory=dict, compare=False)

    def __reduce__(self) -> Any:
        # without the problems of this process
        return Job, (self.sources, self.manifest)

    def problem(self, source: int, scan: int) -> Known:
        """Return a problem and its true tuples; recent ones are kept."""
        key = (source, scan)
        made = self._problems.pop(key, None) or self._make(source, scan)
        self._problems[key] = made
        while len(self._problems) > 1 and sum(p.num_tuples for p, _ in [*self._problems.values()]) > _CACHED_TUPLES:
            self._problems.pop([*self._problems][0], None)
        return made

    def _make(self, source: int, scan: int) -> Known:
        from assoc.costs import build_problem
        from assoc.packing.prepare import prepare
        from assoc.problem import AssignmentProblem

        content, truth = self.sources[source].content, None
        if isinstance(content, AssignmentProblem):
            problem = content
        else:
            measured = content.scan(scan)
            problem, truth = build_problem(content, measured, **self.manifest.gating), measured.true_tuples()
        # runs share the problem: its preparation must not count as time of the first run
        prepare(problem)
        return problem, None if truth is None else {*map(tuple, truth.tolist())}

    def seed_of(self, setting: Setting, source: int, repeat: int, scan: int) -> int:
        """Seed of a run; it depends on what is run, not on where or when."""
        words = (int(setting.key[:8], 16), int(setting.key[8:], 16), int(self.sources[source].fingerprint[:8], 16))
        sequence = np.random.SeedSequence(self.manifest.seed, spawn_key=(*words, repeat, scan))
        return int(sequence.generate_state(1, np.uint64)[0] >> np.uint64(1))

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

        A run during which code was compiled or loaded, or a module imported, is repeated.
        """
        from assoc.solvers.assign import assign

        limit = self.manifest.time_limit
        with with_foreign_kernels():
            for _ in range(_ATTEMPTS):
                before, stop = loaded(), self._stop(setting)
                solution = assign(
                    problem, setting.solver, seed=seed, time_limit=limit, callback=stop, **setting.parameters
                )
                if loaded() == before:
                    break
        return solution


def run_batch(job: Job, batch: list[RunNumbers]) -> tuple[list[RunNumbers], list[tuple[Any, ...]], float]:
    """Do runs one after the other; returns them, their rows (`store.COLUMNS`) and the seconds that all took.

    InvalidInputError: this worker has another version of assoc, or other code.
    """
    started = time.perf_counter()
    if __version__ != job.manifest.assoc:
        raise InvalidInputError(f"a worker has version {__version__} of assoc, this is {job.manifest.assoc}")
    if code_digest() != job.manifest.code:
        raise InvalidInputError("a worker has other code of assoc than this process, with the same version")
    rows = [_row(job, *run) for run in batch]
    return batch, rows, time.perf_counter() - started


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
    return (
        *head,
        float(solution.cost),
        float(solution.lower_bound) if np.isfinite(solution.lower_bound) else None,
        int(solution.iterations),
        round(solution.runtime, 9),
        # nothing else asks a run to stop
        "cpu_limit" if solution.stopped_by == "callback" else solution.stopped_by,
        number,
        None if truth is None else len(truth.intersection(map(tuple, solution.tuples.tolist()))),
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
