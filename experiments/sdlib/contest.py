"""A comparison of solvers on the set: each alone on one core, for so much CPU time, judged by assoc/check.py.

Every run is a process of its own, forked from one in which all kernels are compiled: it begins with the problem read,
and its time is CPU time, so that other programs on the machine hardly matter. What it finds it writes down at once;
should it not keep its time, the system stops it.
"""

import json
import math
import multiprocessing
import os
import resource
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from assoc import check
from assoc.errors import AssocError
from assoc.problem import AssignmentProblem
from experiments.benchmarks.run import warm_up as compile_kernels
from experiments.common.measuring import fresh, one_core
from experiments.sdlib import store
from experiments.sdlib.contestants import CONTESTANTS, OURS, Log, is_installed, takes, warm_up
from experiments.sdlib.instances import Instance

Row = dict[str, Any]
# who does not keep the time is stopped at this many times as much CPU time, or wall time
_TWICE, _PATIENT = 2.0, 12.0
_FAULTS = (AssocError, ArithmeticError, AssertionError, ImportError, LookupError)
_FAULTS += (MemoryError, RuntimeError, TypeError, ValueError)


def representatives(every: list[Instance]) -> list[Instance]:
    """Of each family, in the order of tuples and names, the instances after a third and after two thirds of it."""
    rows = store.table()
    families: dict[str, list[Instance]] = {}
    for one in every:
        families.setdefault(one.family, []).append(one)
    chosen = []
    for own in families.values():
        ordered = sorted(own, key=lambda one: (rows[one.name]["tuples"], one.name))
        chosen += [ordered[len(own) // 3], ordered[2 * len(own) // 3]]
    return chosen


def contest(picked: list[Instance], names: list[str], seconds: float) -> Iterator[Row]:
    """Run contestants on instances; a row for each as it ends."""
    present = [name for name in names if is_installed(name)]
    for name in sorted(set(names) - set(present)):
        print(f"{name}: is not installed, and left out", file=sys.stderr)
    # forked processes have the kernels that are compiled here; peers, which start threads, must not have run before
    compile_kernels({name for name in present if name in OURS}, set())
    known = store.table()
    for one in picked:
        problem = store.load(one.name)
        exact = check.read_problem(str(store.instance_file(one.name)))
        for name in present:
            row: Row = {"instance": one.name, "solver": name}
            if takes(name, problem):
                found = _run(name, problem, seconds, float(known[one.name]["value"]))
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


def _contestant(name: str, problem: AssignmentProblem, seconds: float, best: float, path: Path) -> None:
    """What happens in a contestant's process."""
    os.environ["OMP_NUM_THREADS"] = "1"
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with open(path, "a") as file, open(os.devnull, "w") as nowhere:
        # what a peer prints is no part of our output
        for stream in (1, 2):
            os.dup2(nowhere.fileno(), stream)

        def write(content: object) -> None:
            file.write(json.dumps(content) + "\n")
            file.flush()

        warm_up(name)
        log = Log(
            best,
            tell=lambda point: write(point) if math.isfinite(point[1] or 0.0) else None,
            keep=lambda tuples: write({"tuples": tuples.tolist()}),
        )
        log.allow(_TWICE * seconds)
        try:
            tuples, proven = CONTESTANTS[name](fresh(problem), seconds, log)
            write({"seconds": round(log.elapsed(), 4), "tuples": tuples.tolist(), "proved": proven})
        except _FAULTS as error:
            write({"seconds": round(log.elapsed(), 4), "fault": f"{type(error).__name__}: {error}"[:100]})


def judged(found: Row, problem: check.Problem, seconds: float) -> Row:
    """Replace the tuples by their exact cost, or by why they are no solution; leave out what came after the time."""
    tuples = found.pop("tuples", None)
    row: Row = {"cost": None, "proved": False, **found}
    row["trace"] = _thinned([point for point in found["trace"] if point[0] <= 1.05 * seconds])
    if tuples:
        try:
            row["cost"] = store.decimal(check.cost_of(problem, [tuple(one) for one in tuples]))
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
