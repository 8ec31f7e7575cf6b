"""Compile all that solvers may need, before the first scan that is in a hurry.

Kernels are compiled at their first call and kept on disk. Which of them a scan needs depends on how hard it is: easy
ones never meet branch and bound, and the first hard one would wait for half a minute.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterable
from dataclasses import fields
from typing import Any

import numpy as np

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


def warm_up(solvers: Iterable[str] | None = None) -> float:
    """Compile the kernels of solvers, or load them, so that no later call of ``assign`` has to.

    After an installation this takes a minute or more, afterwards a second or two. Worth a call at the start of a
    program with time limits, and once after the installation.

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
        known = {field.name for field in fields(registry.parameters(name))}  # type: ignore[arg-type]
        limits: dict[str, Any] = {key: value for key, value in _LIMITS.items() if key in known}
        for problem in _problems():
            # with a limit and without: what looks at the clock is asked to look
            for limit in (None, 1e3):
                with contextlib.suppress(InfeasibleError):
                    assign(problem, name, time_limit=limit, **limits)
                # what was prepared is made anew
                problem._prepared = None
    # only large problems sort so, and their time limits are the hardest to keep
    ascending(np.zeros(10_000))
    return time.perf_counter() - started


def _problems() -> list[AssignmentProblem]:
    """Hard problems of random costs with dummies, an axial one, an easy one of two sensors, and an empty one."""
    rng = np.random.default_rng(1)
    sizes = [_ROWS] * 3
    tuples = rng.integers(0, _ROWS + 1, size=(_TUPLES, 3))
    tuples = tuples[np.count_nonzero(tuples, axis=1) >= 2]
    dense = AssignmentProblem(tuples, -rng.gamma(4.0, 1.0, size=len(tuples)), sizes)
    axial = AssignmentProblem.from_dense(rng.integers(0, 30, size=(11, 11, 11)).astype(float), dummy=False)
    planar = AssignmentProblem.from_dense(rng.normal(size=(5, 6)))
    return [dense, axial, planar, AssignmentProblem(np.zeros((0, 3), dtype=int), [], [2, 0, 1])]
