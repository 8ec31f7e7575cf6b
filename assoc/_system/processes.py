"""Work spread over processes: results in order, and no process left running after an interruption."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from typing import Any

from assoc._system import memory, temporary
from assoc._system.first_import import path_without
from assoc.errors import InvalidInputError, LimitExceededError

# bytes of a process with numpy, scipy and compiled kernels, and a small task
_PROCESS = 100e6

_task: Callable[[Any], Any] | None = None
_problem = ""


def require_processes(jobs: int) -> None:
    """Refuse more processes than there is memory for."""
    memory.require(_PROCESS * jobs, f"jobs: {jobs} processes", "take fewer", own=False)


def not_sent(reason: object) -> InvalidInputError:
    """Return the error of a task that other processes cannot get, with its reason."""
    return InvalidInputError(
        "jobs: other processes take only what is at the top level of a module that they can import; define your own "
        f"solver or function there ({reason})"
    )


def ordered_map(task: Callable[[Any], Any], items: Sequence[Any], jobs: int) -> Iterator[Any]:
    """Yield ``task(item)`` for each item, in order.

    Parameters
    ----------
    task : callable
        Sent once to each process, so it may hold what all items share; must be picklable if jobs > 1.
    items : sequence
        Small and picklable.
    jobs : int
        Number of processes; 1 works in this one. They are spawned: forking would copy the threads' locks.

    Raises
    ------
    LimitExceededError
        A process died, or there is no memory for so many.
    InvalidInputError
        The folder for temporary files is full, or there is none.
    """
    jobs = min(jobs, len(items))
    if jobs <= 1:
        for item in items:
            yield task(item)
        return
    require_processes(jobs)
    before = set(multiprocessing.active_children())
    context = multiprocessing.get_context("spawn")
    path = _written(task)
    with safe_path():
        executor = ProcessPoolExecutor(jobs, mp_context=context, initializer=_start, initargs=(path, os.getpid()))
    # all at once at the start: the executor loses count when one dies while it starts another on demand
    executor._safe_to_dynamically_spawn_children = False  # type: ignore[attr-defined]
    try:
        # a signal is heard when all are there: one that is half started could not be ended
        with signals_as_they_are(), safe_path(), ThreadPoolExecutor(1) as starter:
            waiting = starter.submit(_submit, executor, items).result()
        for future in waiting:
            yield future.result()
    except BrokenProcessPool:
        # those that the executor did not know yet when one died
        _end(before)
        raise LimitExceededError(
            "a worker process died: it was killed, ran out of memory, or could not start (a script that uses several "
            'processes must guard its start by if __name__ == "__main__"); fewer processes take less memory'
        ) from None
    except BaseException:
        # interrupted, or one item failed: the rest is not needed and may take long
        executor.shutdown(wait=False, cancel_futures=True)
        _end(before)
        raise
    finally:
        executor.shutdown()
        temporary.remove(path)


def _submit(executor: ProcessPoolExecutor, items: Sequence[Any]) -> list[Future[Any]]:
    """Hand in all items, which starts the processes."""
    try:
        return [executor.submit(_run, item) for item in items]
    except OSError as error:
        # the system has no room for a process; or one died, and the queue was closed while another was started
        raise BrokenProcessPool(str(error)) from error


def _end(before: set[multiprocessing.process.BaseProcess]) -> None:
    """End all processes that were started since; a second signal does the ended no harm."""
    for child in set(multiprocessing.active_children()) - before:
        child.kill()


def _written(task: object) -> str:
    """Put a task into a file that nobody else can read or write.

    A process that dies before it has read a large task from its pipe would leave this one writing for ever.
    """
    try:
        with temporary.lock:
            handle, path = tempfile.mkstemp(prefix="assoc-task-")
            temporary.add(path)
        try:
            with os.fdopen(handle, "wb") as file:
                pickle.dump(task, file, pickle.HIGHEST_PROTOCOL)
        except (pickle.PicklingError, AttributeError, TypeError) as error:
            temporary.remove(path)
            raise not_sent(error) from None
        except BaseException:
            temporary.remove(path)
            raise
    except OSError as error:
        raise InvalidInputError(
            f"the folder for temporary files cannot be written ({error.strerror or error}); several processes need "
            "it: set TMPDIR to another one, or work with one process"
        ) from error
    return path


def start_python(module: str, *words: str, **options: Any) -> subprocess.Popen[bytes]:
    """Start a process that calls ``serve(*words)`` of a module, and finds modules where this process does.

    It reads what is written to its stdin, says nothing, and never looks into the current folder.
    """
    code = f"import sys; sys.path[:] = {path_without()!r}; from {module} import serve; serve(*sys.argv[1:])"
    quiet = subprocess.DEVNULL
    streams: dict[str, Any] = {"stdin": subprocess.PIPE, "stdout": quiet, "stderr": quiet}
    return subprocess.Popen([sys.executable, "-c", code, *words], **streams, **options)


# any text means yes; this one, that it is not the user's
_SAFE_PATH, _OWN = "PYTHONSAFEPATH", "assoc"
_lock = threading.Lock()
_starting = 0


@contextmanager
def safe_path() -> Iterator[None]:
    """Let Python processes that are started within not look into the current folder.

    Libraries that start them hand them the ``sys.path`` of this process later, but import modules before that.
    """
    global _starting
    with _lock:
        if not os.environ.get(_SAFE_PATH):
            os.environ[_SAFE_PATH] = _OWN
        _starting += 1
    try:
        yield
    finally:
        with _lock:
            _starting -= 1
            if not _starting:
                forget_safe_path()


def forget_safe_path() -> None:
    """Let what a user's own code starts look where it always does."""
    if os.environ.get(_SAFE_PATH) == _OWN:
        del os.environ[_SAFE_PATH]


@contextmanager
def signals_as_they_are() -> Iterator[None]:
    """Keep blocked what is blocked: starting processes lets Ctrl-C and its kin through afterwards."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, ())
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, blocked)


def end_with_parent(parent: int, *paths: str) -> None:
    """End this worker process soon after its parent, also where that was killed and could not say so.

    Parameters
    ----------
    parent : int
        Process id of the parent.
    paths : str
        Files that the parent would have removed.
    """

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(0.5)
        for path in paths:
            with suppress(OSError):
                os.unlink(path)
        os._exit(1)

    # the thread of a backend that works in the parent itself needs no watch
    if os.getpid() != parent:
        threading.Thread(target=watch, name="parent", daemon=True).start()


def _start(path: str, parent: int) -> None:
    global _task, _problem
    forget_safe_path()
    # Ctrl-C reaches the whole group: only the parent reports it
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    if hasattr(signal, "pthread_sigmask"):
        # programs wait for it in a thread, and their processes inherit that it is blocked
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGTERM})
    end_with_parent(parent, path)
    try:
        with open(path, "rb") as file:
            _task = pickle.load(file)
    except (ImportError, AttributeError) as error:
        # a worker that dies would say nothing: the first item does
        _problem = str(error)


def _run(item: Any) -> Any:
    if _problem:
        raise not_sent(_problem)
    assert _task is not None
    return _task(item)
