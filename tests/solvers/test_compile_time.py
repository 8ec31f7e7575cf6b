"""Compiling is told apart from solving: in a first process after installation, in a later one, and in none."""

import json
import time
from concurrent.futures import ThreadPoolExecutor

import pytest

import assoc
from assoc._system.compile_time import loading
from assoc.packing.run import Run
from assoc.simulation import simulate
from tests.running import printed

# greedy: the solver with the fewest kernels
_SOLVER = """
import json, time, assoc

problem = assoc.AssignmentProblem([[1, 1, 1], [1, 2, 0], [2, 1, 2], [0, 2, 1]], [-3.0, -1.0, -2.0, -4.0], [2, 2, 2])
times = []
for _ in range(2):
    started = time.perf_counter()
    found = assoc.assign(problem, "greedy")
    times.append([time.perf_counter() - started, found.runtime, found.compile_time])
print(json.dumps(times))
"""


@pytest.mark.slow
def test_a_first_process_and_a_second(tmp_path):
    program = tmp_path / "program.py"
    program.write_text(_SOLVER)
    answers = []
    for _ in range(2):
        answers.append(json.loads(printed(program, NUMBA_CACHE_DIR=tmp_path / "cache")))
    (cold, again), (warm, warm_again) = answers
    whole, runtime, compiling = cold
    assert compiling > 0.3 and runtime < 0.2 * compiling
    assert runtime + compiling == pytest.approx(whole, rel=0.2)
    # what the first has compiled the second only loads
    assert warm[2] < 0.5 * compiling and warm[1] < 0.5
    for whole, runtime, compiling in (again, warm_again):
        assert compiling < 1e-3 and 0.0 < runtime <= whole


_LIMIT = """
import json, time
from numba.core import event
from assoc._system.clock import is_over, now
from assoc._system.compiled import njit
from assoc.packing.run import Run
from typing import NamedTuple

class Limits(NamedTuple):
    deadline: float

@njit
def kernel(deadline, limits):
    return not is_over(deadline) and not is_over(limits.deadline)

class Slow(event.Listener):
    def on_start(self, event):
        time.sleep(0.1)

    def on_end(self, event):
        pass

now()
event.register("numba:run_pass", Slow())
run = Run(0, time_limit=1.0)
print(json.dumps([bool(kernel(run.deadline(), Limits(run.deadline()))), run.compile_time(), run.should_stop()]))
"""


@pytest.mark.slow
def test_a_time_limit_begins_after_compiling(tmp_path):
    """The kernel is compiled after its deadline was computed."""
    program = tmp_path / "program.py"
    program.write_text(_LIMIT)
    in_time, compiling, stopped = json.loads(printed(program, NUMBA_CACHE_DIR=tmp_path / "cache", ASSOC_INTERPRET=0))
    assert compiling > 1.0 and in_time and not stopped


def test_a_run_and_its_parts_do_not_count_what_is_compiled(monkeypatch):
    clock = [100.0]
    for name in ("perf_counter", "monotonic"):
        monkeypatch.setattr(time, name, lambda: clock[0])
    run = Run(0, time_limit=5.0, started=100.0)
    part = run.part(0, 5.0)
    with loading():
        clock[0] += 30.0
    clock[0] += 1.0
    for one in (run, part, run.part(0, 5.0)):
        assert one.remaining() == 4.0 and one.deadline() == 135.0
    # a worker asks the clock of the run, whatever its own thread has compiled
    with ThreadPoolExecutor(1) as pool:
        assert pool.submit(run.remaining).result() == 4.0


@pytest.fixture
def scene():
    return simulate("bearing-only", targets=2, scans=1, seed=1)


def test_results_report_it_apart(scene):
    result = assoc.associate(scene, "greedy")
    (scan,) = result.scans
    # costs and positions compile, too
    assert 0.0 <= scan.solution.compile_time <= scan.compile_time
    assert result.totals()["compile_time"] == scan.compile_time == scan.to_dict()["compile_time"]
    assert assoc.associate(scene, "greedy").totals()["compile_time"] < 1e-3
