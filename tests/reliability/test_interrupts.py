"""Ctrl-C in the middle of a solve: it ends soon, in the library by KeyboardInterrupt, and what was there stays."""

import json

import pytest

from tests.running import printed, process

LIBRARY = """
import _thread, json, os, signal, sys, threading
import numpy as np
import assoc
from tests.reliability.big import ghosts

problem = ghosts(60, 60_000)
# first calls compile, and would be late for that
endless = {"iterations": 10**9, "patience": 10**9}
ways = {
    "exact": lambda limit: assoc.assign(problem, "exact", time_limit=limit),
    "aco": lambda limit: assoc.assign(problem, "aco", time_limit=limit, **endless),
    "tabu": lambda limit: assoc.assign(problem, "tabu", time_limit=limit, **endless),
    "genetic": lambda limit: assoc.assign(problem, "genetic", time_limit=limit, **endless),
    "milp": lambda limit: assoc.assign(problem, "milp", time_limit=limit),
    "kbest": lambda limit: assoc.kbest(problem, 10**6, time_limit=limit),
}
heard = {}
for name in sys.argv[1].split(","):
    ways[name](0.3)
    heard[name] = False
    # Python drops an interrupt that comes in a destructor (while a kernel is compiled, say): once more then
    for attempt in range(3):
        threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT)).start()
        try:
            ways[name](30.0)
        except KeyboardInterrupt:
            heard[name] = True
            break
print(json.dumps(heard), flush=True)
# a MIP that was left behind may still be at work
os._exit(0)
"""


CONVERTING = """
import os, signal, threading
import assoc
from tests.reliability.big import ghosts

problem = ghosts(60, 60_000)
# long enough that no kernel is left to compile or to load
assoc.assign(problem, "exact", time_limit=5.0)
heard = 0
for delay in (0.02, 0.03, 0.05, 0.08, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35):
    threading.Timer(delay, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
    try:
        assoc.assign(problem, "exact", time_limit=5.0)
    except KeyboardInterrupt:
        heard += 1
print(heard, flush=True)
os._exit(0)
"""


@pytest.mark.slow
def test_while_a_result_is_converted():
    # a signal that comes during a kernel is heard when its result is converted: a record's class is then missing
    assert printed("-c", CONVERTING).strip() == "10"


RECORDS = """
import gc, json
import assoc
from numba.core import types
from numba.core.dispatcher import Dispatcher
from tests.reliability.answers import answers
from tests.reliability.big import ghosts

assoc.warm_up()
answers(["costs", "tracks", "rankings"])
assoc.kbest(ghosts(20, 5_000), 5, time_limit=3.0)

def holds_record(kind):
    if isinstance(kind, types.Optional):
        return holds_record(kind.type)
    return isinstance(kind, types.BaseNamedTuple) or isinstance(kind, types.BaseTuple) and any(map(holds_record, kind))

kernels = [one for one in gc.get_objects() if isinstance(one, Dispatcher) and one.__module__.startswith("assoc.")]
called = [one for one in kernels if one.overloads]
bad = [one.__name__ for one in called for own in one.overloads.values() if holds_record(own.signature.return_type)]
print(json.dumps([len(called), sorted(bad)]), flush=True)
"""


@pytest.mark.slow
def test_no_kernel_that_python_calls_returns_a_record():
    # what the test above sees where the signal comes in time; the first process compiles, also kernels that kernels
    # call, the second one loads those alone that Python calls
    for _ in range(2):
        num_called, bad = json.loads(printed("-c", RECORDS, ASSOC_INTERPRET=0))
    assert num_called > 50
    assert bad == []


LOADING = """
import signal
import sys
import assoc
from numba.core.registry import cpu_target

problem = assoc.AssignmentProblem([[1, 1, 0], [1, 2, 1], [2, 1, 0]], [-1.0, -3.0, -2.0], [2, 2, 1])
engine = cpu_target.target_context.codegen()._engine._ee
hand_over = engine._object_cache_getbuffer
asked = heard = 0

def interrupted(module):
    global asked
    asked += 1
    # every other one, so that the next call comes further
    if asked % 2:
        signal.raise_signal(signal.SIGINT)
    return hand_over(module)

if "interrupted" in sys.argv:
    engine._object_cache_getbuffer = interrupted
while True:
    try:
        cost = assoc.assign(problem, "exact").cost
        break
    except KeyboardInterrupt:
        heard += 1
print(heard > 3, cost, flush=True)
"""


@pytest.mark.slow
def test_while_a_kernel_is_loaded():
    # LLVM asks Python for compiled code, and takes none for empty code
    for word, heard in (("alone", "False"), ("interrupted", "True")):
        assert printed("-c", LOADING, word, ASSOC_INTERPRET=0).split() == [heard, "-5.0"]


@pytest.mark.slow
def test_in_the_library():
    names = ["exact", "aco", "tabu", "genetic", "milp", "kbest"]
    done = process("-c", LIBRARY, ",".join(names))
    assert done.returncode == 0, done.stderr
    # what is not interrupted comes back at its time limit
    assert json.loads(done.stdout) == dict.fromkeys(names, True)
