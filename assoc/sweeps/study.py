"""A study: settings, sources and repeats; results are saved, and only missing runs are run."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from assoc._parameters import checked_time_limit, is_whole, whole_seed
from assoc._system.cluster import LostError
from assoc._system.engine import parallel_map
from assoc._system.wrong_types import explains_wrong_types
from assoc._text.shown import Shown
from assoc._version import __version__
from assoc.errors import InvalidInputError, LimitExceededError
from assoc.sweeps.design import Setting
from assoc.sweeps.sources import study_sources
from assoc.sweeps.store import COLUMNS, KEPT, Manifest, RunKey, Store
from assoc.sweeps.worker import Job, RunNumbers, code_digest, run_batch

Progress = Callable[["Counts"], object]

# runs of a batch
_MOST_RUNS = 2000


@dataclass
class Counts:
    """Progress of a study, in runs of the design."""

    total: int
    before: int
    """Runs that were saved before, or meanwhile by another process."""
    new: int = 0
    """Runs done since the start."""
    solving: float = 0.0
    """Total seconds of the new runs in the solvers."""

    @property
    def done(self) -> int:
        """Number of runs of the design that are done."""
        return self.before + self.new


@explains_wrong_types
@dataclass(frozen=True, repr=False)
class Study(Shown):
    """Settings to run on scenes and problems.

    Parameters
    ----------
    sources : Scene, AssignmentProblem, or sequence of them
        Each scan is a run of its own. Sources with a name (`StudySource`) keep it.
    settings : Setting or sequence of Setting
        Settings, for example from `grid`.
    repeats : int, or range
        Number of runs of each setting on each scan, each with its own seed; or the numbers of these runs.
    seed : int or None, default 0
        All seeds derive from it and from what is run; None: a random seed.
    time_limit : float, optional
        Seconds for each run.
    gating : mapping
        Options of ``assoc.build_problem``.
    scans : sequence of range, optional
        Scans of each source; by default all.
    cpu_limit : float, optional
        Seconds of processor time for each run: what runs find does not depend on what else the machine does.

    Raises
    ------
    InvalidInputError
        There are no settings or no sources, or numbers are out of range.
    """

    sources: Any
    settings: Any
    repeats: int | range = 1
    seed: int | None = 0
    time_limit: float | None = None
    gating: Mapping[str, Any] = field(default_factory=dict)
    scans: Sequence[Sequence[int]] | None = None
    cpu_limit: float | None = None

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "settings", _settings(self.settings))
        put(self, "sources", study_sources(self.sources))
        put(self, "seed", whole_seed(self.seed))
        if not isinstance(self.repeats, range):
            if not is_whole(self.repeats, 1):
                raise InvalidInputError(f"repeats: expected a whole number >= 1, got {self.repeats!r}")
            put(self, "repeats", range(self.repeats))
        for name in ("time_limit", "cpu_limit"):
            limit = checked_time_limit(getattr(self, name), name)
            put(self, name, None if limit == math.inf else limit)
        if self.cpu_limit is not None and any(setting.solver == "milp" for setting in self.settings):
            raise InvalidInputError("cpu_limit: milp cannot be stopped by its processor time, only by time_limit")
        if self.scans is None:
            put(self, "scans", [range(source.num_scans) for source in self.sources])
        if not all(isinstance(scans, Sequence) and all(map(is_whole, scans)) for scans in self.scans or ()):
            raise InvalidInputError("scans: expected the numbers of the scans of each source, as ranges")
        if not isinstance(self.gating, Mapping):
            raise InvalidInputError(f"gating: expected a mapping, got {type(self.gating).__name__}")

    def __repr__(self) -> str:
        return f"Study({len(self.settings)} settings, {len(self.sources)} sources, {self.size} runs)"

    @property
    def manifest(self) -> Manifest:
        """The manifest that a folder must have to hold this study."""
        names = {source.fingerprint: source.name for source in self.sources}
        limits = self.time_limit, self.cpu_limit
        return Manifest(__version__, whole_seed(self.seed), names, *limits, dict(self.gating), code_digest())

    @property
    def size(self) -> int:
        """Number of runs."""
        assert self.scans is not None and isinstance(self.repeats, range)
        return len(self.settings) * len(self.repeats) * sum(map(len, self.scans))

    def all_runs(self) -> Iterator[RunNumbers]:
        """All runs as (setting, source, repeat, scan): all settings before the next repeat."""
        assert self.scans is not None and isinstance(self.repeats, range)
        # loops, because itertools.product would first list all repeats, however many
        for repeat in self.repeats:
            for source, scans in enumerate(self.scans):
                for setting in self.settings:
                    for scan in scans:
                        yield setting, source, repeat, scan

    def key(self, run: RunNumbers) -> RunKey:
        """Key of a run."""
        return run[0].key, self.sources[run[1]].fingerprint, run[2], run[3]

    def run(
        self,
        folder: str | os.PathLike[str] | Store,
        *,
        jobs: int = 1,
        scheduler: str | None = None,
        progress: Progress | None = None,
        batch_seconds: float | None = None,
    ) -> Counts:
        """Run what is missing, and save every result at once.

        Results are the same on every backend and with any number of workers; only times differ.

        Parameters
        ----------
        folder : path-like
            Created if missing; a study in it is continued if it is this one (the design may have changed). Or an open
            `Store`, which stays open.
        jobs : int, default 1
            Number of processes on this machine.
        scheduler : str, optional
            Address of a dask scheduler, whose workers then do the runs.
        progress : callable, optional
            Called with the `Counts` at the start and after each batch.
        batch_seconds : float, optional
            About how long a process works on what it is sent at once; by default 0.2 s, on a cluster 0.5 s.

        Returns
        -------
        Counts

        Raises
        ------
        InvalidInputError
            The folder holds something else or is not writable, or the scheduler does not answer.
        """
        with nullcontext(folder) if isinstance(folder, Store) else Store(folder, self.manifest) as store:
            done = store.done()
            missing = sum(self.key(run) not in done for run in self.all_runs())
            counts = Counts(self.size, self.size - missing)
            if progress is not None:
                progress(counts)
            if missing == 0:
                return counts
            left = (run for run in self.all_runs() if self.key(run) not in done)
            batches = Batches(left, batch_seconds or (0.2 if scheduler is None else 0.5))
            work = partial(run_batch, Job(tuple(self.sources), self.manifest))
            results = parallel_map(work, batches, jobs=jobs, scheduler=scheduler, ordered=False)
            try:
                for batch, rows, seconds in results:
                    settings = {one.key: (one.key, one.solver, one.parameters) for one, *_ in batch}
                    new = store.append(settings.values(), rows)
                    counts.new += new
                    # the others were done by another process meanwhile
                    counts.before += len(rows) - new
                    counts.solving += sum(row[COLUMNS.index("time")] or 0.0 for row in rows)
                    batches.learn(batch, seconds)
                    if progress is not None:
                        progress(counts)
            except (LimitExceededError, LostError) as error:
                raise type(error)(f"{error}; {KEPT}") from None
            finally:
                results.close()
        return counts


class Batches:
    """Runs in batches of about so many seconds; results tell how long runs take."""

    def __init__(self, runs: Iterator[RunNumbers], seconds: float) -> None:
        self._runs = runs
        self._seconds = seconds
        # seconds of a run by the key of its setting, and by its solver
        self._taken: dict[str, float] = {}

    def __iter__(self) -> Iterator[list[RunNumbers]]:
        return self

    def __next__(self) -> list[RunNumbers]:
        batch: list[RunNumbers] = []
        expected = 0.0
        while len(batch) < _MOST_RUNS and expected < self._seconds and (run := next(self._runs, None)):
            batch.append(run)
            of_solver = self._taken.get(run[0].solver, self._seconds / 8)
            expected += self._taken.get(run[0].key, of_solver)
        if not batch:
            raise StopIteration
        return batch

    def learn(self, batch: list[RunNumbers], seconds: float) -> None:
        """Learn from the time that a batch took."""
        for setting, *_ in batch:
            self._taken[setting.key] = self._taken[setting.solver] = seconds / len(batch)


def _settings(given: Any) -> tuple[Setting, ...]:
    """All settings without duplicates."""
    found = tuple(dict.fromkeys([given] if isinstance(given, Setting) else given))
    if not all(isinstance(setting, Setting) for setting in found):
        raise InvalidInputError("settings: expected settings as from grid")
    if not found:
        raise InvalidInputError("the design is empty: no settings to run")
    return found
