"""Work spread over processes: results in order, and no process left after an interruption."""

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

# bytes of a process with numpy, scipy, compiled kernels and a small task
_PROCESS = 100e6

_task: Callable[[Any], Any] | None = None
_problem = ""


def require_processes(jobs: int) -> None:
    """Refuse more processes than fit into memory."""
    memory.require(_PROCESS * jobs, f"jobs: {jobs} processes", "take fewer", own=False)


def not_sent(reason: object) -> InvalidInputError:
    """Return the error for a task that cannot be sent to other processes, with the reason."""
    return InvalidInputError(
        "jobs: other processes can only use functions and classes at the top level of a module that they can import; "
        f"define your solver or function there ({reason})"
    )


def ordered_map(task: Callable[[Any], Any], items: Sequence[Any], jobs: int) -> Iterator[Any]:
    """Yield ``task(item)`` for each item, in order.

    Parameters
    ----------
    task : callable
        Sent once to each process, so it may hold data that all items share; must be picklable if jobs > 1.
    items : sequence
        Small and picklable.
    jobs : int
        Number of processes; 1 works in this process. They are spawned: forking would copy the locks of threads.

    Raises
    ------
    LimitExceededError
        A process died, or memory does not suffice for ``jobs`` processes.
    InvalidInputError
        The folder for temporary files is full or missing.
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
    # start all at once: the executor miscounts if one dies while it starts another on demand
    executor._safe_to_dynamically_spawn_children = False  # type: ignore[attr-defined]
    try:
        # signals wait until all are started: a half-started process could not be ended
        with signals_as_they_are(), safe_path(), ThreadPoolExecutor(1) as starter:
            waiting = starter.submit(_submit, executor, items).result()
        for future in waiting:
            yield future.result()
    except BrokenProcessPool:
        # also the processes that the executor had not registered yet
        _end(before)
        raise LimitExceededError(
            "a worker process died: it was killed, ran out of memory, or could not start (a script that uses several "
            'processes must guard its start by if __name__ == "__main__"); fewer processes take less memory'
        ) from None
    except BaseException:
        # interrupted, or an item failed: the remaining items are not needed and may take long
        executor.shutdown(wait=False, cancel_futures=True)
        _end(before)
        raise
    finally:
        executor.shutdown()
        temporary.remove(path)


def _submit(executor: ProcessPoolExecutor, items: Sequence[Any]) -> list[Future[Any]]:
    """Submit all items, which starts the processes."""
    try:
        return [executor.submit(_run, item) for item in items]
    except OSError as error:
        # the system refused a process; or one died, and the queue was closed while another started
        raise BrokenProcessPool(str(error)) from error


def _end(before: set[multiprocessing.process.BaseProcess]) -> None:
    """End all processes that were started since; a second signal does ended ones no harm."""
    for child in set(multiprocessing.active_children()) - before:
        child.kill()


def _written(task: object) -> str:
    """Write a task into a file that only this user can access.

    If it went through a pipe, a process that died before reading a large task would leave this one blocked for ever.
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
    """Start a process that calls ``serve(*words)`` of a module, with the search path for modules of this process.

    It reads lines from its stdin, prints nothing, and never imports from the current folder.
    """
    code = f"import sys; sys.path[:] = {path_without()!r}; from {module} import serve; serve(*sys.argv[1:])"
    quiet = subprocess.DEVNULL
    streams: dict[str, Any] = {"stdin": subprocess.PIPE, "stdout": quiet, "stderr": quiet}
    return subprocess.Popen([sys.executable, "-c", code, *words], **streams, **options)


# any text means yes; this one marks that the package set it, not the user
_SAFE_PATH, _OWN = "PYTHONSAFEPATH", "assoc"
_lock = threading.Lock()
_starting = 0


@contextmanager
def safe_path() -> Iterator[None]:
    """Keep Python processes that are started within from importing from the current folder.

    Libraries send them the ``sys.path`` of this process only after they have imported some modules.
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
    """Restore the search path for processes that the user's own code starts."""
    if os.environ.get(_SAFE_PATH) == _OWN:
        del os.environ[_SAFE_PATH]


@contextmanager
def signals_as_they_are() -> Iterator[None]:
    """Keep blocked signals blocked: starting processes unblocks Ctrl-C and similar signals."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, ())
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, blocked)


def end_with_parent(parent: int, *paths: str) -> None:
    """End this worker process soon after its parent, even if the parent was killed.

    Parameters
    ----------
    parent : int
        Process id of the parent.
    paths : str
        Files to remove, which a killed parent cannot remove itself.
    """

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(0.5)
        for path in paths:
            with suppress(OSError):
                os.unlink(path)
        os._exit(1)

    # a backend's thread in the parent process itself needs no watch
    if os.getpid() != parent:
        threading.Thread(target=watch, name="parent", daemon=True).start()


def _start(path: str, parent: int) -> None:
    global _task, _problem
    forget_safe_path()
    # Ctrl-C reaches the whole group, but only the parent reports it
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    if hasattr(signal, "pthread_sigmask"):
        # programs wait for the signal in a thread and block it, and their processes inherit the block
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGTERM})
    end_with_parent(parent, path)
    try:
        with open(path, "rb") as file:
            _task = pickle.load(file)
    except (ImportError, AttributeError) as error:
        # a worker that died here would give no reason: the first item raises the error instead
        _problem = str(error)


def _run(item: Any) -> Any:
    if _problem:
        raise not_sent(_problem)
    assert _task is not None
    return _task(item)
