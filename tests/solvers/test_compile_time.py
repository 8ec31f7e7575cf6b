"""Compiling is told apart from solving: in a first process after installation, in a later one, and in none."""

import json
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import pytest

import assoc
from assoc._system import compile_time
from assoc._system.compile_time import compile_seconds, is_compiling, loading
from assoc.packing.run import Run
from assoc.simulation import simulate
from assoc.solvers import Outcome, registry
from tests.running import printed

# one small kernel in place of a solver's many
_PROGRAM = """
import json, time
from assoc._system.compiled import njit
from assoc.packing.run import Run

@njit
def kernel(x):
    return np.sort(x).sum()

import numpy as np

times = []
for _ in range(2):
    run = Run(0)
    kernel(np.ones(9))
    runtime = run.runtime()
    times.append([time.perf_counter() - run.started, runtime, run.compile_time()])
print(json.dumps(times))
"""
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
@pytest.mark.parametrize("text", [_PROGRAM, _SOLVER], ids=["kernel", "solver"])
def test_a_first_process_and_a_second(text, tmp_path):
    program = tmp_path / "program.py"
    program.write_text(text)
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


def test_compiling_is_announced_once(capsys):
    one = compile_time.Announcement()
    one.begin()
    one.end()
    assert capsys.readouterr().err == ""  # not yet
    one = compile_time.Announcement(0.02)
    for _ in range(2):
        one.begin()
        time.sleep(0.1)
        one.end()
    assert capsys.readouterr().err == (
        "assoc: compiling kernels, once after installation (assoc.warm_up() does it ahead)\n"
    )
    other = compile_time.Announcement()
    with other.silenced():
        other.begin()
        time.sleep(0.1)
        other.end()
    assert capsys.readouterr().err == ""


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


def test_the_summary_says_what_was_compiled(scene):
    def slow(packing, parameters, run):
        with loading():
            time.sleep(0.2)
        return Outcome([], 1)

    registry.register("slow", registry.parameters("greedy"), slow)
    assoc.associate(scene, "greedy")
    assert "compiling" not in assoc.associate(scene, "greedy").summary()
    found = assoc.associate(scene, "slow")
    assert found.totals()["compile_time"] >= 0.2
    assert f"{found.totals()['compile_time']:.1f} s more for compiling" in found.summary()


def test_only_the_own_thread_counts():
    def load():
        with loading():
            time.sleep(0.02)

    before = compile_seconds()
    other = threading.Thread(target=load)
    other.start()
    other.join()
    assert compile_seconds() == before
    with loading(), loading():
        time.sleep(0.02)
    assert 0.02 <= compile_seconds() - before < 5.0


def test_what_was_interrupted_counts_no_further():
    before = compile_seconds()
    with pytest.raises(KeyboardInterrupt), loading():
        raise KeyboardInterrupt
    stopped = compile_seconds()
    time.sleep(0.02)
    with loading():
        time.sleep(0.01)
    assert before <= stopped and 0.01 <= compile_seconds() - stopped < 5.0


def test_who_shows_progress_can_ask_whether_a_thread_compiles():
    inside, done = threading.Event(), threading.Event()

    def work():
        with loading():
            inside.set()
            done.wait(300)

    thread = threading.Thread(target=work)
    assert not is_compiling()
    thread.start()
    inside.wait(300)
    assert is_compiling() and not is_compiling(1000.0)
    done.set()
    thread.join()
    assert not is_compiling()
