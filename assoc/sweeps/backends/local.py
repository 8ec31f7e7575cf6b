"""Batches run on this machine: in this process, or by joblib in several."""

from __future__ import annotations

import hashlib
import os
import pickle
import signal
import threading
import uuid
from collections.abc import Generator, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from assoc._files.reading import open_regular
from assoc._system import temporary
from assoc._system.processes import (
    end_with_parent,
    forget_safe_path,
    not_sent,
    require_processes,
    safe_path,
    signals_as_they_are,
)
from assoc.errors import InvalidInputError
from assoc.sweeps.worker import Batch, Job, Result, run_batch

SECONDS_OF_A_BATCH = 0.2
_JOB = ".job-"


def run_here(job: Job, batches: Iterable[Batch]) -> Generator[Result]:
    """Run batches one after the other in this process."""
    for batch in batches:
        yield run_batch(job, batch)


def run_with_joblib(job: Job, batches: Iterable[Batch], jobs: int, folder: Path) -> Generator[Result]:
    """Run batches in processes, and yield results as they arrive.

    Data that all runs share are in a file in the study's folder, which each process reads once; a task holds only
    its batch.

    Raises
    ------
    InvalidInputError
        A process was killed (by a lack of memory, for example), or a run raised this itself.
    """
    from joblib import Parallel, delayed
    from joblib.externals.loky.process_executor import BrokenProcessPool

    # joblib starts a new process where one was idle for long
    with _shared(job, folder) as (path, digest), safe_path():
        require_processes(jobs)
        parallel = Parallel(n_jobs=jobs, return_as="generator_unordered", batch_size=1, pre_dispatch=2 * jobs)
        try:
            with signals_as_they_are(), _interrupts_ignored():
                # this call starts the processes, which inherit it; Ctrl-C reaches the whole group
                results = parallel(delayed(run_in_process)(str(path), digest, os.getpid(), batch) for batch in batches)
            yield from results
        except BrokenProcessPool:
            raise InvalidInputError(
                "--jobs: a worker process was killed (is the memory used up?); fewer jobs need less; "
                "finished runs are kept, and the same command goes on from there"
            ) from None
        except pickle.PicklingError as error:
            raise not_sent(error.__cause__ or error) from None
        finally:
            stop_workers()


@contextmanager
def _shared(job: Job, folder: Path) -> Iterator[tuple[Path, str]]:
    """A file of the job, and its digest, in the study's folder, which only one sweep at a time has open."""
    # left by a sweep that was killed together with its workers
    for stale in folder.glob(_JOB + "*"):
        stale.unlink(missing_ok=True)
    path = folder / f"{_JOB}{uuid.uuid4().hex}"
    content = pickle.dumps(job)
    temporary.add(str(path))
    try:
        try:
            path.write_bytes(content)
        except OSError as error:
            raise InvalidInputError(f"{path}: cannot be written ({error.strerror or error})") from None
        yield path, content_digest(content)
    finally:
        temporary.remove(str(path))


@contextmanager
def _interrupts_ignored() -> Iterator[None]:
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def stop_workers() -> None:
    """End the worker processes now."""
    from joblib.externals.loky import reusable_executor

    executor = reusable_executor._executor
    if executor is not None:
        executor.shutdown(wait=True, kill_workers=True)


_job: tuple[str, Job] | None = None


def run_in_process(path: str, digest: str, parent: int, batch: Batch) -> Result:
    """Run a batch in a worker process; it reads the job from the file ``path`` once."""
    global _job
    if _job is None or _job[0] != path:
        forget_safe_path()
        end_with_parent(parent, path)
        with open_regular(path) as file:
            content = file.read()
        # other users may have write access to the study's folder, and a pickle can run any code
        if content_digest(content) != digest:
            raise InvalidInputError(f"{path}: was changed by someone else")
        _job = path, pickle.loads(content)
    return run_batch(_job[1], batch)


def content_digest(content: bytes) -> str:
    """Return the digest by which a worker recognises the job file of its sweep."""
    return hashlib.sha256(content).hexdigest()
