"""Run one case: peers and exact methods first (they give the reference), then the rest."""

import math
import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from statistics import median
from typing import Any

from assoc.packing.bounds.dual_ascent import dual_bound
from assoc.packing.prepare import prepare
from assoc.packing.simplex.linear_program import LinearProgram
from assoc.problem import AssignmentProblem
from experiments.benchmarks.families import Case, Entry, Instance
from experiments.benchmarks.rows import Row
from experiments.common.contestants import STOPPED, run, takes, warm_up

PROVING = ("exact", "milp")
# runs of fewer seconds are made so many times
SHORT, TIMES = 0.1, 5
# families whose rows tell the gap of the linear program
GHOSTS = ("ghost", "wide gap")


def run_all(
    cases: Sequence[Case], seeds: int | None, processes: int, log: Callable[[str], None] = lambda text: None
) -> Iterator[list[Row]]:
    """Yield the rows of each case, in their order.

    seeds: Number of seeds at the most; None: all of each case.
    processes: More than 1: so many seeds at once, each process on a core of its own.
    """
    units = [case.by_seed(seeds) for case in cases]
    flat = [unit for ones in units for unit in ones]
    with _running(flat, processes) as found:
        for ones in units:
            rows: list[Row] = []
            for unit in ones:
                rows += (more := next(found))
                told = ", ".join(f"{row.solver} {row.cost:.7g} {row.seconds:.3g}s" for row in more if row.item == 0)
                log(f"{unit.family} {unit.size} seed {unit.seeds[0]}: {told}")
            yield rows


@contextmanager
def _running(units: list[Case], processes: int) -> Iterator[Iterator[list[Row]]]:
    """Rows of each unit, as they are run: here, or in processes that are forked."""
    if processes == 1:
        _warm_up(units)
        yield map(run_case, units)
        return
    context = multiprocessing.get_context("fork")
    with ProcessPoolExecutor(processes, context, _take_a_core, (context.Value("i", 0), units)) as pool:
        yield pool.map(_run_unit, range(len(units)))


# instances are made by functions that cannot be sent: each process has all units from its start
_UNITS: list[Case] = []


def _take_a_core(started: Any, units: list[Case]) -> None:
    """Begin a process: on a core of its own, warm, with what there is to run."""
    with started.get_lock():
        number = started.value
        started.value += 1
    if hasattr(os, "sched_setaffinity"):
        cores = sorted(os.sched_getaffinity(0))
        os.sched_setaffinity(0, {cores[number % len(cores)]})
    _warm_up(units)
    _UNITS[:] = units


def _run_unit(place: int) -> list[Row]:
    return run_case(_UNITS[place])


def _warm_up(cases: Sequence[Case]) -> None:
    warm_up({entry.solver for case in cases for entry in case.entries})


def run_case(case: Case, seeds: int | None = None) -> list[Row]:
    """Run everybody on every instance of a case, of so many seeds at the most."""
    return [
        row
        for unit in case.by_seed(seeds)
        for item, instance in enumerate(case.make(unit.seeds[0]))
        for row in _run_instance(case, instance, unit.seeds[0], item)
    ]


def _run_instance(case: Case, instance: Instance, seed: int, item: int) -> list[Row]:
    problem, optimum = instance.problem, instance.optimum
    blank = Row(case.family, case.size, seed, item, problem.num_tuples, "", False, 0.0, math.inf, -math.inf, 0.0, "")
    entries = [entry for entry in case.entries if takes(entry.solver, problem)]
    first = [entry for entry in entries if entry.peer or entry.solver in PROVING]
    rows = [timed(partial(_run, entry, problem, blank, None)) for entry in first]
    if optimum is None:
        optimum = min((row.cost for row in rows if row.status == "optimal"), default=None)
    rows += [timed(partial(_run, entry, problem, blank, optimum)) for entry in entries if entry not in first]
    reference = optimum if optimum is not None else min(row.cost for row in rows)
    for row in rows:
        if optimum is not None and not row.peer and row.bound > optimum + 1e-6 * max(1.0, abs(optimum)):
            raise AssertionError(f"{row.solver}: bound {row.bound} above the optimum {optimum}")
    gap = (reference - linear_bound(problem)) / max(1.0, abs(reference)) if case.family in GHOSTS else 0.0
    return [replace(row, reference=reference, proven=optimum is not None, extra=gap) for row in rows]


def linear_bound(problem: AssignmentProblem) -> float:
    """Return the bound of a problem's linear program."""
    prepared = prepare(problem)
    return LinearProgram(prepared.packing).solve(duals=dual_bound(prepared.packing)).bound + prepared.offset


def _run(entry: Entry, problem: AssignmentProblem, blank: Row, optimum: float | None) -> Row:
    def stop(cost: float, bound: float) -> bool:
        """Whether the entry's gap, or else the known optimum, is reached."""
        if entry.stop_gap is not None:
            return cost - bound <= entry.stop_gap * max(1.0, abs(cost))
        return optimum is not None and cost <= optimum + 1e-9 * max(1.0, abs(optimum))

    listening = entry.stop_gap is not None or entry.solver in STOPPED
    answer = run(entry.solver, problem, entry.limit, stop if listening else None)
    return replace(
        blank,
        solver=entry.label,
        peer=entry.peer,
        limit=entry.limit,
        cost=answer.cost,
        bound=-math.inf if answer.bound is None else answer.bound,
        seconds=answer.seconds,
        status="optimal" if answer.proven else "feasible" if math.isfinite(answer.cost) else "none",
        cpu=answer.cpu,
    )


def timed(run: Callable[[], Row]) -> Row:
    """The row of a run; a short one, which an interruption would double, is made several times."""
    row = run()
    if row.seconds >= SHORT:
        return row
    rows = [row, *(run() for _ in range(TIMES - 1))]
    return replace(row, seconds=median(each.seconds for each in rows), cpu=median(each.cpu for each in rows))
