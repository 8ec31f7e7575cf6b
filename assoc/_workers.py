"""Work spread over processes: results in order, and nobody left behind when it is cut short."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
import tempfile
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from typing import Any

from assoc import _memory
from assoc.errors import LimitExceededError

# bytes of a process with numpy, scipy and compiled kernels, and a small task
_PROCESS = 100e6

_task: Callable[[Any], Any] | None = None


def require_processes(jobs: int) -> None:
    """Refuse more processes than there is memory for."""
    _memory.require(_PROCESS * jobs, f"jobs: {jobs} processes", "take fewer", own=False)


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
    """
    jobs = min(jobs, len(items))
    if jobs <= 1:
        for item in items:
            yield task(item)
        return
    require_processes(jobs)
    before = set(multiprocessing.active_children())
    context = multiprocessing.get_context("spawn")
    # a process that dies before it has read a large task from its pipe would leave this one writing for ever
    handle, path = tempfile.mkstemp(prefix="assoc-task-")
    with os.fdopen(handle, "wb") as file:
        pickle.dump(task, file, pickle.HIGHEST_PROTOCOL)
    executor = ProcessPoolExecutor(jobs, mp_context=context, initializer=_start, initargs=(path,))
    # all at once at the start: the executor loses count when one dies while it starts another on demand
    executor._safe_to_dynamically_spawn_children = False  # type: ignore[attr-defined]
    try:
        waiting = _submit(executor, items)
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
        # interrupted, or one item failed: nobody wants the rest, which may take long
        executor.shutdown(wait=False, cancel_futures=True)
        _end(before)
        raise
    finally:
        executor.shutdown()
        os.unlink(path)


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
        child.terminate()


def _start(path: str) -> None:
    global _task
    # Ctrl-C reaches the whole group: let the parent speak, and die quietly
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    with open(path, "rb") as file:
        _task = pickle.load(file)


def _run(item: Any) -> Any:
    assert _task is not None
    return _task(item)
