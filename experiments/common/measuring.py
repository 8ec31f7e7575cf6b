"""One core, processor time, and problems in which nothing is prepared."""

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

from assoc.problem import AssignmentProblem


@contextmanager
def one_core() -> Iterator[None]:
    """Pin this thread, and the threads it starts, to one core (where the system can)."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(before)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


def timed(call: Callable[[], Any], clock: Callable[[], float] = time.thread_time) -> tuple[Any, float]:
    """What a call returns, and the seconds that it takes by a clock, of this thread's processor time by default."""
    begin = clock()
    answer = call()
    return answer, clock() - begin


def processor_time(call: Callable[..., Any], *arguments: Any) -> tuple[Any, float]:
    """What a call returns, and the processor time that it takes, all threads together; seconds."""
    return timed(partial(call, *arguments), time.process_time)


def clocked(call: Callable[[], Any]) -> tuple[Any, float, float]:
    """What a call returns, its wall time, and its processor time, all threads together; seconds."""
    wall, processor = time.perf_counter(), time.process_time()
    answer = call()
    return answer, time.perf_counter() - wall, time.process_time() - processor


def fresh(problem: AssignmentProblem) -> AssignmentProblem:
    """Return a copy in which nothing is left that an earlier solver prepared."""
    return AssignmentProblem(problem.tuples, problem.costs, problem.sizes, dummy=problem.dummy)
