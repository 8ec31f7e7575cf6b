"""Run one case: peers and exact methods first (they give the reference), then the rest."""

import contextlib
import math
import multiprocessing
import os
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from statistics import median
from typing import Any

import assoc
from assoc.costs import build_problem
from assoc.errors import InfeasibleError
from assoc.problem import AssignmentProblem
from assoc.solution import TracePoint
from experiments.benchmarks.families import HEURISTICS, Case, Entry, Instance
from experiments.benchmarks.rows import Row
from experiments.benchmarks.wide_gaps import linear_bound
from experiments.common import annealing, peers
from experiments.common.checking import check_answer
from experiments.common.instances import scenes, synthetic
from experiments.common.measuring import fresh, one_core

PROVING = ("exact", "milp")
UNLIMITED = 1_000_000_000
# runs of fewer seconds are made so many times
SHORT, TIMES = 0.1, 5
# families whose rows tell the gap of the linear program
GHOSTS = ("ghost", "wide gap")


def warm_up(ours: set[str], others: set[str]) -> None:
    """Compile the kernels and import the packages of all solvers on small problems."""
    small = [synthetic.planted(s, 0, targets=6)[0] for s in (2, 3, 4)]
    small += [synthetic.axial_random(5, 0), synthetic.planar_random(6, 0)]
    # only a hard problem meets all kernels
    small.append(build_problem(scenes.ghost(20, 0), 0))
    annealing.make_known()
    for name in sorted(ours):
        for problem in small:
            with contextlib.suppress(InfeasibleError):
                # twice: in a limit that compiling used up the later kernels were not called
                assoc.assign(problem, name, time_limit=1.0)
                assoc.assign(problem, name, time_limit=1.0)
    peers.warm_up(sorted(others))


def run_all(
    cases: Sequence[Case], seeds: int | None, processes: int, log: Callable[[str], None] = lambda text: None
) -> Iterator[list[Row]]:
    """Yield the rows of each case, in their order.

    seeds: Number of seeds at the most; None: all of each case.
    processes: More than 1: so many seeds at once, each process on a core of its own.
    """
    if processes == 1:
        _warm_up_for(cases)
        for case in cases:
            yield run_case(case, seeds, log)
        return
    units = [case.by_seed(seeds) for case in cases]
    context = multiprocessing.get_context("fork")
    # instances are made by functions that cannot be sent: each process has all units from its start
    flat = [one for ones in units for one in ones]
    started = context.Value("i", 0)
    with ProcessPoolExecutor(processes, context, _take_a_core, (started, cases, flat)) as pool:
        found = pool.map(_run_unit, range(len(flat)))
        for ones in units:
            rows: list[Row] = []
            for _ in ones:
                more, lines = next(found)
                for line in lines:
                    log(line)
                rows += more
            yield rows


_UNITS: list[Case] = []


def _take_a_core(started: Any, cases: Sequence[Case], units: list[Case]) -> None:
    """Begin a process: on a core of its own, warm, with what there is to run."""
    with started.get_lock():
        number = started.value
        started.value += 1
    if hasattr(os, "sched_setaffinity"):
        cores = sorted(os.sched_getaffinity(0))
        os.sched_setaffinity(0, {cores[number % len(cores)]})
    _warm_up_for(cases)
    _UNITS[:] = units


def _run_unit(place: int) -> tuple[list[Row], list[str]]:
    lines: list[str] = []
    return run_case(_UNITS[place], log=lines.append), lines


def _warm_up_for(cases: Sequence[Case]) -> None:
    warm_up(
        {entry.solver for case in cases for entry in case.ours},
        {entry.solver for case in cases for entry in case.peers},
    )


def run_case(case: Case, seeds: int | None = None, log: Callable[[str], None] = lambda text: None) -> list[Row]:
    """Run everybody on every instance of a case.

    seeds: Number of seeds at the most; by default all of the case.
    """
    annealing.make_known()
    rows: list[Row] = []
    for one in case.by_seed(seeds):
        (seed,) = one.chosen
        for item, instance in enumerate(case.make(seed)):
            found = _run_instance(case, instance, seed, item)
            rows += found
            if item == 0:
                log(f"{case.family} {case.size} seed {seed}: " + ", ".join(_brief(row) for row in found))
    return rows


def _brief(row: Row) -> str:
    return f"{row.solver} {row.cost:.7g} {row.seconds:.3g}s"


def _run_instance(case: Case, instance: Instance, seed: int, item: int) -> list[Row]:
    problem = instance.problem
    blank = Row(case.family, case.size, seed, item, problem.num_tuples, "", False, 0.0, math.inf, -math.inf, 0.0, "")
    rows = [
        timed(partial(_run_peer, entry, problem, blank))
        for entry in case.peers
        if peers.available(entry.solver, problem)
    ]
    first = [entry for entry in case.ours if entry.solver in PROVING]
    rows += [timed(partial(_run_ours, entry, problem, blank, None)) for entry in first]
    optimum = instance.optimum
    if optimum is None:
        optimum = _proven_optimum(rows)
    rows += [timed(partial(_run_ours, entry, problem, blank, optimum)) for entry in case.ours if entry not in first]
    reference = optimum if optimum is not None else min(row.cost for row in rows)
    gap = (reference - linear_bound(problem)) / max(1.0, abs(reference)) if case.family in GHOSTS else 0.0
    return [replace(row, reference=reference, proven=optimum is not None, extra=gap) for row in rows]


def timed(run: Callable[[], Row]) -> Row:
    """The row of a run; a short one, which an interruption would double, is made several times."""
    row = run()
    if row.seconds >= SHORT:
        return row
    rows = [row, *(run() for _ in range(TIMES - 1))]
    return replace(row, seconds=median(one.seconds for one in rows), cpu=median(one.cpu for one in rows))


def _proven_optimum(rows: list[Row]) -> float | None:
    """Return the least cost that any method says is proven."""
    proven = [row for row in rows if row.status == "optimal"]
    return min((row.cost for row in proven), default=None)


def _run_peer(entry: Entry, problem: AssignmentProblem, blank: Row) -> Row:
    answer = peers.PEERS[entry.solver](problem, entry.limit)
    status = "optimal" if answer.proven else "feasible" if math.isfinite(answer.cost) else "none"
    return replace(
        blank,
        solver=entry.label,
        peer=True,
        limit=entry.limit,
        cost=answer.cost,
        bound=-math.inf if answer.bound is None else answer.bound,
        seconds=answer.seconds,
        status=status,
        cpu=answer.cpu,
    )


def _run_ours(entry: Entry, problem: AssignmentProblem, blank: Row, optimum: float | None) -> Row:
    def stop(point: TracePoint) -> bool:
        """Whether the entry's gap, or else the known optimum, is reached."""
        if entry.stop_gap is not None:
            return point.cost - point.lower_bound <= entry.stop_gap * max(1.0, abs(point.cost))
        return optimum is not None and point.cost <= optimum + 1e-9 * max(1.0, abs(optimum))

    watched = entry.solver not in PROVING and entry.solver != "lagrangian"
    callback = stop if watched or entry.stop_gap is not None else None
    # what a limit gives them they use: by default they leave a part that has not become better for a while
    options = {"patience": UNLIMITED, "iterations": UNLIMITED} if entry.solver in HEURISTICS else {}
    with one_core():
        start, before = time.perf_counter(), time.process_time()
        try:
            solution = assoc.assign(fresh(problem), entry.solver, time_limit=entry.limit, callback=callback, **options)
        except InfeasibleError:
            seconds = time.perf_counter() - start
            return replace(blank, solver=entry.label, limit=entry.limit, seconds=seconds, status="none")
        seconds, cpu = time.perf_counter() - start, time.process_time() - before
    cost = check_answer(problem, solution.tuples)
    if abs(cost - solution.cost) > 1e-7 * max(1.0, abs(cost)):
        raise AssertionError(f"{entry.solver}: says {solution.cost}, its tuples cost {cost}")
    if optimum is not None and solution.lower_bound > optimum + 1e-6 * max(1.0, abs(optimum)):
        raise AssertionError(f"{entry.solver}: bound {solution.lower_bound} above the optimum {optimum}")
    return replace(
        blank,
        solver=entry.label,
        limit=entry.limit,
        cost=cost,
        bound=solution.lower_bound,
        seconds=seconds,
        status=solution.status,
        cpu=cpu,
    )
