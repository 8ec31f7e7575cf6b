"""A comparison of solvers on the set: each alone on one core, for so much CPU time, judged by assoc/check.py.

Every run is a process of its own, forked from one in which all kernels are compiled: it begins with the problem read,
and its time is CPU time, so that other programs on the machine hardly matter. What it finds it writes down at once;
should it not keep its time, the system stops it. Peers that tell of nothing before their end are started anew, with 1,
5 and all seconds. Most can be limited by the wall's clock alone: on a machine that others use, too, they are given as
much more of that as they got less of the processor shortly before.
"""

import json
import math
import multiprocessing
import os
import resource
import sys
import tempfile
import time
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TextIO

from assoc import check
from assoc.errors import AssocError
from assoc.problem import AssignmentProblem
from experiments.common.contestants import LISTENED, ONE_CORE, OURS, STOPPED, Answer, run, takes, warm_up
from experiments.common.measuring import one_core
from experiments.sdlib import store
from experiments.sdlib.instances import Instance

Row = dict[str, Any]
CONTESTANTS = (
    "exact", "milp", "lagrangian", "aco", "genetic", "tabu", "greedy", "cp_sat", "scip", "highs",
    "chils", "branch_reduce", "mmwis", "sequential",
)  # fmt: skip
"""All have one core. "sequential" is scipy's 2-D assignment, sensor by sensor, as most trackers do it."""
CHECKPOINTS = (1.0, 5.0)
"""Seconds before the last at which quality is looked at."""
# who does not keep the time is stopped at this many times as much CPU time, or wall time
_TWICE, _PATIENT = 2.0, 12.0
# who is started anew and does not keep a limit: at this many times as much CPU time, and seconds more
_LATE, _START = 1.2, 3.0
# wall time at the most, as a multiple of CPU time, and CPU seconds that the first guess takes
_SLACK, _PROBE = 3.0, 0.05
# a share of its limit within which a peer has ended by itself
_EARLY = 0.7
# a cost this near to the best one that is known, relatively, is the best one
_SAME = 1e-9
_FAULTS = (AssocError, ArithmeticError, AssertionError, ImportError, LookupError)
_FAULTS += (MemoryError, RuntimeError, TypeError, ValueError)


def representatives(every: list[Instance]) -> list[Instance]:
    """Of each family, in the order of tuples and names, the instances after a third and after two thirds of it."""
    rows = store.table()
    families: dict[str, list[Instance]] = {}
    for instance in every:
        families.setdefault(instance.family, []).append(instance)
    chosen = []
    for own in families.values():
        ordered = sorted(own, key=lambda instance: (rows[instance.name]["tuples"], instance.name))
        chosen += [ordered[len(own) // 3], ordered[2 * len(own) // 3]]
    return chosen


def contest(
    picked: list[Instance], names: Sequence[str], seconds: float, done: Collection[tuple[str, str]] = ()
) -> Iterator[Row]:
    """Run contestants on instances; a row for each as it ends, but for instances and contestants that are done."""
    present = [name for name in names if takes(name)]
    for name in sorted(set(names) - set(present)):
        print(f"{name}: is not installed, and left out", file=sys.stderr)
    # forked processes have the kernels that are compiled here; peers, which start threads, must not have run before
    warm_up({*present} & {*OURS})
    known = store.table()
    for instance in picked:
        problem = store.load(instance.name)
        exact = check.read_problem(str(store.instance_file(instance.name)))
        for name in (name for name in present if (instance.name, name) not in done):
            row: Row = {"instance": instance.name, "solver": name}
            if takes(name, problem):
                found = _run(name, problem, seconds, float(known[instance.name]["value"]))
                yield row | judged(found, exact, seconds)
            else:
                yield row | {"fault": "cannot take it"}


def _run(name: str, problem: AssignmentProblem, seconds: float, best: float) -> Row:
    """Run one contestant in a process of its own; what it wrote down."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log"
        path.touch()
        arguments = (name, problem, seconds, best, path)
        process = multiprocessing.get_context("fork").Process(target=_contestant, args=arguments)
        with one_core():
            process.start()
        process.join(_PATIENT * seconds + 60.0)
        if process.is_alive():
            process.kill()
            process.join()
        # the last line may be cut
        lines = [json.loads(line) for line in path.read_text().splitlines() if line[-1:] in ("]", "}")]
    found: Row = {"trace": [line for line in lines if isinstance(line, list)]}
    for line in lines:
        if isinstance(line, dict):
            found |= line
    return found if "seconds" in found else found | {"fault": "was stopped"}


@dataclass
class _Log:
    """What was found, and when, in seconds of the process's CPU time.

    best: The best cost that is known: a solver that gives no bound has nothing left to find there.
    """

    file: TextIO
    best: float
    started: float = field(default_factory=time.process_time)

    def write(self, content: object) -> None:
        """Write a line at once."""
        self.file.write(json.dumps(content) + "\n")
        self.file.flush()

    def elapsed(self) -> float:
        """CPU seconds of this process since the start."""
        return time.process_time() - self.started

    def point(self, cost: float, bound: float | None, seconds: float) -> None:
        """Write down when there were a cost and a bound."""
        if math.isfinite(cost):
            known = bound is not None and math.isfinite(bound)
            self.write([round(seconds, 4), cost, bound if known else None])

    def is_best(self, cost: float) -> bool:
        """Whether a cost is the best one that is known, or better."""
        return cost <= self.best + _SAME * max(1.0, abs(self.best))


def _contestant(name: str, problem: AssignmentProblem, seconds: float, best: float, path: Path) -> None:
    """What happens in a contestant's process."""
    os.environ["OMP_NUM_THREADS"] = "1"
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with open(path, "a") as file, open(os.devnull, "w") as nowhere:
        # what a peer prints is no part of our output
        for stream in (1, 2):
            os.dup2(nowhere.fileno(), stream)
        solver = ONE_CORE.get(name, name)
        if solver not in OURS:
            warm_up([solver])
        _allow(_TWICE * seconds)
        log = _Log(file, best)
        try:
            answer = (_listened if solver in LISTENED else _started_anew)(solver, problem, seconds, log)
            end = {"tuples": answer.tuples.tolist(), "proved": answer.proven}
        except _FAULTS as error:
            end = {"fault": f"{type(error).__name__}: {error}"[:100]}
        log.write({"seconds": round(log.elapsed(), 4), **end})


def _allow(seconds: float) -> None:
    """Have the system stop this process after so much more CPU time, and some: not all keep their limits."""
    most = math.ceil(time.process_time() + _LATE * seconds + _START)
    resource.setrlimit(resource.RLIMIT_CPU, (most, resource.getrlimit(resource.RLIMIT_CPU)[1]))


def _wall(seconds: float) -> float:
    """Wall time in which this process will have had about so much CPU time, going by the last moments."""
    wall, cpu = time.perf_counter(), time.process_time()
    while time.process_time() - cpu < _PROBE:
        pass
    share = (time.process_time() - cpu) / (time.perf_counter() - wall)
    return seconds / min(max(share, 1.0 / _SLACK), 1.0)


def _listened(solver: str, problem: AssignmentProblem, seconds: float, log: _Log) -> Answer:
    """A solver that tells what it finds."""
    last = (math.inf, -math.inf)
    limit = _SLACK * seconds if solver in OURS else _wall(seconds)
    log.started = time.process_time()

    def told(cost: float, bound: float) -> bool:
        nonlocal last
        if (cost, bound) != last:
            last = cost, bound
            log.point(cost, bound, log.elapsed())
        return log.elapsed() >= seconds or (solver in STOPPED and log.is_best(cost))

    answer = run(solver, problem, limit, told)
    log.point(answer.cost, answer.bound, answer.cpu)
    return answer


def _started_anew(solver: str, problem: AssignmentProblem, seconds: float, log: _Log) -> Answer:
    """A peer that tells of nothing before its end; its last answer, with the best tuples of all."""
    limited = solver != "sequential"
    best = Answer(math.inf, None, 0.0, problem.tuples[:0])
    for limit in (*(mark for mark in CHECKPOINTS if limited and mark < seconds), seconds):
        _allow(limit)
        most = _wall(limit) if limited else limit
        answer = run(solver, problem, most)
        log.point(answer.cost, answer.bound, min(answer.cpu, limit) if limited else answer.cpu)
        if answer.cost < best.cost:
            best = answer
            # should no better one follow
            log.write({"tuples": best.tuples.tolist()})
        if answer.proven or answer.seconds < _EARLY * most or (answer.bound is None and log.is_best(best.cost)):
            break
    return replace(best, proven=answer.proven)


def judged(found: Row, problem: check.Problem, seconds: float) -> Row:
    """Replace the tuples by their exact cost, or by why they are no solution; leave out what came after the time."""
    tuples = found.pop("tuples", None)
    row: Row = {"cost": None, "proved": False, **found}
    row["trace"] = _thinned([point for point in found["trace"] if point[0] <= 1.05 * seconds])
    if tuples:
        try:
            row["cost"] = store.exact_cost(problem, tuples)
        except check.RefusedError as error:
            row |= {"fault": f"no solution: {error}", "proved": False, "trace": []}
    return row


def _thinned(trace: list[list[Any]]) -> list[list[Any]]:
    """The points at which the cost fell, or the gap was halved; and the last."""
    kept: list[list[Any]] = []
    for point in trace:
        if not kept or point[1] < kept[-1][1] or _gap(point) < 0.5 * _gap(kept[-1]) or point is trace[-1]:
            kept.append(point)
    return kept


def _gap(point: list[Any]) -> float:
    return math.inf if point[2] is None else max(point[1] - point[2], 1e-12)
