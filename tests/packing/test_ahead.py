"""Kernels that another process compiles ahead: all that the search of a hard problem needs."""

import pytest

from tests.running import printed

_SEARCH = """
import numpy as np
import pytest

import assoc
from numba.core import event
from assoc._system.interpreted import compiled_only
from assoc.packing.branching import compiling, search
from assoc.packing.prepare import prepare
from assoc.simulation import simulate

problem = assoc.build_problem(simulate("bearing-only", 2, targets=12, scans=1), 0)
packing = prepare(problem).packing.component(0)
with compiled_only():
    compiling.compile_branching()
    seen = event.RecordingListener()
    event.register("numba:compiler_lock", seen)
    one = search.BranchAndBound(packing, np.zeros(packing.num_rows), np.inf, 1e-9)
    one.run(1000)
assert one.done and one.nodes > 0 and packing.num_columns > 100
print(len(seen.buffer))
"""


@pytest.mark.slow
def test_it_is_what_a_hard_problem_needs():
    assert printed("-c", _SEARCH) == "0\n"
