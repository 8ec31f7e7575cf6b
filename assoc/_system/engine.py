"""One map for work in several places: this process, processes of this machine, or the workers of a dask cluster."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable
from itertools import islice
from typing import Any

from assoc._system.cluster import dask_map
from assoc._system.processes import process_map


class _Batch:
    """A task for several items, sent and answered at once."""

    def __init__(self, task: Callable[[Any], Any]) -> None:
        self.task = task

    def __call__(self, items: list[Any]) -> list[Any]:
        return [self.task(item) for item in items]


def parallel_map(
    task: Callable[[Any], Any],
    items: Iterable[Any],
    *,
    jobs: int = 1,
    scheduler: str | None = None,
    ordered: bool = True,
    together: int = 1,
    here: bool = False,
) -> Generator[Any]:
    """Yield ``task(item)`` for each item; the results are the same wherever they are made.

    The task is sent once to each process, so it may hold data that all items share; items are small. The work is done
    by ``jobs`` processes of this machine (1: this process), or by the workers of a dask ``scheduler``, where items of a
    lost worker are repeated by another. Without ``ordered``, results come as they arrive, and items are read only as
    far as the processes need. ``together`` items are sent at once: more of them where a task takes less than some
    milliseconds. With ``here`` this process is one of the ``jobs``, and works while the others start: for tasks that
    end in seconds, and cannot end the process.

    LimitExceededError: a process died or could not start, or memory does not suffice for so many. InvalidInputError:
    the task or its result cannot be sent, or the scheduler does not answer. LostError: the scheduler is lost, or
    workers were in several attempts at an item.
    """
    alone = scheduler is None and jobs <= 1
    if together > 1 and not alone:
        left = iter(items)
        batches = list(iter(lambda: list(islice(left, together)), []))
        for results in parallel_map(_Batch(task), batches, jobs=jobs, scheduler=scheduler, ordered=ordered, here=here):
            yield from results
    elif scheduler is None:
        yield from process_map(task, items, jobs, ordered=ordered, here=here)
    else:
        yield from dask_map(task, items, scheduler, ordered=ordered)
