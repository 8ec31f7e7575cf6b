"""Compile all that solvers may need, before the first scan that is in a hurry.

Kernels are compiled at their first call and kept on disk. Which of them a scan needs depends on how hard it is: easy
ones never meet branch and bound, and the first hard one would wait for half a minute.
"""

from __future__ import annotations

import contextlib
import subprocess
import sys
import time
from collections.abc import Callable, Iterable
from dataclasses import fields
from typing import Any

import numpy as np

from assoc._system.door import door
from assoc._system.interpreted import compiled_only
from assoc.errors import InfeasibleError
from assoc.packing.kernels.sorting import ascending
from assoc.problem import AssignmentProblem
from assoc.solvers import registry
from assoc.solvers.assign import assign

# measurements a sensor, and tuples: enough for large parts, few enough for tenths of a second
_ROWS = 24
_TUPLES = 2000
# iterations without improvement, or nodes, after which a search has met all its kernels
_LIMITS = {"patience": 12, "nodes": 60}


# what a second process compiles while this one compiles the kernels of the other solvers; each loads what the other has
# compiled before
_HEURISTICS = ("tabu", "genetic", "aco")


@door
def warm_up(solvers: Iterable[str] | None = None) -> float:
    """Compile the kernels of solvers, or load them, so that no later call of ``assign`` has to.

    Call it once after installation: it then takes up to a minute, and uses two processes. Afterwards it takes a second
    or two; worth a call at the start of a program with time limits. On a terminal it says on stderr what it is at.

    Parameters
    ----------
    solvers : iterable of str, optional
        Names of solvers; by default all but ``milp``, which compiles little itself.

    Returns
    -------
    float
        Seconds that it took.

    Raises
    ------
    InvalidInputError
        There is no solver of a name.
    """
    started = time.perf_counter()
    names = [name for name in registry.names() if name != "milp"] if solvers is None else list(solvers)
    for name in names:
        registry.parameters(name)
    beside = [name for name in names if name in _HEURISTICS]
    here = [name for name in names if name not in beside]
    with compiled_only(), _Line() as say:
        helper = _begin_beside(beside) if beside and here else None
        for name in here:
            say(name)
            prepare([name])
        if helper is not None:
            say(", ".join(beside))
            helper.wait()
        for name in beside:
            say(name)
            prepare([name])
        # only large problems sort so, and their time limits are the hardest to keep
        ascending(np.zeros(10_000))
    return time.perf_counter() - started


class _Line:
    """One line on a terminal that says what is being prepared."""

    def __enter__(self) -> Callable[[str], None]:
        self._shown = sys.stderr is not None and sys.stderr.isatty()
        return self._say

    def _say(self, name: str) -> None:
        if self._shown:
            print(f"\r\033[Kassoc: preparing {name} (slow only once after installation)", end="", file=sys.stderr)
            sys.stderr.flush()

    def __exit__(self, *exception: object) -> None:
        if self._shown:
            print("\r\033[K", end="", file=sys.stderr)
            sys.stderr.flush()


def _begin_beside(names: list[str]) -> subprocess.Popen[bytes] | None:
    """Start a process that compiles the kernels of these solvers; None where none can be started."""
    code = f"from assoc.solvers.warm_up import prepare; prepare({names!r})"
    command = [sys.executable, "-c", code]
    quiet: Any = subprocess.DEVNULL
    try:
        return subprocess.Popen(command, stdin=quiet, stdout=quiet, stderr=quiet)
    except OSError:
        return None


def prepare(names: Iterable[str]) -> None:
    """Compile what some solvers need."""
    with compiled_only():
        for name in names:
            _solve_all(name, _problems())


def _solve_all(name: str, problems: list[AssignmentProblem]) -> None:
    known = {field.name for field in fields(registry.parameters(name))}  # type: ignore[arg-type]
    limits: dict[str, Any] = {key: value for key, value in _LIMITS.items() if key in known}
    for problem in problems:
        # with a limit and without: what looks at the clock is asked to look
        for limit in (None, 1e3):
            with contextlib.suppress(InfeasibleError):
                assign(problem, name, time_limit=limit, **limits)
            # what was prepared is made anew
            problem._prepared = None


def _problems() -> list[AssignmentProblem]:
    """Problems of random costs with dummies, an axial one, an easy one of two sensors, and an empty one.

    The first is too small for `exact` to call a metaheuristic, but not closed by its bound: by the time that it needs
    their kernels, the other process has compiled them.
    """
    small = _random_problem(np.random.default_rng(2), 8, 150)
    rng = np.random.default_rng(1)
    dense = _random_problem(rng, _ROWS, _TUPLES)
    axial = AssignmentProblem.from_dense(rng.integers(0, 30, size=(11, 11, 11)).astype(float), dummy=False)
    planar = AssignmentProblem.from_dense(rng.normal(size=(5, 6)))
    return [small, axial, dense, planar, AssignmentProblem(np.zeros((0, 3), dtype=int), [], [2, 0, 1])]


def _random_problem(rng: np.random.Generator, rows: int, count: int) -> AssignmentProblem:
    tuples = rng.integers(0, rows + 1, size=(count, 3))
    tuples = tuples[np.count_nonzero(tuples, axis=1) >= 2]
    return AssignmentProblem(tuples, -rng.gamma(4.0, 1.0, size=len(tuples)), [rows] * 3)
