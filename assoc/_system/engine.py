"""One map for work in several places: this process, processes of this machine, or the workers of a dask cluster."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable
from itertools import islice
from typing import Any

from assoc._system.cluster import dask_map
from assoc._system.processes import parallel_map


class _Batch:
    """A task for several items, sent and answered at once."""

    def __init__(self, task: Callable[[Any], Any]) -> None:
        self.task = task

    def __call__(self, items: list[Any]) -> list[Any]:
        return [self.task(item) for item in items]


def spread(
    task: Callable[[Any], Any],
    items: Iterable[Any],
    *,
    jobs: int = 1,
    scheduler: str | None = None,
    ordered: bool = True,
    together: int = 1,
) -> Generator[Any]:
    """Yield ``task(item)`` for each item; the results are the same wherever they are made.

    Parameters
    ----------
    task : callable
        Sent once to each process, so it may hold data that all items share.
    items : iterable
        Small. If the results need no order, it is read only as far as the processes need.
    jobs : int
        Number of processes of this machine; 1 works in this process.
    scheduler : str, optional
        Address of a dask scheduler, whose workers then do the work. Items of a lost worker are repeated by another.
    ordered : bool
        Whether results come in the order of the items, or as they arrive.
    together : int
        Number of items that are sent at once: more of them where a task takes less than some milliseconds.

    Raises
    ------
    LimitExceededError
        A process died or could not start, or memory does not suffice for ``jobs`` processes.
    InvalidInputError
        The task cannot be sent, its result cannot be sent back, or the scheduler does not answer.
    LostError
        The scheduler is lost, or workers were lost in several attempts at an item.
    """
    alone = scheduler is None and jobs <= 1
    if together > 1 and not alone:
        left = iter(items)
        batches = list(iter(lambda: list(islice(left, together)), []))
        for results in spread(_Batch(task), batches, jobs=jobs, scheduler=scheduler, ordered=ordered):
            yield from results
    elif scheduler is None:
        yield from parallel_map(task, items, jobs, ordered=ordered)
    else:
        yield from dask_map(task, items, scheduler, ordered=ordered)
