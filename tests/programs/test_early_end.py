"""Ctrl-C in the middle of a program: what is finished is written, and said; and what `-v` tells meanwhile."""

import json
import os
import re
import signal
import subprocess
import sys
import time

import pytest

from assoc.simulation import simulate
from tests.running import process
from tests.sizes import sample
from tests.told import told

ASLEEP = """
import time
from dataclasses import dataclass
from assoc.solvers import Outcome, Parameters, register
import numpy as np

@dataclass(frozen=True)
class Nothing(Parameters):
    pass

def solve(packing, parameters, run):
    # takes its time until it is told to end, from the third scan on
    solve.calls += 1
    print("scan", solve.calls, flush=True)
    while solve.calls > 2 and not run.should_stop():
        time.sleep(0.01)
    return Outcome(np.zeros(0, dtype=np.int64), 0)

solve.calls = 0
register("asleep", Nothing, solve)
"""


def interrupted(words, cwd, at, number=signal.SIGINT):
    """Send a program a signal when it prints a line; returns exit code, the rest of stdout, and stderr."""
    command = [sys.executable, "-u", "-m", "assoc", *words]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(cwd), os.environ.get("PYTHONPATH", "")])}
    with subprocess.Popen(command, cwd=cwd, text=True, env=environment, **pipes) as process:
        for line in process.stdout:
            if line.strip() == at:
                break
        time.sleep(0.3)
        process.send_signal(number)
        out, errors = process.communicate(timeout=600)
    return process.returncode, out, told(errors)


@pytest.fixture
def work(tmp_path):
    simulate("three-radar", 2, scans=5).save(tmp_path / "scene.npz")
    (tmp_path / "asleep.py").write_text(ASLEEP)
    return tmp_path


@pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="needs POSIX signals")
@sample("number, word", [(signal.SIGINT, "interrupted"), (signal.SIGTERM, "terminated")], every=2)
def test_what_is_finished_is_written(work, number, word):
    words = ["solve", "scene.npz", "--import", "asleep", "--solver", "asleep", "--json", "o.json", "--csv", "o.csv"]
    code, out, errors = interrupted(words, work, "scan 3", number)
    assert (code, errors) == (128 + number, f"assoc.solve: {word}; 3 of 5 scans are finished and written\n")
    scans = json.loads((work / "o.json").read_text())["scans"]
    assert [one["scan"] for one in scans] == [0, 1, 2] and len((work / "o.csv").read_text().splitlines()) == 4
    assert "3 scans," in out
    assert "interrupted" in (work / "o.csv").read_text()


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="needs POSIX signals")
def test_an_interrupt_does_not_reach_the_writing(work):
    """A disk that takes two seconds; there is no patience with what loads kernels."""
    slow = """
import os
from assoc._system.compile_time import loading

sync = os.fsync

def nap(seconds):
    while seconds > 0:
        time.sleep(0.05)
        seconds -= 0.05

def fsync(handle):
    nap(2)
    sync(handle)

os.fsync = fsync

def solve(packing, parameters, run):
    solve.calls += 1
    print("scan", solve.calls, flush=True)
    if solve.calls > 2:
        with loading():
            nap(60)
"""
    start, _, end = ASLEEP.partition("def solve")
    rest = end[end.index("    return") :]
    (work / "asleep.py").write_text(start + slow + rest)
    words = ["solve", "scene.npz", "--import", "asleep", "--solver", "asleep", "--json", "o.json"]
    code, _, errors = interrupted(words, work, "scan 3")
    assert (code, errors) == (130, "assoc.solve: interrupted; 2 of 5 scans are finished and written\n")
    assert len(json.loads((work / "o.json").read_text())["scans"]) == 2


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="needs POSIX signals")
def test_it_ends_though_a_thread_does_not(work):
    hanging = ASLEEP.replace(
        "solve.calls += 1", "solve.calls += 1\n    threading.Thread(target=time.sleep, args=(600,)).start()"
    )
    (work / "asleep.py").write_text("import threading\n" + hanging)
    code, _, errors = interrupted(["solve", "scene.npz", "--import", "asleep", "--solver", "asleep"], work, "scan 3")
    assert (code, errors) == (130, "assoc.solve: interrupted; 3 of 5 scans are finished and written\n")


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="needs POSIX signals")
def test_tracks_that_are_finished_are_written(work):
    words = ["track", "scene.npz", "--import", "asleep", "--solver", "asleep", "-o", "t.csv", "--report", "t.html"]
    code, out, errors = interrupted(words, work, "scan 3")
    told = re.fullmatch(r"assoc.track: interrupted; the tracks of (\d) of 5 scans are written\n", errors)
    assert code == 130 and told, errors
    # a tracker may call its solver twice in a scan
    assert 1 <= int(told[1]) <= 3 and f"{told[1]} scans" in out
    assert (work / "t.csv").read_text().startswith("track_id") and (work / "t.html").exists()


ASKED = """
import assoc
from assoc._system.interrupts import ask_to_end
from assoc.simulation import simulate

problem = assoc.build_problem(simulate("bearing-only", 1, targets=40, scans=1), 0)
ask_to_end()
solution = assoc.assign(problem, "aco")
assert solution.stopped_by == "interrupted" and solution.status == "feasible"
assert solution.lower_bound <= solution.cost < 0
"""


def test_a_search_ends_when_it_is_asked_to():
    """In a process of its own: what is asked for is not taken back."""
    done = process("-c", ASKED)
    assert done.returncode == 0, done.stderr
