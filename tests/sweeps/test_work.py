"""The time of a run is the solver's own: never that of compiling, loading or importing."""

import sys

import numba
import numpy as np
import pytest

from assoc.packing.run import Outcome
from assoc.problem import AssignmentProblem
from assoc.solvers import registry
from assoc.solvers.greedy.parameters import GreedyParameters
from assoc.sweeps import Setting, Study, load
from assoc.sweeps.sources import StudySource


def chain(number):
    """A problem of so many tuples."""
    tuples = [[i, i] for i in range(1, number + 1)]
    return AssignmentProblem(tuples, np.full(number, -1.0), [number, number])


@pytest.fixture
def lazy(monkeypatch, tmp_path):
    """A solver that needs code for large problems that small ones do not need."""
    met = []
    (tmp_path / "a_slow_module.py").write_text("import time\ntime.sleep(1.0)\n")
    monkeypatch.syspath_prepend(tmp_path)

    def solve(packing, parameters, run):
        met.append(packing.num_columns)
        if packing.num_columns == 2:
            kernel(1.0)
        if packing.num_columns == 3:
            import a_slow_module  # noqa: F401
        return Outcome(np.arange(packing.num_columns), 1)

    @numba.njit
    def kernel(x):
        return np.linalg.norm(np.full((3, 3), x))

    registry.register("lazy", GreedyParameters, solve)
    yield met
    sys.modules.pop("a_slow_module", None)


def test_no_run_has_the_time_of_what_it_loads(lazy, tmp_path):
    sources = [StudySource(chain(number), str(number)) for number in (1, 2, 3)]
    Study(sources, [Setting("lazy", {})], 2).run(tmp_path / "s")
    frame = load(tmp_path / "s")
    assert len(frame) == 6 and frame["time"].max() < 1.0
    # one more run where something was loaded; the first problem may need nothing of its own
    assert lazy.count(1) <= 3 and lazy.count(2) == 3 and lazy.count(3) == 3
