"""One run with a budget of processor time, on a machine that others may use."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any
from unittest import mock

import assoc
from assoc.packing.run import Run
from assoc.problem import AssignmentProblem
from assoc.solution import Solution, TracePoint
from experiments.common.checking import check_answer
from experiments.common.measuring import fresh

UNLIMITED = 1_000_000_000
# kernels look at the clock on the wall: their deadline is later by this than the budget would need
_LATER = 1.3


class _Pace:
    """Seconds on the wall for one of the processor, in the last runs."""

    def __init__(self) -> None:
        self.ratio = 1.0

    def saw(self, wall: float, processor: float) -> None:
        if processor > 0.1:
            self.ratio += 0.5 * (max(wall / processor, 0.5) - self.ratio)


_pace = _Pace()


def run(
    problem: AssignmentProblem,
    solver: str,
    seconds: float,
    seed: int,
    assign: Callable[..., Solution] = assoc.assign,
    **parameters: Any,
) -> float:
    """Run a solver for so much processor time, and return what its solution costs.

    What it finds after that does not count: an iteration that is at work then ends a little later. `assign` may look
    at its solution.
    """
    # what a limit gives them they use: by default they leave a part that has not become better for a while
    options = {"patience": UNLIMITED, "iterations": UNLIMITED} | parameters
    copy = fresh(problem)
    with _by_processor_time():
        wall, processor = time.perf_counter(), time.process_time()
        known: list[float] = []

        def callback(point: TracePoint) -> None:
            if not known or time.process_time() - processor <= 1.02 * seconds:
                known.append(point.cost)

        solution = assign(copy, solver, seed=seed, time_limit=seconds, callback=callback, **options)
        spent = time.process_time() - processor
        _pace.saw(time.perf_counter() - wall, spent)
    if not known or spent <= 1.02 * seconds:
        return check_answer(problem, solution.tuples)
    # as an answer within its time: never worse than the greedy one
    return min(*known, assoc.assign(problem, "greedy").cost)


@contextmanager
def _by_processor_time() -> Iterator[None]:
    """Let a run's clock count the processor time of this process."""
    began = time.process_time()

    def runtime(self: Run) -> float:
        return time.process_time() - began

    def deadline(self: Run, share: float = 1.0) -> float:
        left = share * self.remaining()
        return time.monotonic() + left * _LATER * _pace.ratio

    with mock.patch.object(Run, "runtime", runtime), mock.patch.object(Run, "deadline", deadline):
        yield


def log(text: str) -> None:
    """Say how far it is."""
    print(text, file=sys.stderr, flush=True)
