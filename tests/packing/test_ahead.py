"""Kernels that another process compiles ahead: all that the search of a hard problem needs."""

import os
import sys

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


_AHEAD = """
from assoc._system import compiled
from assoc._system.clock import is_over
from assoc._system.interpreted import compiled_only

started = []


call_beside = compiled.call_beside
compiled.call_beside = lambda function: started.append(function) or call_beside(function)
with compiled_only():
    compiled.compile_ahead(is_over, prepare_clock)
assert not started
compiled.compile_ahead(is_over, prepare_clock)
assert started == [prepare_clock]
compiled.wait_for_kernels()
assert not is_over.signatures
# what is on disk now is not compiled once more
compiled.compile_ahead(is_over, prepare_clock)
assert len(started) == 1
assert not is_over(float("inf")) and sum(is_over.stats.cache_hits.values()) == 1
"""


@pytest.mark.slow
def test_another_process_compiles_what_is_not_on_disk(tmp_path):
    source = "from assoc._system.clock import is_over\n\n\ndef prepare_clock():\n    is_over(1e300)\n"
    (tmp_path / "prepares.py").write_text(source)
    path = os.pathsep.join([str(tmp_path), *sys.path])
    code = "from prepares import prepare_clock\n" + _AHEAD
    assert printed("-c", code, PYTHONPATH=path, NUMBA_CACHE_DIR=tmp_path / "cold", ASSOC_INTERPRET=1) == ""


_TRIALS = """
from assoc._system.interpreted import compiled_only
from assoc.packing.branching import compiling, pairs
from assoc.packing.branching.depth_first import search_depth_first

with compiled_only():
    compiling._compile_trials()
    compiling.compile_branching()
print(search_depth_first.stats.cache_misses != {}, len(pairs.decide.signatures))
"""


@pytest.mark.slow
def test_the_first_process_compiles_those_trials_that_the_search_links(tmp_path):
    assert printed("-c", _TRIALS, NUMBA_CACHE_DIR=tmp_path) == "True 1\n"
